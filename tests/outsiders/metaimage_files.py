"""MetaImage over the product of its options."""

import zlib

import numpy as np

from case import LPS, Case, Grid, affine, product_of
from flat import KINDS, OBLIQUE, ORIGIN, SHAPE, text_of, values_of
from readers import itk

META_TYPES = {
    "u1": "MET_UCHAR",
    "i1": "MET_CHAR",
    "i2": "MET_SHORT",
    "u2": "MET_USHORT",
    "i4": "MET_INT",
    "u4": "MET_UINT",
    "i8": "MET_LONG_LONG",
    "u8": "MET_ULONG_LONG",
    "f4": "MET_FLOAT",
    "f8": "MET_DOUBLE",
}


def cases():
    for order, packing, kind in product_of(["little", "big"], ["plain", "zlib", "text"], KINDS):
        yield meta_case(f"MetaImage type: {order} endian, {packing}, {kind}", kind, order, packing)
    for type_, kind in [("MET_LONG", "i4"), ("MET_ULONG", "u4")]:
        yield meta_case(f"MetaImage type: {type_}", kind, type_=type_)
    for file, packing in product_of(
        [
            "LOCAL",
            "local",
            "data.raw",
            "my data.raw",
            "sub/data.raw",
            "LIST",
            "LIST 2D",
            "%d.raw 0 2 1",
            "100%.raw",
            "50 % dose.raw",
        ],
        ["plain", "zlib"],
    ):
        several = file.startswith("LIST") or "%d" in file
        yield meta_case(
            f"MetaImage file: {file}, {packing}",
            packing=packing,
            file=file,
            odd="(?i)file|LIST|%" if several or file.startswith("50") else None,
        )
    for matrix, origin, spacing in product_of(
        ["TransformMatrix", "Rotation", "Orientation", None],
        ["Offset", "Position", "Origin", None],
        ["ElementSpacing", "ElementSize", None],
    ):
        yield meta_case(
            f"MetaImage place: {matrix}, {origin}, {spacing}", matrix=matrix, origin=origin, spacing=spacing
        )
    for extra, odd in {
        "CenterOfRotation = 5 6 7": None,
        "CenterOfRotation = 0 0 0": None,
        "AnatomicalOrientation = RAI": None,
        "AnatomicalOrientation = LPS": None,
        "AnatomicalOrientation = ???": None,
        "Modality = MET_MOD_CT": None,
        "ElementMin = -5": None,
        "HeaderSize = 0": None,
        "ElementSize = 9 9 9": None,
        "Comment = a: b": None,
        "Name = x": None,
        "DistanceUnits = um": "(?i)unit",
        "DistanceUnits = mm": None,
        "DistanceUnits = m": "(?i)unit",
        "CompressedDataSize = 9999": None,
        "ElementToIntensityFunctionSlope = 2": "(?i)ElementToIntensity",
        "ElementToIntensityFunctionOffset = -1024": "(?i)ElementToIntensity",
        "ElementNumberOfChannels = 1": None,
        "SomethingElse = 3": None,
        "ElementByteOrderMSB = False": None,
        "ID = 4": None,
    }.items():
        case = meta_case(f"MetaImage field: {extra}", extra=[extra], odd=odd, warns=odd)
        case.truth.affine[:3] *= {"DistanceUnits = um": 0.001, "DistanceUnits = m": 1000}.get(extra, 1)
        yield case
    for what, shape in {"two": (5, 4), "four, 1 volume": (5, 4, 3, 1), "four, 2 volumes": (5, 4, 3, 2)}.items():
        for index in [None, 1] if "2" in what else [None]:
            case = meta_case(f"MetaImage axes: {what}{', number 1' if index else ''}", shape=shape, index=index or 0)
            case.odd = "(?i)NDims|volume" if what == "two" or "2" in what else None
            case.truth = None if "2" in what and index is None else case.truth
            case.options = {} if index is None else {"volume_index": index}
            yield case
    for size, packing in product_of([9, -1, 99], ["plain", "zlib"]):
        case = meta_case(f"MetaImage header size: {size}, {packing}", packing=packing, file="data.raw", before=size)
        case.odd = None if packing == "plain" else "(?i)HeaderSize"
        yield case
    bad = "(?i)ObjectType|TransformMatrix|ElementSpacing|DimSize|NDims|ElementType|Channels|ElementDataFile|affine|grid|voxels|bytes|True|header|volume"
    for what, bend in {
        "CRLF": lambda head: head.replace("\n", "\r\n"),
        "no blanks": lambda head: head.replace(" = ", "="),
        "lower case keys": str.lower,
        "colons": lambda head: head.replace(" = ", ": "),
        "no ObjectType": lambda head: head.replace("ObjectType = Image\n", ""),
        "NDims later": lambda head: head.replace("NDims = 3\n", "").replace("DimSize", "NDims = 3\nDimSize"),
        "spacing of 0": lambda head: head.replace("0.5 0.75 2.5", "0.5 0 2.5"),
        "spacing below 0": lambda head: head.replace("0.5 0.75 2.5", "0.5 -0.75 2.5"),
        "one size less": lambda head: head.replace("DimSize = 5 4 3", "DimSize = 5 4"),
        "3 channels": lambda head: head.replace("NDims = 3", "NDims = 3\nElementNumberOfChannels = 3"),
        "singular matrix": lambda head: head.replace("0.8 0.6 0 ", "0 0 0 "),
        "unknown type": lambda head: head.replace("MET_SHORT", "MET_OTHER"),
        "array type": lambda head: head.replace("MET_SHORT", "MET_SHORT_ARRAY"),
        "MSB weird": lambda head: head.replace("MSB = False", "MSB = Maybe"),
        "cut off": lambda head: head[:80],
        "spatial object": lambda head: head.replace("= Image", "= Mesh"),
        "spacing with commas": lambda head: head.replace("0.5 0.75 2.5", "0,5 0,75 2,5"),
    }.items():
        plain = what in ["CRLF", "no blanks", "no ObjectType", "NDims later", "colons"]
        case = meta_case(f"MetaImage header: {what}", bend=bend, odd=None if plain else bad)
        if what == "spacing below 0":
            # ITK turns the axis round.
            case.truth.affine[:3, 1] *= -1
        elif not plain and what != "lower case keys":
            case.truth = None
        yield case


def meta_case(
    name,
    kind="i2",
    order="little",
    packing="plain",
    type_=None,
    file="LOCAL",
    matrix="TransformMatrix",
    origin="Offset",
    spacing="ElementSpacing",
    extra=(),
    shape=SHAPE,
    index=0,
    before=0,
    bend=lambda head: head,
    odd=None,
    warns=None,
):
    stored = values_of(name, kind, shape)
    rank = len(shape)
    lengths = np.linalg.norm(OBLIQUE, axis=1)

    def write(folder):
        directions = np.eye(rank)
        n = min(rank, 3)
        directions[:n, :n] = (OBLIQUE / lengths[:, None])[:n, :n] if n == 3 else np.eye(2)
        row = lambda values, last: " ".join(f"{v:.10g}" for v in [*values[:n], *[last] * (rank - n)])
        lines = [
            "ObjectType = Image",
            f"NDims = {rank}",
            f"BinaryData = {packing != 'text'}",
            f"BinaryDataByteOrderMSB = {order == 'big'}",
            f"CompressedData = {packing == 'zlib'}",
        ]
        lines += [f"{matrix} = {' '.join(f'{v:.10g}' for v in directions.ravel())}"] if matrix else []
        lines += [f"{origin} = {row(ORIGIN, 0)}"] if origin else []
        lines += [f"{spacing} = {row(lengths, 1)}"] if spacing else []
        lines += [f"DimSize = {' '.join(map(str, shape))}", *extra, f"ElementType = {type_ or META_TYPES[kind]}"]
        lines += [f"HeaderSize = {before}"] if before else []
        names = (
            [f"s{i}.raw" for i in range(3)]
            if file.startswith("LIST")
            else [f"{i}.raw" for i in range(3)]
            if "%d" in file
            else [file]
        )
        lines += [f"ElementDataFile = {file}", *(names if file.startswith("LIST") else [])]
        head = bend("\n".join(lines) + "\n").encode()
        local = file.lower() == "local"
        for name, part in zip(names, np.array_split(stored, len(names), axis=-1)):
            data = part.astype(("<" if order == "little" else ">") + kind).tobytes(order="F")
            content = zlib.compress(data) if packing == "zlib" else text_of(part) if packing == "text" else data
            if local:
                # MetaIO needs the length of what is packed in the same file.
                packed = f"CompressedDataSize = {len(content)}\n".encode() if packing == "zlib" else b""
                (folder / "a.mha").write_bytes(head.replace(b"ElementDataFile", packed + b"ElementDataFile") + content)
                return folder / "a.mha"
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(b"\1" * (5 if before == -1 else before) + content)
        (folder / "a.mhd").write_bytes(head)
        return folder / "a.mhd"

    steps = np.diag(lengths) if spacing else np.eye(3)
    if matrix and rank != 2:
        steps = steps @ (OBLIQUE / lengths[:, None])
    values = stored[..., index] if rank == 4 else stored[..., None] if rank == 2 else stored
    start = [*ORIGIN[:2], 0] if rank == 2 else ORIGIN
    if rank == 2:
        steps[2] = [0, 0, 1]
    truth = Grid(values, affine(steps, start if origin else [0, 0, 0], LPS), bool(matrix))
    return Case(name, write, truth, {"SimpleITK": lambda path: itk(path, index)}, odd, warns)
