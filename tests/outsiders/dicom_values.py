"""DICOM series over the product of what concerns their values: how they are packed, typed, padded and scaled."""

import numpy as np
from pydicom.dataelem import DataElement
from pydicom.dataset import Dataset
from pydicom.datadict import dictionary_VR, tag_for_keyword
from pydicom.encaps import encapsulate, encapsulate_extended, generate_frames
from pydicom.uid import JPEG2000Lossless, JPEGLSLossless, RLELossless

from case import product
from series import BIG, DEFLATED, EXPLICIT, IMPLICIT, INTERCEPT, SLOPE, Pixels, Series

PIXELS = [
    Pixels(8, 8, 7),
    Pixels(8, 8, 7, True),
    Pixels(16, 12, 11),
    Pixels(16, 12, 11, True),
    Pixels(),
    Pixels(signed=True),
]
SYNTAXES = {"implicit": IMPLICIT, "explicit": EXPLICIT, "big endian": BIG, "deflated": DEFLATED}
# The packers refuse tiny pictures.
LARGER = [3, 40, 36]
PACKED = {"RLE": RLELossless, "JPEG-LS": JPEGLSLossless, "JPEG 2000": JPEG2000Lossless}


def cases():
    yield from syntaxes()
    yield from fragments()
    yield from bits()
    yield from padding()
    yield from types()
    yield from rescale()
    yield from tables()
    yield from photometric()


def syntaxes():
    """Transfer syntax x pixels."""
    for axes in product(syntax=SYNTAXES, pixels=PIXELS):
        name = f"transfer syntax: {axes['syntax']}, {axes['pixels']}"
        yield Series(name, axes["pixels"], SYNTAXES[axes["syntax"]]).case()
    for axes in product(syntax=PACKED, pixels=PIXELS):
        syntax = PACKED[axes["syntax"]]
        name = f"transfer syntax: {axes['syntax']}, {axes['pixels']}"
        yield Series(name, axes["pixels"], shape=LARGER, edit=lambda data, i, syntax=syntax: pack(data, syntax)).case(
            odd=axes["syntax"].replace("JPEG-LS", "JPEG.?LS")
        )


def pack(data, syntax):
    data.file_meta.TransferSyntaxUID = EXPLICIT
    data.compress(syntax, generate_instance_uid=False)


def fragments():
    """Packed pixels x offset table x fragments."""
    ways = {
        "offset table": lambda frames, n: (encapsulate(frames, n, True), None),
        "no offset table": lambda frames, n: (encapsulate(frames, n, False), None),
        "extended offset table": lambda frames, n: (encapsulate_extended(frames)[0], encapsulate_extended(frames)[1:]),
    }
    for axes in product(syntax=PACKED, way=ways, fragments=[1, 2]):
        if axes["way"].startswith("extended") and axes["fragments"] > 1:
            continue  # It counts frames of one fragment.
        if axes["syntax"] == "RLE" and axes["fragments"] > 1:
            continue  # PS3.5 A.4.2 forbids it.

        def edit(data, i, syntax=PACKED[axes["syntax"]], way=ways[axes["way"]], n=axes["fragments"]):
            pack(data, syntax)
            frames = list(generate_frames(data.PixelData, number_of_frames=1))
            data.PixelData, extended = way(frames, n)
            if extended:
                data.ExtendedOffsetTable, data.ExtendedOffsetTableLengths = extended

        name = f"encapsulation: {axes['syntax']}, {axes['way']}, {axes['fragments']} a frame"
        yield Series(name, shape=LARGER, edit=edit).case(odd=axes["syntax"].replace("JPEG-LS", "JPEG.?LS"))


def bits():
    """Bits allocated, stored, high x sign x what the other bits hold."""
    places = [
        (8, 8, 7),
        (8, 6, 5),
        (16, 8, 7),
        (16, 10, 9),
        (16, 12, 11),
        (16, 12, 15),
        (16, 15, 14),
        (16, 16, 15),
        (32, 32, 31),
        (32, 20, 19),
    ]
    for axes in product(place=places, signed=[False, True], junk=[0, 0xFFFFFFFF]):
        allocated, stored, high = axes["place"]
        if allocated == stored and axes["junk"]:
            continue  # No other bits.
        pixels = Pixels(allocated, stored, high, axes["signed"])
        name = f"bits: {pixels}{', other bits set' if axes['junk'] else ''}"
        yield Series(name, pixels, junk=axes["junk"]).case(odd="bits")


def padding():
    """Value of padding x limit of its range x its type x transfer syntax."""
    for axes in product(signed=[False, True], limit=[None, 10], vr=["US", "SS", "UN"], syntax=["implicit", "explicit"]):
        if axes["vr"] == "UN" and axes["syntax"] == "implicit":
            continue  # No types in implicit.
        signed, limit = axes["signed"], axes["limit"]
        value = -2000 if signed else 0
        if axes["vr"] == "SS" and not signed:
            value = 3
        top = value if limit is None else value + limit
        name = (
            f"padding: {'signed' if signed else 'unsigned'}, {'one value' if limit is None else 'a range'}, "
            f"{axes['vr']}, {axes['syntax']}"
        )
        series = Series(name, Pixels(signed=signed), SYNTAXES[axes["syntax"]])
        series.stored[:, 0, :3] = [value, top, top + 1]

        def edit(data, i, value=value, top=top, vr=axes["vr"], limit=limit):
            for keyword, number in [("PixelPaddingValue", value), ("PixelPaddingRangeLimit", top)]:
                if keyword == "PixelPaddingValue" or limit is not None:
                    put(data, keyword, "US" if vr == "US" else vr, short(number, vr))

        series.edit = edit
        series.values = lambda stored, value=value, top=top: np.where(
            (stored >= value) & (stored <= top), np.nan, stored * SLOPE + INTERCEPT
        )
        yield series.case()


def short(number, vr):
    if vr == "UN":
        return (number & 0xFFFF).to_bytes(2, "little")
    return number & 0xFFFF if vr == "US" else number


def put(data, keyword, vr, value):
    """Sets an element with a type that need not be the dictionary's."""
    # pydicom takes the dictionary's type in place of UN.
    data[keyword] = DataElement(tag_for_keyword(keyword), "OB" if vr == "UN" else vr, value, validation_mode=0)
    data[keyword].VR = vr


# What a message must name where an element cannot be read.
ELEMENTS = {
    "RescaleIntercept": "rescale ?intercept|0028,1052",
    "RescaleSlope": "rescale ?slope|0028,1053",
    "PixelSpacing": "pixel ?spacing|0028,0030",
    "ImagePositionPatient": "image ?position|0020,0032",
    "ImageOrientationPatient": "image ?orientation|0020,0037",
    "Rows": "rows|0028,0010",
    "Columns": "columns|0028,0011",
    "BitsAllocated": "bits ?allocated|0028,0100",
    "BitsStored": "bits ?stored|0028,0101",
    "HighBit": "high ?bit|0028,0102",
    "PixelRepresentation": "pixel ?representation|0028,0103",
    "SamplesPerPixel": "samples ?per ?pixel|0028,0002",
    "PhotometricInterpretation": "photometric|0028,0004",
    "SeriesInstanceUID": "series ?instance|0020,000e",
    "InstanceNumber": "instance ?number|0020,0013",
}


def types():
    """A known element x a type that is not the dictionary's."""
    others = {
        "DS": ["UN", "UT", "LO", "FD", "FL"],
        "US": ["UN", "UL", "SS", "IS", "LO"],
        "CS": ["UN", "LO", "UT"],
        "UI": ["UN", "LO"],
        "IS": ["UN", "LO", "US"],
    }
    for keyword, names in ELEMENTS.items():
        usual = dictionary_VR(tag_for_keyword(keyword))
        for vr in others[usual]:

            def edit(data, i, keyword=keyword, usual=usual, vr=vr):
                put(data, keyword, vr, as_type(data[keyword].value, usual, vr))

            name = f"type of an element: {keyword} as {vr}"
            # Signed 12 bits: each element counts.
            yield Series(name, Pixels(16, 12, 11, True), edit=edit).case(odd=f"(?i){names}")


def as_type(value, usual, vr):
    """Returns the value of an element in another type."""
    values = [value] if isinstance(value, (int, float, str)) else list(value)
    if vr == "UN":
        if usual == "US":
            return b"".join(v.to_bytes(2, "little") for v in values)
        text = "\\".join(map(str, values)).encode()
        return text + (b"\0" if usual == "UI" else b" ") * (len(text) % 2)
    if vr in ["FD", "FL"]:
        return [float(v) for v in values]
    if vr in ["US", "SS", "UL"]:
        return [int(v) for v in values]
    text = "\\".join(map(str, values))
    return text if vr in ["LO", "UT"] else int(text)


# Name, slope and intercept as they are written (None: absent), and as numbers (None: no number).
SCALES = [
    ("none", None, None, 1, 0),
    ("slope alone", "2", None, 2, 0),
    ("intercept alone", None, "-1024", 1, -1024),
    ("one and zero", "1", "0", 1, 0),
    ("fraction", "0.5", "-1024.25", 0.5, -1024.25),
    ("small", "1.52590e-4", "-0.5", 1.5259e-4, -0.5),
    ("exponent", "1.0E+01", "-1.024E+03", 10, -1024),
    ("small e", "1e0", "-1024e0", 1, -1024),
    ("plus signs", "+2", "+24", 2, 24),
    ("blanks", " 2 ", " -1024 ", 2, -1024),
    ("no digit before the point", ".5", "-.25", 0.5, -0.25),
    ("point at the end", "2.", "-1024.", 2, -1024),
    ("zeros before", "0002", "-01024", 2, -1024),
    ("negative slope", "-1", "100", -1, 100),
    ("NUL at the end", "2\0", "-1024\0", 2, -1024),
    ("more than 16 characters", "2.00000000000000000", "-1024", 2, -1024),
    ("empty slope", "", "-1024", 1, -1024),
    ("empty intercept", "2", "", 2, 0),
    ("decimal comma", "1", "-1024,0", 1, -1024),
    ("decimal comma in the slope", "0,5", "-1024", 0.5, -1024),
    ("blank within", "1", "- 1024", 1, None),
    ("word", "1", "none", 1, None),
    ("two values", "1", "-1024\\0", 1, None),
    ("unit", "1", "-1024 HU", 1, None),
    ("not a number", "1", "NaN", 1, None),
    ("infinite", "inf", "0", None, 0),
    ("slope of zero", "0", "-1024", None, -1024),
    ("overflow", "1e400", "0", None, 0),
    ("hexadecimal", "1", "0x10", 1, None),
]
# These may be refused, or read with a word.
DOUBTFUL = {"decimal comma", "decimal comma in the slope"}


def rescale():
    """Slope and intercept x where they stand: in all slices, or in one."""
    for (what, slope, intercept, m, b), where in [(scale, where) for scale in SCALES for where in ["all", "one"]]:

        def edit(data, i, slope=slope, intercept=intercept, where=where):
            if where == "one" and i != 1:
                return
            for keyword, text in [("RescaleSlope", slope), ("RescaleIntercept", intercept)]:
                if text is None:
                    del data[keyword]
                else:
                    raw(data, keyword, text)

        name = f"rescale: {what}, in {where} slice{'s' if where == 'all' else ''}"
        series = Series(name, Pixels(16, 12, 11), edit=edit)
        right = None not in [m, b]
        if right:
            own = series.stored * m + b
            series.values = (
                own
                if where == "all"
                else np.where(np.arange(4)[:, None, None] == 1, own, series.stored * SLOPE + INTERCEPT)
            )
        doubtful = what in DOUBTFUL or where == "one" and None in [slope, intercept]
        names = "(?i)rescale|slope|intercept|0028,105"
        plain = right and not doubtful and "empty" not in what
        yield series.case(truth=right, odd=None if plain else names, warns=names if doubtful else None)
    # Each slice its own.
    series = Series("rescale: another slope and intercept for each slice", Pixels(16, 12, 11))

    def edit(data, i):
        data.RescaleSlope, data.RescaleIntercept = f"{1 + i / 4}", f"{-1000 - i}"

    series.edit = edit
    planes = np.arange(4)[:, None, None]
    series.values = series.stored * (1 + planes / 4) - 1000 - planes
    yield series.case()


def raw(data, keyword, text):
    """Sets a decimal string as it stands: as bytes of another text type, whose type the file then says wrongly."""
    data[keyword] = DataElement(tag_for_keyword(keyword), "LO", text, validation_mode=0)
    data[keyword].VR = "DS"
    data[keyword]._value = Text(text)


class Text(str):
    """A decimal string that is written as it stands."""

    original_string = None

    def __new__(cls, text):
        out = super().__new__(cls, text)
        out.original_string = text
        return out


def tables():
    """Modality LUT: its bits x first value x beside slope and intercept."""
    for axes in product(
        bits=[16, 12, 8], first=[0, -100, 50], rescale=[False, True], pixels=[Pixels(16, 12, 11, True)]
    ):
        length, first = 256, axes["first"]
        table = np.arange(length) * 31 % (1 << axes["bits"])
        name = (
            f"modality LUT: {axes['bits']} bits from {first}, "
            f"{'beside' if axes['rescale'] else 'in place of'} slope and intercept"
        )
        series = Series(
            name,
            axes["pixels"],
            values=lambda stored, table=table, first=first: table[np.clip(stored - first, 0, len(table) - 1)],
        )
        series.stored = series.stored % 300 - 150

        def edit(data, i, table=table, first=first, axes=axes):
            item = Dataset()
            put(item, "LUTDescriptor", "SS" if first < 0 else "US", [len(table), first, axes["bits"]])
            item.ModalityLUTType = "US"
            item.LUTData = table.astype("<u2").tobytes()
            item["LUTData"].VR = "OW"
            data.ModalityLUTSequence = [item]
            if not axes["rescale"]:
                del data.RescaleSlope, data.RescaleIntercept

        series.edit = edit
        # Both exclude each other; pydicom takes the table.
        yield series.case(odd="(?i)modality ?LUT|0028,3000")


def photometric():
    """Photometric interpretation x samples, and pixels that are real numbers."""
    for kind, samples in [
        ("MONOCHROME1", 1),
        ("RGB", 3),
        ("YBR_FULL", 3),
        ("PALETTE COLOR", 1),
        ("HSV", 3),
        ("", 1),
        (None, 1),
        ("MONOCHROME3", 1),
    ]:

        def edit(data, i, kind=kind, samples=samples):
            if kind is None:
                del data.PhotometricInterpretation
            else:
                data.PhotometricInterpretation = kind
            data.SamplesPerPixel = samples
            if samples > 1:
                data.PlanarConfiguration, data.PixelData = 0, data.PixelData * samples

        series = Series(f"photometric: {'absent' if kind is None else kind or 'empty'}", Pixels(8, 8, 7), edit=edit)
        mono = kind in ["MONOCHROME1", "", None]
        yield series.case(truth=mono, odd=None if kind == "MONOCHROME1" else "(?i)colour|photometric")
    for keyword, kind in [("FloatPixelData", "f4"), ("DoubleFloatPixelData", "f8")]:
        series = Series(f"photometric: {keyword}")

        def edit(data, i, keyword=keyword, kind=kind, series=series):
            del data.PixelData, data.BitsStored, data.HighBit, data.PixelRepresentation
            data.BitsAllocated = int(kind[1]) * 8
            data[keyword] = DataElement(
                tag_for_keyword(keyword),
                "OF" if kind == "f4" else "OD",
                (series.stored[i] / 4).astype("<" + kind).tobytes(),
            )

        series.edit = edit
        series.values = series.stored / 4 * SLOPE + INTERCEPT
        yield series.case(odd="(?i)float|real|pixel ?(data|representation)")
