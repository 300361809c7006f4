"""NIfTI over the product of its options."""

import gzip
import math
import struct

import numpy as np

from case import LPS, Case, Grid, affine, product_of
from flat import KINDS, OBLIQUE, ORIGIN, values_of
from readers import itk, nibabel_

TYPES = {"u1": 2, "i2": 4, "i4": 8, "f4": 16, "f8": 64, "i1": 256, "u2": 512, "u4": 768, "i8": 1024, "u8": 1280}
QUATERNION = (0.1, -0.2, 0.3)


def cases():
    for version, order, kind in product_of([1, 2], "<>", KINDS):
        yield nifti_case(
            f"NIfTI type: version {version}, {'little' if order == '<' else 'big'} endian, {kind}",
            kind,
            version=version,
            order=order,
        )
    for version, file in product_of(
        [1, 2],
        [
            "a.nii",
            "a.nii.gz",
            "a.hdr",
            "a.img",
            "a.hdr.gz",
            "a.img.gz",
            "A.NII",
            "plain.nii.gz",
            "packed.nii",
            "members.nii.gz",
        ],
    ):
        yield nifti_case(f"NIfTI file: version {version}, {file}", version=version, file=file)
    odd = "(?i)scl_slope|scl_inter|scal"
    for slope, inter in product_of([1, 0, 2.5, -1, 1e-3, math.nan, math.inf], [0, -1024, 0.5, math.nan, math.inf]):
        case = nifti_case(f"NIfTI scaling: slope {slope:g}, intercept {inter:g}", "i2", slope=slope, inter=inter)
        if not math.isfinite(slope) or not math.isfinite(inter) and slope != 0:
            case.odd = case.warns = odd
        yield case
    for kind in ["u1", "i4", "f4", "f8"]:
        yield nifti_case(f"NIfTI scaling: slope 2, intercept -1024, {kind}", kind, slope=2, inter=-1024)
    for sform, qform, qfac, agree in product_of([0, 1, 2, 4, -1], [0, 1, -1], [1, -1, 0], [True, False]):
        if (sform < 1 or qform < 1) and not agree or qform < 1 and qfac != 1:
            continue
        name = (
            f"NIfTI orientation: sform {sform}, qform {qform}, qfac {qfac}"
            f"{'' if agree or sform < 1 or qform < 1 else ', at odds'}"
        )
        odd = "qform_code|sform_code" if min(sform, qform) < 0 else None
        yield nifti_case(name, sform=sform, qform=qform, qfac=qfac, agree=agree, odd=odd)
    for units, sform in product_of([0, 1, 2, 3, 2 + 8, 3 + 16, 5], [1, 0]):
        case = nifti_case(
            f"NIfTI units: code {units}, by {'sform' if sform else 'qform'}", units=units, sform=sform, qform=1
        )
        if units == 5:
            case.odd = case.warns = "(?i)unit"
        yield case
    for what, dims in {
        "x, y": [2, 5, 4],
        "1 volume": [4, 5, 4, 3, 1],
        "5 axes": [5, 5, 4, 3, 1, 1],
        "4th is 0": [4, 5, 4, 3, 0],
        "7 axes": [7, 5, 4, 3, 1, 1, 1, 1],
    }.items():
        yield nifti_case(f"NIfTI axes: {what}", dims=dims)
    for what, dims in {"none": [0, 5, 4, 3], "8": [8, 5, 4, 3], "below 0": [3, 5, -4, 3], "0": [3, 5, 0, 3]}.items():
        yield nifti_case(f"NIfTI axes: {what}", dims=dims, right=False, odd="(?i)dim")
    for index in [None, 0, 1]:
        case = nifti_case(
            f"NIfTI axes: 2 volumes, {'none asked for' if index is None else f'number {index}'}",
            dims=[4, 5, 4, 3, 2],
            volumes=2,
            index=index or 0,
            right=index is not None,
            odd="(?i)volume",
        )
        case.options = {} if index is None else {"volume_index": index}
        yield case
    for offset, version in product_of([0, 352, 360, 512, 544, 1000], [1, 2]):
        least = 352 if version == 1 else 544
        case = nifti_case(
            f"NIfTI offset: {offset}, version {version}", version=version, offset=offset, at=max(offset, least)
        )
        if offset < least:
            case.odd, case.truth = "vox_offset", case.truth if offset == 0 else None
            case.warns = case.odd
        yield case
    for spacing, qform in product_of([-1, 0, math.nan], [1, 0]):
        case = nifti_case(
            f"NIfTI pixdim: {spacing}, {'with' if qform else 'without'} qform", sform=0, qform=qform, pixdim=spacing
        )
        case.odd = case.warns = "(?i)pixdim"
        case.truth = case.truth if spacing == -1 else None
        yield case
    for kind, code in {
        "RGB": 128,
        "RGBA": 2304,
        "complex": 32,
        "binary": 1,
        "unknown": 0,
        "float128": 1536,
        "77": 77,
    }.items():
        yield nifti_case(f"NIfTI type: {kind}", code=code, right=False, odd="(?i)scalar|datatype")
    for what, edit in {
        "magic of a pair": lambda b: b[:344] + b"ni1\0" + b[348:],
        "no magic": lambda b: b[:344] + b"\0\0\0\0" + b[348:],
        "cut short": lambda b: b[:-3],
        "bytes after the end": lambda b: b + b"\1\2\3",
        "bitpix 8": lambda b: b[:72] + b"\x08\0" + b[74:],
        "singular sform": lambda b: b[:280] + b"\0" * 48 + b[328:],
    }.items():
        plain = what == "bytes after the end"
        yield nifti_case(
            f"NIfTI header: {what}",
            edit=edit,
            right=plain or what == "bitpix 8",
            odd="(?i)img|pair|magic|expected|bytes|bitpix|singular|affine",
        )


def nifti_case(
    name,
    kind="i2",
    version=1,
    order="<",
    file="a.nii",
    slope=1,
    inter=0,
    sform=1,
    qform=0,
    qfac=1,
    agree=True,
    units=2,
    dims=(3, 5, 4, 3),
    volumes=1,
    index=0,
    offset=None,
    at=None,
    pixdim=None,
    code=None,
    right=True,
    odd=None,
    edit=lambda content: content,
):
    shape = tuple(dims[1:4]) if len(dims) > 3 and min(dims[1:4]) > 0 else (5, 4, 1 if len(dims) == 3 else 3)
    stored = values_of(name, kind, (*shape, volumes))
    matrix = affine(OBLIQUE, ORIGIN, LPS)
    spacing = np.linalg.norm(OBLIQUE, axis=1)
    rotation, qmatrix = qform_of(spacing, qfac)
    if sform > 0 and qform > 0 and agree:
        matrix = qmatrix
    pair = ".hdr" in file or ".img" in file
    at = at or (0 if pair else 352 if version == 1 else 544)

    def write(folder):
        pixels = spacing.copy()
        if pixdim is not None:
            pixels[1] = pixels[1] * pixdim
        header = nifti_header(
            version,
            order,
            [*dims, *[1] * (8 - len(dims))],
            code or TYPES[kind],
            int(kind[1]) * 8,
            [qfac, *pixels, 1, 1, 1, 1],
            at if offset is None else offset,
            slope,
            inter,
            units,
            qform,
            sform,
            rotation,
            ORIGIN_Q,
            matrix,
            pair,
        )
        if code == 0:
            header = header[:70] + b"\0\0" + header[72:]
        data = stored.astype(order + kind).tobytes(order="F")
        packed = gzip.compress if ".gz" in file and not file.startswith("plain") or file.startswith("packed") else bytes
        if file.startswith("members"):
            packed = lambda content: gzip.compress(content[:400], mtime=0) + gzip.compress(content[400:], mtime=0)
        if pair:
            (folder / file.replace(".img", ".hdr")).write_bytes(packed(header + b"\0" * 4))
            (folder / file.replace(".hdr", ".img")).write_bytes(packed(data))
        else:
            (folder / file).write_bytes(edit(packed((header + b"\0" * 4).ljust(at, b"\0") + data)))
        return folder / file

    values = stored[..., index]
    if slope != 0 and math.isfinite(slope) and math.isfinite(inter):
        values = values * float(np.float32(slope)) + float(np.float32(inter))
    source = matrix if sform > 0 else qmatrix if qform > 0 else np.diag([*spacing, 1])
    source = source.copy()
    source[:3] *= {1: 1000, 3: 0.001}.get(units & 7, 1)
    truth = Grid(values, source, sform > 0 or qform > 0)
    return Case(
        name,
        write,
        truth if right else None,
        {"nibabel": lambda path: nibabel_(path, index), "SimpleITK": lambda path: itk(path, index)},
        odd,
    )


ORIGIN_Q = [12.5, -30.25, -100.0]


def qform_of(spacing, qfac):
    """Returns the quaternion and the affine of it, to mm RAS."""
    b, c, d = QUATERNION
    a = math.sqrt(1 - b * b - c * c - d * d)
    rotation = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ]
    )
    columns = rotation * spacing * [1, 1, -1 if qfac < 0 else 1]
    return QUATERNION, affine(columns.T, ORIGIN_Q)


def nifti_header(
    version, order, dim, code, bits, pixdim, offset, slope, inter, units, qform, sform, quaternion, shift, matrix, pair
):
    head = bytearray(348 if version == 1 else 540)
    put = lambda kind, at, *values: struct.pack_into(order + kind, head, at, *values)
    if version == 1:
        put("i", 0, 348)
        put("8h", 40, *dim)
        put("hh", 70, code, bits)
        put("8f", 76, *pixdim)
        put("3f", 108, offset, slope, inter)
        put("B", 123, units)
        put("2h", 252, qform, sform)
        put("6f", 256, *quaternion, *shift)
        put("12f", 280, *matrix[:3].ravel())
        head[344:348] = b"ni1\0" if pair else b"n+1\0"
    else:
        put("i", 0, 540)
        head[4:12] = b"ni2\0\r\n\x1a\n" if pair else b"n+2\0\r\n\x1a\n"
        put("hh", 12, code, bits)
        put("8q", 16, *dim)
        put("8d", 104, *pixdim)
        put("q", 168, offset)
        put("2d", 176, slope, inter)
        put("2i", 344, qform, sform)
        put("6d", 352, *quaternion, *shift)
        put("12d", 400, *matrix[:3].ravel())
        put("i", 500, units)
    return bytes(head)
