"""Writes DICOM series, slice by slice, and knows what is right for them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pydicom
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import UID

from case import LPS, Case, Grid, affine, random
from readers import DICOM

IMPLICIT, EXPLICIT, BIG, DEFLATED = (UID("1.2.840.10008.1.2" + end) for end in ["", ".1", ".2", ".1.99"])
CT, ENHANCED_CT = UID("1.2.840.10008.5.1.4.1.1.2"), UID("1.2.840.10008.5.1.4.1.1.2.1")
ROOT = "1.2.826.0.1.3680043.8.498."
# An oblique frame with short decimals: rows grow along the second, columns along the first direction.
ALONG = np.array([[0.8, 0.6, 0], [-0.48, 0.64, 0.6]])
NORMAL = np.cross(*ALONG)
ORIGIN = np.array([-12.5, 30.25, -100])
SPACING = [0.75, 0.5]  # of rows, of columns
STEP = 2.5
SHAPE = [4, 4, 5]  # slices, rows, columns
SLOPE, INTERCEPT = 2, -1024


@dataclasses.dataclass
class Pixels:
    """How stored values lie in their words."""

    allocated: int = 16
    stored: int = 16
    high: int = 15
    signed: bool = False

    def __str__(self):
        return f"{'i' if self.signed else 'u'}{self.stored} in {self.allocated}, high bit {self.high}"

    @property
    def range(self):
        return (-(1 << self.stored - 1), (1 << self.stored - 1) - 1) if self.signed else (0, (1 << self.stored) - 1)

    def words(self, values, junk=0):
        """Returns the words of values; the bits that hold none are those of `junk`."""
        mask, shift = (1 << self.stored) - 1, self.high + 1 - self.stored
        around = ((1 << self.allocated) - 1) & ~(mask << shift)
        return (((np.asarray(values, "i8") & mask) << shift) | (junk & around)).astype(f"<u{self.allocated // 8}")


@dataclasses.dataclass
class Series:
    """A series in the making. `edit(dataset, i)` changes slice i before it is written, `bend(bytes, i)` the bytes of its
    file; `values` is what is right for the stored values [slice, row, column] and may be a function of them."""

    name: str
    pixels: Pixels = dataclasses.field(default_factory=Pixels)
    syntax: UID = EXPLICIT
    shape: list = dataclasses.field(default_factory=lambda: list(SHAPE))
    along: np.ndarray = dataclasses.field(default_factory=lambda: ALONG)
    places: list | None = None  # of the slices, mm LPS
    stored: np.ndarray | None = None
    values: Callable | np.ndarray | None = None
    edit: Callable = lambda data, i: None
    bend: Callable = lambda content, i: content
    junk: int = 0
    file: Callable = lambda i: f"slice{i}.dcm"

    def __post_init__(self):
        self.normal = np.cross(*self.along)
        if self.places is None:
            self.places = [ORIGIN + i * STEP * self.normal for i in range(self.shape[0])]
        if self.stored is None:
            low, high = self.pixels.range
            self.stored = random(self.name, [len(self.places), *self.shape[1:]], max(low, -2000), min(high, 4000))

    def write(self, folder):
        for i in range(len(self.places)):
            data = self.slice(i)
            self.edit(data, i)
            path = folder / self.file(i)
            path.parent.mkdir(parents=True, exist_ok=True)
            data.save_as(path, enforce_file_format=True)
            content = path.read_bytes()
            bent = self.bend(content, i)
            if bent is not content:
                path.write_bytes(bent)
        return folder

    def slice(self, i):
        data = plain(self.pixels, self.syntax, f"{self.name} {i}")
        data.InstanceNumber = i + 1
        data.Rows, data.Columns = self.shape[1:]
        data.ImagePositionPatient = [decimal(v) for v in self.places[i]]
        data.ImageOrientationPatient = [decimal(v) for v in self.along.ravel()]
        words = self.pixels.words(self.stored[i], self.junk)
        data.PixelData = (
            words.astype(words.dtype.newbyteorder(">")).tobytes() if self.syntax == BIG else words.tobytes()
        )
        if len(data.PixelData) % 2:
            data.PixelData += b"\0"
        data["PixelData"].VR = "OB" if self.pixels.allocated == 8 and self.syntax != IMPLICIT else "OW"
        return data

    def truth(self, planes=None):
        """Returns what is right: the slices in the order of their places, each in its plane."""
        values = self.values if self.values is not None else lambda stored: stored * SLOPE + INTERCEPT
        values = np.asarray(values(self.stored) if callable(values) else values, "f8")
        order = np.argsort([place @ self.normal for place in self.places], kind="stable")
        planes = planes or list(range(len(order)))
        out = np.full([*self.stored.shape[:0:-1], planes[-1] + 1], np.nan)
        out[..., planes] = values[order].T
        first, last = self.places[order[0]], self.places[order[-1]]
        step = (last - first) / planes[-1] if planes[-1] else self.normal * STEP
        return Grid(out, affine([self.along[0] * SPACING[1], self.along[1] * SPACING[0], step], first, LPS))

    def case(self, odd=None, warns=None, truth=True, planes=None, **options):
        """Returns the case of this series as a folder; it has no right reading where `truth` is false."""
        right = self.truth(planes) if truth is True else truth or None
        return Case(self.name, self.write, right, DICOM, odd, warns, options)


def decimal(value):
    """Returns a decimal string of at most 16 characters."""
    return f"{value:.10g}"[:16]


def plain(pixels, syntax, name, kind=CT):
    """Returns a dataset with the attributes of a CT, without place and pixels."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = kind
    meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid(prefix=ROOT, entropy_srcs=[name])
    meta.TransferSyntaxUID = syntax
    data = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128, is_little_endian=syntax != BIG)
    data.SOPClassUID = kind
    data.SOPInstanceUID = meta.MediaStorageSOPInstanceUID
    case = name.rsplit(" ", 1)[0]
    data.StudyInstanceUID = pydicom.uid.generate_uid(prefix=ROOT, entropy_srcs=[case, "study"])
    data.SeriesInstanceUID = pydicom.uid.generate_uid(prefix=ROOT, entropy_srcs=[case, "series"])
    data.FrameOfReferenceUID = pydicom.uid.generate_uid(prefix=ROOT, entropy_srcs=[case, "frame"])
    data.Modality, data.ImageType = "CT", ["ORIGINAL", "PRIMARY", "AXIAL"]
    data.PatientName, data.PatientID = "Test^Case", "1"
    data.PatientBirthDate = data.PatientSex = data.StudyID = data.AccessionNumber = ""
    data.StudyDate = data.SeriesDate = data.ContentDate = "20260101"
    data.StudyTime = data.SeriesTime = data.ContentTime = "120000"
    data.ReferringPhysicianName = data.Manufacturer = ""
    data.SeriesNumber, data.SeriesDescription = 1, "Series"
    data.SliceThickness, data.PixelSpacing = decimal(STEP), [decimal(v) for v in SPACING]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored = pixels.allocated, pixels.stored
    data.HighBit, data.PixelRepresentation = pixels.high, int(pixels.signed)
    data.RescaleSlope, data.RescaleIntercept = str(SLOPE), str(INTERCEPT)
    return data
