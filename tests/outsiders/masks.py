"""DICOM segmentations and RT structure sets as regions of a CT."""

import itertools

import highdicom
import numpy as np
import pydicom
import shapely
from pydicom.dataset import Dataset
from pydicom.sr.codedict import codes
from pydicom.uid import JPEG2000Lossless, JPEGLSLossless, RLELossless, UID

from case import Case, Grid, product_of, random
from dicom_stacks import delete
from series import (
    ALONG,
    BIG,
    DEFLATED,
    EXPLICIT,
    IMPLICIT,
    NORMAL,
    ORIGIN,
    SPACING,
    STEP,
    Pixels,
    Series,
    decimal,
    plain,
)

SLICES, ROWS, COLUMNS = 7, 34, 33


def cases():
    yield from segmentations()
    yield from segments()
    yield from structure_sets()


def scan(folder, between=False, syntax=EXPLICIT):
    """Writes the CT of the masks; returns its series and its slices."""
    series = Series("scan of masks", shape=[SLICES, ROWS, COLUMNS], syntax=syntax)
    if between:
        series.edit = lambda data, i: setattr(data, "SpacingBetweenSlices", decimal(STEP))
    path = folder / "ct"
    path.mkdir()
    series.write(path)
    return series, [pydicom.dcmread(path / f"slice{i}.dcm") for i in range(SLICES)]


TRUTH = Series("scan of masks", shape=[SLICES, ROWS, COLUMNS]).truth()


def region(values):
    """Returns the grid of the CT with weights [slice, row, column]."""
    return Grid(np.asarray(values, "f8").T, TRUTH.affine)


def masks(name, slices, count=2, overlap=False):
    """Returns structures [slice, row, column, structure] on some slices; each of them reaches its first and last."""
    out = np.zeros([SLICES, ROWS, COLUMNS, count], "u1")
    labels = random(name, [SLICES, ROWS, COLUMNS], 0, count)
    for k in range(count):
        out[slices, ..., k] = (labels == k + 1)[slices]
    for k in range(count):
        out[slices, 1 + k, 1] = np.arange(count) == k
    if overlap:
        out[slices[0], 5, 5:8] = 1
    return out


def described(number, label):
    return highdicom.seg.SegmentDescription(
        number,
        label,
        codes.SCT.Organ,
        codes.SCT.Organ,
        "AUTOMATIC",
        highdicom.AlgorithmIdentificationSequence("test", codes.cid7162.ArtificialIntelligence, "1"),
    )


SLICE_SETS = {
    "all slices": list(range(SLICES)),
    "slices 1, 3, 5": [1, 3, 5],
    "slices 1 and 6": [1, 6],
    "slices 2 to 4": [2, 3, 4],
    "slice 3": [3],
}


def segmentation(
    name,
    kind,
    slices,
    omit=True,
    between=False,
    syntax=EXPLICIT,
    edit=lambda data: None,
    labels="one",
    numbers=(1,),
    overlap=False,
    names=("one", "two"),
    **case,
):
    pixels = masks(name, slices, len(names), overlap)
    if kind == "FRACTIONAL":
        # One structure, in parts of 255 that are binary fractions nowhere.
        pixels = pixels[..., :1] * random(name + " parts", [*pixels.shape[:3], 1], 1, 255) / 255.0
        names = names[:1]

    def write(folder):
        _, sources = scan(folder, between)
        what = pixels
        if kind == "LABELMAP":
            what = (pixels * np.arange(1, len(names) + 1)).max(-1).astype("u1")
        data = highdicom.seg.Segmentation(
            sources,
            what,
            kind,
            [described(i + 1, label) for i, label in enumerate(names)],
            "1.2.3.5",
            3,
            "1.2.3.4",
            1,
            "m",
            "m",
            "1",
            "1",
            omit_empty_frames=omit,
            transfer_syntax_uid=syntax,
            max_fractional_value=255,
        )
        edit(data)
        data.save_as(folder / "seg.dcm")
        return folder / "seg.dcm"

    def read(path):
        data = highdicom.seg.segread(path)
        volume = data.get_volume(
            segment_numbers=sorted(numbers),
            combine_segments=False,
            rescale_fractional=True,
            allow_missing_positions=True,
        )
        return on_scan(volume.array.astype("f8").max(-1), volume.affine)

    right = pixels[..., [n - 1 for n in numbers]].max(-1)
    options = {"volume": "ct"} | ({"labels": labels} if labels else {})
    return Case(name, write, region(right), {"highdicom": read}, options=options, **case)


def on_scan(values, affine):
    """Returns values [slice, row, column] of a grid that lies on the slices of the CT, on the grid of the CT."""
    out = np.zeros([SLICES, ROWS, COLUMNS])
    axes = np.column_stack([ALONG[1] * SPACING[0], ALONG[0] * SPACING[1]])
    assert np.allclose(affine[:3, 1:3], axes, atol=1e-4), "its rows and columns are those of the CT"
    for k, plane in enumerate(values):
        place = affine[:3, 3] + k * affine[:3, 0]
        at = round(float((place - ORIGIN) @ NORMAL / STEP))
        assert np.allclose(place, ORIGIN + at * STEP * NORMAL, atol=1e-4), "it lies on the slices"
        out[at] = plane
    return region(out)


def segmentations():
    """Type x slices x empty frames x Spacing Between Slices x transfer syntax."""
    for kind, slices, omit, between in product_of(
        ["BINARY", "FRACTIONAL", "LABELMAP"], SLICE_SETS, [True, False], [True, False]
    ):
        name = (
            f"segmentation: {kind}, {slices}, empty slices {'left out' if omit else 'kept'}, Spacing Between Slices "
            f"{'there' if between else 'absent'}"
        )
        soft = kind == "FRACTIONAL"
        yield segmentation(name, kind, SLICE_SETS[slices], omit, between, labels=None if soft else "one")
    for kind, syntax in [
        *product_of(["BINARY"], [IMPLICIT, BIG, DEFLATED, RLELossless]),
        *product_of(
            ["FRACTIONAL", "LABELMAP"], [IMPLICIT, BIG, DEFLATED, RLELossless, JPEG2000Lossless, JPEGLSLossless]
        ),
    ]:

        def edit(data, syntax=syntax, kind=kind):
            if syntax.is_encapsulated:
                return
            data.file_meta.TransferSyntaxUID = syntax

        made = syntax if syntax.is_encapsulated and kind != "BINARY" else EXPLICIT
        if kind == "BINARY" and syntax == RLELossless:
            made = None
        if made is None:
            continue
        yield segmentation(
            f"segmentation: {kind} as {syntax.name}",
            kind,
            [1, 2, 4],
            syntax=made,
            edit=edit,
            labels=None if kind == "FRACTIONAL" else "one",
            odd="(?i)JPEG|RLE|deflate|packed|big.?endian",
        )


def segments():
    """What segments are chosen, what they are called, and what the file says of its frame."""
    for kind in ["BINARY", "LABELMAP"]:
        some = lambda what, **how: segmentation(f"segments: {kind}, {what}", kind, [1, 2, 4], **how)
        yield some("both by name", labels="one,two", numbers=[1, 2])
        yield some("the second by number", labels="2", numbers=[2])
        yield some("another case of a name", labels="ONE")
        yield some("names that differ in case alone", labels="GTV", names=("gtv", "GTV"), numbers=[2], odd="(?i)GTV")
        yield some("one name twice", labels="lesion", names=("lesion", "lesion"), numbers=[1, 2], odd="(?i)lesion")
        yield some("names with commas", labels="2", names=("kidney, left", "kidney, right"), numbers=[2])
    for labels, numbers in {"one": [1], "two": [2], "one,two": [1, 2]}.items():
        yield segmentation(
            f"segments: BINARY, overlapping, {labels}",
            "BINARY",
            [1, 2, 4],
            overlap=True,
            labels=labels,
            numbers=numbers,
        )

    def another_frame(data):
        data.FrameOfReferenceUID = "1.2.3.9"

    def another_series(data):
        delete(data, "ReferencedSeriesSequence")

    def reversed_frames(data):
        groups = list(data.PerFrameFunctionalGroupsSequence)
        pixels = np.asarray(data.pixel_array)
        data.PerFrameFunctionalGroupsSequence = groups[::-1]
        data.PixelData = pydicom.pixels.utils.pack_bits(pixels[::-1])

    for edit in [another_series, reversed_frames]:
        yield segmentation(f"segments: {edit.__name__.replace('_', ' ')}", "BINARY", [1, 2, 4], edit=edit)
    frame = "(?i)frame of reference"
    yield segmentation(
        "segments: another frame of reference", "BINARY", [1, 2, 4], edit=another_frame, odd=frame, warns=frame
    )


# Contours by their corners in voxels (column, row), none of which lies on the centre of a voxel or leads through one.
SQUARE = [(1.3, 1.4), (7.6, 1.4), (7.6, 6.7), (1.3, 6.7)]
INNER = [(3.2, 2.6), (5.7, 2.6), (5.7, 4.6), (3.2, 4.6)]
INNERMOST = [(3.7, 2.8), (4.3, 2.8), (4.3, 3.3), (3.7, 3.3)]
SHIFTED = [(4.4, 3.3), (9.7, 3.3), (9.7, 7.6), (4.4, 7.6)]
ASIDE = [(8.4, 1.7), (9.6, 1.7), (9.6, 5.8), (8.4, 5.8)]
SLANTED = [(1.2, 3.7), (5.1, 0.6), (9.3, 4.1), (6.2, 7.7), (2.9, 6.9)]
KEYHOLE = [
    (1.3, 1.4),
    (7.6, 1.4),
    (7.6, 6.7),
    (4.45, 6.7),
    (4.45, 4.6),
    (5.7, 4.6),
    (5.7, 2.6),
    (3.2, 2.6),
    (3.2, 4.6),
    (4.45, 4.6),
    (4.45, 6.7),
    (1.3, 6.7),
]
SHAPES = {
    "one": [SQUARE],
    "slanted": [SLANTED],
    "hole": [SQUARE, INNER],
    "hole first": [INNER, SQUARE],
    "keyhole": [KEYHOLE],
    "island in a hole": [SQUARE, INNER, INNERMOST],
    "apart": [SQUARE, ASIDE],
    "overlap": [SQUARE, SHIFTED],
    "twice": [SQUARE, SQUARE],
    "twice, turned round": [SQUARE, SQUARE[::-1]],
    "one of two twice": [SQUARE, SQUARE, ASIDE],
    "hole twice": [SQUARE, INNER, INNER],
    "turned round": [SQUARE[::-1]],
    "closed by its first point": [[*SQUARE, SQUARE[0]]],
    "overlap with a hole": [SQUARE, INNER, SHIFTED],
}


def inside(contours, kind):
    """Returns the voxels [row, column] inside contours: the union of those that overlap, less what lies wholly within
    another one; for XOR, what lies within an odd number of them."""
    polygons = [shapely.make_valid(shapely.Polygon(corners)) for corners in contours]
    area = shapely.Polygon()
    if kind == "CLOSEDPLANAR_XOR":
        for polygon in polygons:
            area = area.symmetric_difference(polygon)
    else:
        once = []
        for polygon in polygons:
            if not any(polygon.equals(other) for other in once):
                once.append(polygon)
        within = {i: [k for k, other in enumerate(once) if k != i and other.contains(p)] for i, p in enumerate(once)}
        for i, polygon in enumerate(once):
            if len(within[i]) % 2 == 0:
                for k, hole in enumerate(once):
                    if i in within[k] and len(within[k]) == len(within[i]) + 1:
                        polygon = polygon.difference(hole)
                area = area.union(polygon)
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    return shapely.contains_xy(area, columns, rows)


def structure_sets():
    """Shape of the contours x their type x transfer syntax; names; what the file says of its frame."""
    for shape, kind, syntax in product_of(SHAPES, ["CLOSED_PLANAR", "CLOSEDPLANAR_XOR"], ["explicit", "implicit"]):
        if kind == "CLOSEDPLANAR_XOR" and ("twice" in shape or "overlap" in shape):
            continue  # Nothing, or what the standard leaves open.
        yield structure_set(
            f"structure set: {shape}, {kind}, {syntax}",
            {"one": SHAPES[shape]},
            kind,
            {"explicit": EXPLICIT, "implicit": IMPLICIT}[syntax],
        )
    fine = [(float(c), float(r)) for c, r in ring(4500)]
    for syntax in [EXPLICIT, IMPLICIT]:
        yield structure_set(f"structure set: over 64 KiB, {syntax.name}", {"one": [fine]}, syntax=syntax)
    yield structure_set("structure set: slice 3", {"one": [SQUARE]}, slices=[3])
    # Contours that leave slices out: the standard is silent. Those between may take the nearer ones, if that is told.
    for what, slices, filled in [("slices 1, 3, 5", [1, 3, 5], range(6)), ("slices 1 and 6", [1, 6], range(7))]:
        words = "(?i)apart|between|every"
        case = structure_set(f"structure set: {what}", {"one": [SQUARE]}, slices=slices, odd=words, warns=words)
        for place in filled:
            case.truth.values[..., place] = case.truth.values[..., 1]
        yield case
    two = {"gtv": [SQUARE], "GTV": [SHIFTED]}
    yield structure_set(
        "structure set: names that differ in case alone, first", two, labels="gtv", right=["gtv"], odd="GTV|gtv"
    )
    yield structure_set(
        "structure set: names that differ in case alone, second", two, labels="GTV", right=["GTV"], odd="GTV|gtv"
    )
    yield structure_set(
        "structure set: one name twice",
        {"lesion": [SQUARE], "lesion ": [ASIDE]},
        labels="lesion",
        right=["lesion", "lesion "],
        odd="lesion",
    )
    yield structure_set(
        "structure set: overlapping structures, both", {"a": [SQUARE], "b": [SHIFTED]}, labels="a,b", right=["a", "b"]
    )
    yield structure_set(
        "structure set: overlapping structures, one", {"a": [SQUARE], "b": [SHIFTED]}, labels="a", right=["a"]
    )

    def another_frame(data):
        data.ReferencedFrameOfReferenceSequence[0].FrameOfReferenceUID = "1.2.3.9"
        for roi in data.StructureSetROISequence:
            roi.ReferencedFrameOfReferenceUID = "1.2.3.9"

    def as_points(data):
        for contour in data.ROIContourSequence[0].ContourSequence:
            contour.ContourGeometricType = "POINT"

    def no_type(data):
        for contour in data.ROIContourSequence[0].ContourSequence:
            del contour.ContourGeometricType

    def comma(data):
        contour = data.ROIContourSequence[0].ContourSequence[0]
        contour["ContourData"]._value = "\\".join(map(str, contour.ContourData)).replace(".", ",")

    def one_number_less(data):
        contour = data.ROIContourSequence[0].ContourSequence[0]
        contour.ContourData = list(contour.ContourData)[:-1]

    def no_roi_number(data):
        del data.ROIContourSequence[0].ReferencedROINumber

    def empty_contour(data):
        data.ROIContourSequence[0].ContourSequence[0].ContourData = None

    frame, contour = "(?i)frame of reference", "(?i)contour|points"
    yield structure_set(
        "structure set: another frame of reference", {"one": [SQUARE]}, edit=another_frame, odd=frame, warns=frame
    )
    for edit, odd in [
        (as_points, contour),
        (no_type, contour),
        (comma, contour),
        (one_number_less, contour),
        (no_roi_number, "(?i)contour|number|structure"),
        (empty_contour, contour),
    ]:
        case = structure_set(
            f"structure set: {edit.__name__.replace('_', ' ')}", {"one": [SQUARE]}, edit=edit, odd=odd, warns=contour
        )
        if edit is not empty_contour:
            case.truth = None
        else:
            case.truth.values[:, :, 2] = 0
        yield case


def ring(count):
    """Returns an ellipse of many points, which leads through no centre."""
    angle = np.arange(count) * 2 * np.pi / count
    return np.column_stack([5.03 + 3.52 * np.cos(angle), 4.07 + 2.84 * np.sin(angle)])


def structure_set(
    name,
    structures,
    kind="CLOSED_PLANAR",
    syntax=EXPLICIT,
    slices=(2, 3, 4),
    labels=None,
    right=None,
    edit=lambda data: None,
    odd=None,
    warns=None,
):
    def write(folder):
        _, sources = scan(folder)
        data = plain(Pixels(), syntax, name + " 0", UID("1.2.840.10008.5.1.4.1.1.481.3"))
        delete(
            data,
            "SliceThickness",
            "PixelSpacing",
            "SamplesPerPixel",
            "PhotometricInterpretation",
            "BitsAllocated",
            "BitsStored",
            "HighBit",
            "PixelRepresentation",
            "RescaleSlope",
            "RescaleIntercept",
            "ImageType",
        )
        data.Modality, data.StructureSetLabel = "RTSTRUCT", "test"
        reference = Dataset()
        reference.FrameOfReferenceUID = sources[0].FrameOfReferenceUID
        data.FrameOfReferenceUID = sources[0].FrameOfReferenceUID
        data.ReferencedFrameOfReferenceSequence = [reference]
        data.StructureSetROISequence, data.ROIContourSequence, data.RTROIObservationsSequence = [], [], []
        for number, (label, contours) in enumerate(structures.items(), 1):
            roi = Dataset()
            roi.ROINumber, roi.ROIName = number, label
            roi.ReferencedFrameOfReferenceUID, roi.ROIGenerationAlgorithm = reference.FrameOfReferenceUID, ""
            data.StructureSetROISequence.append(roi)
            drawn = Dataset()
            drawn.ReferencedROINumber, drawn.ContourSequence = number, []
            for place, corners in itertools.product(slices, contours):
                contour = Dataset()
                points = ORIGIN + place * STEP * NORMAL + np.array(corners) @ (ALONG * np.array(SPACING[::-1])[:, None])
                contour.ContourGeometricType, contour.NumberOfContourPoints = kind, len(corners)
                contour.ContourData = [decimal(v) for v in points.ravel()]
                drawn.ContourSequence.append(contour)
            data.ROIContourSequence.append(drawn)
        edit(data)
        data.save_as(folder / "rt.dcm", enforce_file_format=True)
        return folder / "rt.dcm"

    values = np.zeros([SLICES, ROWS, COLUMNS])
    for label in right or list(structures)[:1]:
        # A middle slice takes the contours of its nearer neighbour; with gaps of one slice, those of the next one.
        for place in slices:
            values[place] = np.maximum(values[place], inside(structures[label], kind))
    options = {"volume": "ct"} | ({"labels": labels} if labels else {})
    # shapely has told what is inside.
    return Case(name, write, region(values), {"shapely": None}, odd, warns, options)
