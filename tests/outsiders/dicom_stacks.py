"""DICOM series over what concerns their slices: order, places, copies, phases, frames; and their files."""

import dataclasses
import struct
import zipfile

import numpy as np
from pydicom.dataset import Dataset
from pydicom.uid import JPEG2000Lossless, RLELossless

from case import Case, product, product_of
from dicom_values import LARGER, SYNTAXES, pack
from readers import DICOM
from series import (
    ALONG,
    BIG,
    ENHANCED_CT,
    EXPLICIT,
    INTERCEPT,
    NORMAL,
    ORIGIN,
    SHAPE,
    SLOPE,
    SPACING,
    STEP,
    Pixels,
    Series,
    decimal,
    plain,
)


def cases():
    yield from order()
    yield from orientation()
    yield from spacing()
    yield from copies()
    yield from phases()
    yield from frames()
    yield from files()


def order():
    """Order of the slices in space x their numbers x the names of their files x folders."""
    orders = {"rising": [0, 1, 2, 3], "falling": [3, 2, 1, 0], "mixed": [2, 0, 3, 1]}
    numbers = {
        "numbered": lambda data, i: None,
        "all number 1": lambda data, i: setattr(data, "InstanceNumber", 1),
        "without numbers": lambda data, i: delete(data, "InstanceNumber"),
        "numbered backwards": lambda data, i: setattr(data, "InstanceNumber", 9 - i),
    }
    files = {
        "dcm": lambda i: f"slice{i}.dcm",
        "no ending": lambda i: f"IM{i:04}",
        "folders": lambda i: f"{i}/image.dcm",
        "UIDs": lambda i: f"1.2.840.{10**i}",
        "wrong ending": lambda i: f"slice{i}.txt",
    }
    for axes in product(order=orders, number=numbers, file=files):
        if axes["order"] != "mixed" and axes["number"] != "numbered" and axes["file"] != "dcm":
            continue
        name = f"order: {axes['order']}, {axes['number']}, {axes['file']}"
        places = [ORIGIN + i * STEP * NORMAL for i in orders[axes["order"]]]
        yield Series(name, places=places, edit=numbers[axes["number"]], file=files[axes["file"]]).case()


def delete(data, *keywords):
    for keyword in keywords:
        if keyword in data:
            del data[keyword]


def orientation():
    """Axes of the slices x handedness."""
    bases = {"axial": np.eye(3)[:2], "coronal": np.eye(3)[[0, 2]], "sagittal": np.eye(3)[[1, 2]], "oblique": ALONG}
    for axes in product(base=bases, flip=[(1, 1), (-1, 1), (1, -1), (-1, -1)], swap=[False, True]):
        along = bases[axes["base"]] * np.array(axes["flip"])[:, None]
        along = along[::-1] if axes["swap"] else along
        signs = "".join("+" if n > 0 else "-" for n in axes["flip"])
        name = f"orientation: {axes['base']} {signs}{', rows and columns swapped' if axes['swap'] else ''}"
        yield Series(name, along=along + 0.0).case()


def spacing():
    """Distances of slices x what Slice Thickness and Spacing Between Slices say."""
    told = {"true": (STEP, STEP), "thinner": (1, 1), "thicker": (5, 5), "absent": (None, None), "zero": (0, 0)}
    for axes in product(told=told, count=[4, 2]):
        thickness, between = told[axes["told"]]

        def edit(data, i, thickness=thickness, between=between):
            delete(data, "SliceThickness")
            if thickness is not None:
                data.SliceThickness, data.SpacingBetweenSlices = decimal(thickness), decimal(between)

        name = f"distances: {axes['count']} slices, thickness {axes['told']}"
        yield Series(name, shape=[axes["count"], *SHAPE[1:]], edit=edit).case()
    for thickness in [2.5, None]:

        def edit(data, i, thickness=thickness):
            delete(data, "SliceThickness")
            if thickness:
                data.SliceThickness = decimal(thickness)

        series = Series(f"distances: one slice, thickness {thickness or 'absent'}", shape=[1, *SHAPE[1:]], edit=edit)
        right = series.truth()
        if not thickness:
            right.affine[:3, 2] /= STEP
        yield series.case(truth=right, odd="(?i)thickness", warns=None if thickness else "(?i)thickness")
    # Where slices are missing, their planes have no values; uneven ones lie on finer planes, or are refused.
    gaps = {
        "one missing": [0, 1, 3, 4],
        "several missing": [0, 1, 5, 6, 9],
        "every second twice as far": [0, 1, 3, 4, 6],
        "uneven": [0, 1, 2.6, 4.9],
        "one 0.2 mm off": [0, 1, 2.08, 3, 4],
        "rounded to 0.1 mm": [0, 1.012, 1.988, 3, 4],
        "first far off": [0, 40, 41, 42],
    }
    planes = {
        "one missing": gaps["one missing"],
        "several missing": gaps["several missing"],
        "every second twice as far": gaps["every second twice as far"],
        "one 0.2 mm off": [0, 1, 2, 3, 4],
        "rounded to 0.1 mm": [0, 1, 2, 3, 4],
        "first far off": gaps["first far off"],
    }
    for what, at in gaps.items():
        series = Series(f"distances: {what}", places=[ORIGIN + n * STEP * NORMAL for n in at])
        words = "(?i)apart|missing|distance|beside"
        plain = what.startswith("rounded")
        yield series.case(
            truth=what in planes, planes=planes.get(what), odd=None if plain else words, warns=None if plain else words
        )
    # A tilted gantry shears the grid.
    for degrees, kind in product_of([5, 20, -15], ["rows", "columns"]):
        shift = np.tan(np.radians(degrees)) * (ALONG[1] if kind == "rows" else ALONG[0])
        places = [np.round(ORIGIN + i * STEP * (NORMAL + shift), 8) for i in range(4)]
        yield Series(f"distances: gantry tilted by {degrees} degrees along {kind}", places=places).case(
            warns="(?i)tilt"
        )
    places = [ORIGIN + i * STEP * NORMAL + ALONG[0] * (3 if i == 2 else 0) for i in range(4)]
    yield Series("distances: one slice shifted sideways", places=places).case(
        truth=False, odd="(?i)beside|sideways|line"
    )


def copies():
    """A slice that is there twice: equal or other pixels x equal, own or no SOP UID x equal or other times."""
    for axes in product(pixels=["equal", "other"], identity=["same UID", "own UID", "no UID"], time=["same", "own"]):
        name = f"copies: {axes['pixels']} pixels, {axes['identity']}, {axes['time']} time"
        places = [ORIGIN + i * STEP * NORMAL for i in [0, 1, 1, 2, 3]]

        def edit(data, i, axes=axes, name=name):
            if axes["identity"] == "no UID":
                delete(data, "SOPInstanceUID")
            if axes["identity"] == "same UID" and i == 2:
                data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = plain(
                    Pixels(), EXPLICIT, f"{name} 1"
                ).SOPInstanceUID
            if axes["time"] == "own":
                data.ContentTime = data.AcquisitionTime = f"12000{i}"

        series = Series(name, places=places, edit=edit)
        equal = axes["pixels"] == "equal"
        if equal:
            series.stored[2] = series.stored[1]
        once = dataclasses.replace(series, places=places[:2] + places[3:], stored=np.delete(series.stored, 1, 0))
        # Of two that differ the last one may be taken, if both are told.
        words = "(?i)copies|copy|twice|one place|same place|two slices|same SOP"
        yield series.case(odd=words, truth=once.truth(), warns=words)
    # UIDs that say nothing.
    for what in ["all SOP UIDs equal", "no SOP UIDs", "empty SOP UIDs", "all SOP UIDs equal in the file's head alone"]:

        def edit(data, i, what=what):
            if what.startswith("no"):
                delete(data, "SOPInstanceUID")
            elif what.startswith("empty"):
                data.SOPInstanceUID = ""
            else:
                data.file_meta.MediaStorageSOPInstanceUID = "1.2.3"
                if not what.endswith("alone"):
                    data.SOPInstanceUID = "1.2.3"

        yield Series(f"copies: {what}", edit=edit).case(odd="(?i)SOP")


def phases():
    """Two volumes at one place x what distinguishes them x which is asked for."""
    tells = {
        "echo": ("EchoNumbers", [1, 2]),
        "temporal position": ("TemporalPositionIdentifier", [1, 2]),
        "temporal index": ("TemporalPositionIndex", [1, 2]),
        "acquisition": ("AcquisitionNumber", [1, 2]),
        "trigger time": ("TriggerTime", ["100", "400"]),
        "b value": ("DiffusionBValue", [0.0, 1000.0]),
        "cardiac percentage": ("NominalPercentageOfCardiacPhase", [30.0, 70.0]),
        "image type": ("ImageType", [["ORIGINAL", "PRIMARY", "M"], ["ORIGINAL", "PRIMARY", "P"]]),
        "acquisition time": ("AcquisitionTime", ["120000", "120500"]),
        "nothing": ("PatientID", ["1", "1"]),
        "kernel": ("ConvolutionKernel", ["B30f", "B70f"]),
        "energy": ("KVP", ["80", "140"]),
        "stack": ("StackID", ["1", "2"]),
        "series": ("SeriesInstanceUID", ["1.2.3.1", "1.2.3.2"]),
    }
    for what, ask in product_of(tells, [None, "1", "2"]):
        keyword, values = tells[what]
        if what == "nothing" and ask:
            continue
        places = [ORIGIN + i * STEP * NORMAL for i in [0, 1, 2, 3, 0, 1, 2, 3]]

        def edit(data, i, keyword=keyword, values=values):
            setattr(data, keyword, values[i // 4])
            data.ContentTime = f"12{i:02}00"

        series = Series(f"phases: by {what}, {f'series {ask}' if ask else 'none asked for'}", places=places, edit=edit)
        options = {"series": ask} if ask else {}
        if ask:
            at = slice(0, 4) if ask == "1" else slice(4, 8)
            half = dataclasses.replace(series, places=places[at], stored=series.stored[at])
            case = series.case(truth=half.truth(), odd=None if ask else ".", **options)
            case.readers = {"pydicom": lambda path, at=at: half_of(path, at)}
        else:
            case = series.case(truth=False, odd="(?i)series|one place|two slices", **options)
        yield case


def half_of(path, at):
    """Reads some files of a folder with pydicom."""
    from readers import stack, frames_of, dataset

    return stack([frame for file in sorted(path.iterdir())[at] for frame in frames_of(dataset(file))])


def frames():
    """Enhanced files: where what is said of a frame stands x transfer syntax x order of the frames."""
    syntaxes = {**SYNTAXES, "RLE": RLELossless, "JPEG 2000": JPEG2000Lossless}
    for syntax, order in product_of(syntaxes, ["rising", "mixed"]):
        yield enhanced(f"frames: {syntax}, {order}", syntaxes[syntax], order=order)
    for where in product(
        orientation=["each", "shared"],
        measures=["each", "shared"],
        rescale=["each", "shared", "file", "each its own", "none"],
    ):
        yield enhanced("frames: " + ", ".join(f"{k} {v}" for k, v in where.items()), EXPLICIT, where)
    for odd in [
        "a frame without position",
        "fewer groups than frames",
        "concatenation",
        "whole concatenation",
        "two stacks",
        "gap",
    ]:
        yield enhanced(f"frames: {odd}", EXPLICIT, odd=odd)


def enhanced(name, syntax, where=None, order="rising", odd=None):
    where = where or {"orientation": "shared", "measures": "shared", "rescale": "shared"}
    at = [0, 1, 2, 3] if order == "rising" else [2, 0, 3, 1]
    if odd == "two stacks":
        at = [0, 1, 0, 1]
    if odd == "gap":
        at = [0, 1, 3, 4]
    series = Series(
        name,
        Pixels(16, 12, 11),
        syntax,
        [len(at), *(LARGER if syntax.is_encapsulated else SHAPE)[1:]],
        places=[ORIGIN + i * STEP * NORMAL for i in at],
    )
    scales = {"each its own": lambda i: (1 + i / 4, -1000 - i), "none": lambda i: None}
    scale_of = scales.get(where["rescale"], lambda i: (SLOPE, INTERCEPT))

    def write(folder):
        data = plain(series.pixels, syntax, name + " 0", ENHANCED_CT)
        delete(data, "SliceThickness", "PixelSpacing", "RescaleSlope", "RescaleIntercept")
        data.Rows, data.Columns = series.shape[1:]
        count = len(at)
        words = series.pixels.words(series.stored)
        data.NumberOfFrames = count
        shared, own = Dataset(), [Dataset() for _ in range(count)]
        for i, group in enumerate(own):
            item(group, "PlanePositionSequence", ImagePositionPatient=[decimal(v) for v in series.places[i]])
            item(
                group,
                "FrameContentSequence",
                StackID="1" if odd != "two stacks" else str(1 + i // 2),
                InStackPositionNumber=i + 1,
                DimensionIndexValues=[1, i + 1],
            )
            scale = scale_of(i)
            if where["rescale"].startswith("each"):
                item(
                    group,
                    "PixelValueTransformationSequence",
                    RescaleSlope=decimal(scale[0]),
                    RescaleIntercept=decimal(scale[1]),
                    RescaleType="HU",
                )
        for group in own if where["orientation"] == "each" else [shared]:
            item(group, "PlaneOrientationSequence", ImageOrientationPatient=[decimal(v) for v in ALONG.ravel()])
        for group in own if where["measures"] == "each" else [shared]:
            item(
                group,
                "PixelMeasuresSequence",
                PixelSpacing=[decimal(v) for v in SPACING],
                SliceThickness=decimal(STEP),
                SpacingBetweenSlices=decimal(STEP),
            )
        if where["rescale"] == "shared":
            item(
                shared,
                "PixelValueTransformationSequence",
                RescaleSlope=str(SLOPE),
                RescaleIntercept=str(INTERCEPT),
                RescaleType="HU",
            )
        if where["rescale"] == "file":
            data.RescaleSlope, data.RescaleIntercept = str(SLOPE), str(INTERCEPT)
        if odd == "a frame without position":
            del own[1].PlanePositionSequence
        if odd == "fewer groups than frames":
            own.pop()
        data.SharedFunctionalGroupsSequence = [shared]
        parts = [range(count)]
        if odd in ["concatenation", "whole concatenation"]:
            parts = [range(count // 2), range(count // 2, count)]
        for n, part in enumerate(parts):
            data.PerFrameFunctionalGroupsSequence = [own[i] for i in part if i < len(own)]
            data.NumberOfFrames = len(part)
            pixels = words[list(part)]
            data.PixelData = (pixels.astype(">u2") if syntax == BIG else pixels).tobytes()
            if len(parts) > 1:
                data.ConcatenationUID, data.InConcatenationNumber = "1.2.3.4.5", n + 1
                data.ConcatenationFrameOffsetNumber, data.InConcatenationTotalNumber = part[0], 2
                data.SOPInstanceUIDOfConcatenationSource = "1.2.3.4.6"
                data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.4.7.{n}"
                if odd == "concatenation" and n:
                    break
            if syntax.is_encapsulated:
                pack(data, syntax)
            data.save_as(folder / f"frames{n}.dcm", enforce_file_format=True)
        return folder if len(parts) > 1 else folder / "frames0.dcm"

    values = series.stored * 1.0
    for i in range(len(at)):
        slope, intercept = scale_of(i) or (1, 0)
        values[i] = values[i] * slope + intercept
    series.values = values
    names = {
        None: None,
        "gap": "(?i)missing",
        "two stacks": "(?i)two slices|one place|series",
        "concatenation": "(?i)concatenation|missing|part|frames",
        "whole concatenation": "(?i)concatenation",
    }
    refusal = names.get(odd, "(?i)frame|position|place|functional")
    right = (
        series.truth([0, 1, 3, 4] if odd == "gap" else None) if odd in [None, "gap", "whole concatenation"] else None
    )
    if syntax == JPEG2000Lossless:
        refusal = "JPEG 2000"
    return Case(name, write, right, DICOM, refusal, "(?i)missing" if odd == "gap" else None)


def item(group, sequence, **values):
    inner = Dataset()
    for keyword, value in values.items():
        setattr(inner, keyword, value)
    setattr(group, sequence, [inner])


def files():
    """How a file begins and ends, and what else is in it, x transfer syntax."""
    bends = {
        "no preamble": lambda content, i: content[128:],
        "no preamble nor magic": lambda content, i: content[132:],
        "no head": lambda content, i: content[132 + 12 + struct.unpack("<I", content[140:144])[0] :],
        "text in the preamble": lambda content, i: b"II*\0".ljust(128, b"x") + content[128:],
        "bytes after the end": lambda content, i: content + b"\0" * 40,
        "cut short in one file": lambda content, i: content[:-7] if i == 1 else content,
        "head cut off in one file": lambda content, i: content[:300] if i == 1 else content,
        "no length of the head": lambda content, i: content[:132] + content[144:],
        "wrong length of the head": lambda content, i: content[:140] + b"\x08\0\0\0" + content[144:],
    }
    for what, syntax in product_of(bends, ["explicit", "implicit"]):
        odd = None if what in ["text in the preamble", "bytes after the end"] else "(?i)DICOM|cut short|damaged|bytes"
        right = not what.endswith("in one file")
        yield Series(f"file: {what}, {syntax}", syntax=SYNTAXES[syntax], bend=bends[what]).case(odd=odd, truth=right)

    def sequence(data, i):
        inner = Dataset()
        inner.ReferencedSOPClassUID, inner.ReferencedSOPInstanceUID = "1.2", "1.2.3"
        inner.is_undefined_length_sequence_item = True
        data.ReferencedImageSequence = [inner]
        data["ReferencedImageSequence"].is_undefined_length = True

    def private(data, i):
        block = data.private_block(0x0029, "VENDOR HEADER", create=True)
        block.add_new(0x10, "OB", b"\1\2\3\4" * 9)
        block.add_new(0x11, "SQ", [Dataset()])
        block.add_new(0x12, "UN", b"\xfe\xff\x00\xe0" * 2)

    def icon(data, i):
        inner = Dataset()
        inner.Rows = inner.Columns = 2
        inner.SamplesPerPixel, inner.PhotometricInterpretation = 1, "MONOCHROME2"
        inner.BitsAllocated, inner.BitsStored, inner.HighBit, inner.PixelRepresentation = 8, 8, 7, 0
        inner.PixelData = b"\1\2\3\4"
        inner["PixelData"].VR = "OB"
        data.IconImageSequence = [inner]

    def overlay(data, i):
        data.add_new(0x60000010, "US", SHAPE[1])
        data.add_new(0x60000011, "US", SHAPE[2])
        data.add_new(0x60000040, "CS", "G")
        data.add_new(0x60000050, "SS", [1, 1])
        data.add_new(0x60000100, "US", 1)
        data.add_new(0x60000102, "US", 0)
        data.add_new(0x60003000, "OW", b"\x0f\0\0\0")

    def long_text(data, i):
        data.ImageComments = "x" * 1001

    def trailing(data, i):
        data.add_new(0xFFFCFFFC, "OB", b"\0" * 10)

    def charset(data, i):
        data.SpecificCharacterSet = "ISO_IR 192"
        data.SeriesDescription = "Schädel 頭"

    def frames_1(data, i):
        data.NumberOfFrames = "1"

    def lengths(data, i):
        data.add_new(0x00080000, "UL", 999)
        data.add_new(0x00280000, "UL", 999)

    for edit, syntax in product_of(
        [sequence, private, icon, overlay, long_text, trailing, charset, frames_1, lengths], SYNTAXES
    ):
        yield Series(
            f"file: with {edit.__name__.replace('_', ' ')}, {syntax}", syntax=SYNTAXES[syntax], edit=edit
        ).case()
    for odd, edit in {
        "no class": lambda data, i: delete(data, "SOPClassUID"),
        "no modality": lambda data, i: delete(data, "Modality"),
        "no series UID": lambda data, i: delete(data, "SeriesInstanceUID"),
        "no patient": lambda data, i: delete(data, "PatientID", "PatientName"),
        "no frame of reference": lambda data, i: delete(data, "FrameOfReferenceUID"),
    }.items():
        yield Series(f"file: {odd}", edit=edit).case()
    words = "(?i)position|orientation|place|distance|rows|bits|pixel|image|missing"
    for keyword in ["ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "Rows", "PixelData"]:
        yield Series(f"file: no {keyword}", edit=lambda data, i, k=keyword: delete(data, k)).case(
            truth=False, odd=words
        )
        series = Series(f"file: no {keyword} in one slice", edit=lambda data, i, k=keyword: i == 1 and delete(data, k))
        rest = dataclasses.replace(
            series, places=[series.places[i] for i in [0, 2, 3]], stored=series.stored[[0, 2, 3]]
        )
        yield series.case(truth=rest.truth([0, 2, 3]), odd=words, warns=words)
    for keyword in ["BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation", "SamplesPerPixel"]:
        # They are 16, 15, unsigned and 1 where a file does not say.
        yield Series(f"file: no {keyword}", edit=lambda data, i, k=keyword: delete(data, k)).case(odd=words + "|sample")
    yield mosaic()
    for syntax in SYNTAXES:
        series = Series(f"file: zip, {syntax}", syntax=SYNTAXES[syntax])
        case = series.case()
        case.write = lambda folder, series=series: zipped(series, folder)
        case.readers = {name: lambda path, read=read: read(path.parent / "series") for name, read in DICOM.items()}
        yield case
    series = Series("file: one slice in place of its series")
    case = series.case()
    case.write = lambda folder, series=series: series.write(folder) / series.file(1)
    case.readers = {name: lambda path, read=read: read(path.parent) for name, read in DICOM.items()}
    yield case


def zipped(series, folder):
    inner = folder / "series"
    inner.mkdir()
    with zipfile.ZipFile(folder / "series.zip", "w", zipfile.ZIP_DEFLATED) as out:
        for path in sorted(series.write(inner).iterdir()):
            out.write(path, path.name)
    return folder / "series.zip"


def mosaic():
    """A mosaic of Siemens: the slices of a volume as tiles of one picture."""
    series = Series("file: mosaic of Siemens", shape=[1, 8, 10])

    def edit(data, i):
        data.ImageType = ["ORIGINAL", "PRIMARY", "M", "ND", "MOSAIC"]
        data.Modality, data.Manufacturer = "MR", "SIEMENS"
        block = data.private_block(0x0019, "SIEMENS MR HEADER", create=True)
        block.add_new(0x0A, "US", 4)

    series.edit = edit
    return series.case(truth=False, odd="(?i)mosaic")
