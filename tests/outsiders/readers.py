"""The outsiders: programs that are not ours, each as a function from a path to a grid."""

import functools
import warnings

import nibabel
import nrrd
import numpy as np
import pydicom
import SimpleITK
import zarr
from pydicom.datadict import dictionary_has_tag, dictionary_VR
from pydicom.pixels import apply_modality_lut

from case import LPS, Grid, affine

warnings.simplefilter("ignore")
pydicom.config.settings.reading_validation_mode = pydicom.config.IGNORE
SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)


def itk(path, index=0):
    """Reads a file, or the largest series of a folder, with SimpleITK; of several volumes that of a number."""
    if path.is_dir():
        reader = SimpleITK.ImageSeriesReader
        series = [reader.GetGDCMSeriesFileNames(str(path), uid) for uid in reader.GetGDCMSeriesIDs(str(path))]
        return of_itk(SimpleITK.ReadImage(max(series, key=len)))
    return of_itk(SimpleITK.ReadImage(str(path)), index)


def of_itk(image, index=0):
    if image.GetNumberOfComponentsPerPixel() > 1:
        # NRRD's lists; colours are never asked for.
        image = SimpleITK.VectorIndexSelectionCast(image, index)
    rank = image.GetDimension()
    if rank == 4:
        image = SimpleITK.Extract(image, [*image.GetSize()[:3], 0], [0, 0, 0, index])
        rank = 3
    directions = np.eye(3)
    n = rank
    directions[:n, :n] = np.array(image.GetDirection()).reshape(image.GetDimension(), -1)[:n, :n]
    spacing, origin = np.ones(3), np.zeros(3)
    spacing[:n], origin[:n] = image.GetSpacing()[:n], image.GetOrigin()[:n]
    values = SimpleITK.GetArrayFromImage(image).T
    return Grid(values.reshape(*values.shape, *[1] * (3 - values.ndim)), affine((directions * spacing).T, origin, LPS))


def nibabel_(path, index=0):
    """Reads NIfTI with nibabel; of several volumes that of a number."""
    image = nibabel.load(path)
    values = np.asarray(image.dataobj)
    if values.dtype.names or np.iscomplexobj(values):
        raise ValueError("no scalar volume")
    values = values.reshape(*values.shape, *[1] * (3 - values.ndim))
    while values.ndim > 3:
        values = values[..., index if values.shape[-1] > 1 else 0]
    header = image.header
    scale = {"meter": 1000, "micron": 0.001}.get(header.get_xyzt_units()[0], 1)
    matrix = image.affine.copy()
    matrix[:3] *= scale
    return Grid(values, matrix, bool(header["sform_code"] > 0 or header["qform_code"] > 0))


SPACES = {
    "left-posterior-superior": LPS,
    "lps": LPS,
    "right-anterior-superior": (1, 1, 1),
    "ras": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "las": (-1, 1, 1),
}


def pynrrd(path, index=0):
    """Reads NRRD with pynrrd; it keeps the header's own words, which are put together here. Of several volumes that of a
    number."""
    values, header = nrrd.read(str(path))
    directions = header.get("space directions")
    spacings = header.get("spacings", np.ones(3))
    space = SPACES.get(str(header.get("space", "")).lower().removesuffix("-time"))
    if directions is not None:
        directions = np.array(directions, "f8")
        inner = np.isnan(directions).any(1)
        if inner.sum() > 1:
            raise ValueError("no volume")
        if inner.any():
            values = np.take(values, index, int(np.argmax(inner)))
        directions = directions[~inner][:, :3]
    columns = np.diag(spacings) if directions is None else directions
    origin = header.get("space origin", np.zeros(3))
    oriented = space is not None and directions is not None
    return Grid(values, affine(columns, origin, space or (1, 1, 1)), oriented)


def numpy_(path):
    """Reads NPY with numpy; the last axis is x."""
    values = np.load(path)
    return Grid((values[0] if values.ndim == 4 else values).T, np.eye(4), False)


@functools.lru_cache(maxsize=None)
def dataset(path):
    """Reads a file; what stands as text or as integers is read as the dictionary has it."""
    data = pydicom.dcmread(path, force=True)
    for element in data:
        usual = dictionary_VR(element.tag) if dictionary_has_tag(element.tag) else element.VR
        if element.VR != usual and usual in ["DS", "IS", "US"] and isinstance(element.value, (str, int)):
            texts = str(element.value).split("\\")
            values = [int(text) if usual == "US" else float(text) for text in texts]
            data[element.tag] = pydicom.DataElement(element.tag, usual, values if len(values) > 1 else values[0])
    return data


def pydicom_(path):
    """Reads a series with pydicom: slices in the order of their positions, pixels through apply_modality_lut, padding
    as NaN, as PS3.3 C.7.5.1.1.2 has it. Values of an element with another type than the dictionary's are numbers
    where they can be."""
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    return stack([frame for file in files for frame in frames_of(dataset(file))])


def stack(frames):
    """Puts the frames of one stack together in the order of their positions."""
    along = np.cross(*frames[0]["along"])
    frames.sort(key=lambda frame: frame["position"] @ along)
    if any(abs(frame["along"] - frames[0]["along"]).max() > 1e-3 for frame in frames):
        raise ValueError("slices are not parallel")
    places = [frame["position"] @ along for frame in frames]
    # What is there twice, pixel by pixel, counts once.
    twice = [
        i > 0 and places[i] - places[i - 1] < 1e-3 and np.array_equal(frames[i]["values"], frames[i - 1]["values"])
        for i in range(len(frames))
    ]
    frames, places = ([x for x, drop in zip(row, twice) if not drop] for row in (frames, places))
    planes = planes_of(np.array(places) - places[0])
    first, last = frames[0], frames[-1]
    step = (last["position"] - first["position"]) / planes[-1] if planes[-1] else along * first["thickness"]
    values = np.full([*first["values"].T.shape, planes[-1] + 1], np.nan)
    values[..., planes] = np.stack([frame["values"].T for frame in frames], -1)
    columns = [first["along"][0] * first["spacing"][1], first["along"][1] * first["spacing"][0], step]
    return Grid(values, affine(columns, first["position"], LPS))


def planes_of(places):
    """Returns the plane of each place, which lie at multiples of the least distance, or of one near to it."""
    if len(places) == 1:
        return [0]
    least = np.diff(places).min()
    if least < 1e-3:
        raise ValueError("two slices at one place")
    last = round(places[-1] / least)
    planes = np.round(places / places[-1] * last).astype(int)
    if abs(places / places[-1] * last - planes).max() > 0.1 or len(set(planes)) < len(planes):
        raise ValueError("slices on no planes")
    return list(planes)


def numbers(data, keyword):
    value = data.get(keyword)
    if isinstance(value, bytes):
        value = value.decode("latin-1")
    if isinstance(value, str):
        value = value.strip(" \0").split("\\")
    return np.atleast_1d(np.array(value, "f8"))


def frames_of(data):
    if "PixelData" not in data and "FloatPixelData" not in data and "DoubleFloatPixelData" not in data:
        return []
    stored = data.pixel_array
    if data.get("SamplesPerPixel", 1) != 1:
        raise ValueError("colours")
    stored = stored.reshape(-1, *stored.shape[-2:])
    shared = data.get("SharedFunctionalGroupsSequence", [pydicom.Dataset()])[0]
    own = data.get("PerFrameFunctionalGroupsSequence", [pydicom.Dataset()] * len(stored))
    return [frame_of(data, [own[i], shared], stored[i], len(stored) == 1) for i in range(len(stored))]


def frame_of(data, groups, stored, alone):
    def part(sequence, keyword):
        found = [group[sequence][0] for group in groups if sequence in group and keyword in group[sequence][0]]
        if not found and not alone and keyword == "ImagePositionPatient":
            raise ValueError("no position")
        return found[0] if found else data

    orientation = numbers(part("PlaneOrientationSequence", "ImageOrientationPatient"), "ImageOrientationPatient")
    measures = part("PixelMeasuresSequence", "PixelSpacing")
    return {
        "values": values_of(data, part("PixelValueTransformationSequence", "RescaleSlope"), stored),
        "position": numbers(part("PlanePositionSequence", "ImagePositionPatient"), "ImagePositionPatient"),
        "along": orientation.reshape(2, 3) / np.linalg.norm(orientation.reshape(2, 3), axis=1)[:, None],
        "spacing": numbers(measures, "PixelSpacing"),
        "thickness": numbers(measures, "SliceThickness")[0] if measures.get("SliceThickness") else 1,
    }


def values_of(data, transformation, stored):
    values = np.array(apply_modality_lut(stored, transformation), "f8")
    if data.get("PixelPaddingValue") is not None:
        ends = [data.PixelPaddingValue, data.get("PixelPaddingRangeLimit", data.PixelPaddingValue)]
        signed = data.PixelRepresentation == 1
        ends = [v - 65536 if signed and v > 32767 else v for v in ends]
        values[(stored >= min(ends)) & (stored <= max(ends))] = np.nan
    return values


DICOM = {"pydicom": pydicom_, "SimpleITK": itk}


def zarr_(path, index=0):
    """Reads the finest resolution of an OME-Zarr image with zarr-python, which knows arrays; here also distances."""
    group = zarr.open_group(path, mode="r")
    attributes = dict(group.attrs)
    image = attributes.get("ome", attributes)["multiscales"][0]
    axes = [axis["name"] for axis in image["axes"]]
    space = [axis for axis in axes if axis in "xyz"]
    if len(space) != 3:
        raise ValueError("no volume")
    array = group[image["datasets"][0]["path"]][...]
    values = array.reshape(-1, *array.shape[len(axes) - 3 :])[index]
    values = np.moveaxis(values, [space.index(axis) for axis in "xyz"], range(3))
    mm = {"nanometer": 1e-6, "micrometer": 1e-3, "centimeter": 10, "meter": 1e3}
    apart = np.array([mm.get(axis.get("unit"), 1.0) for axis in image["axes"]])
    for step in image["datasets"][0]["coordinateTransformations"] + image.get("coordinateTransformations", []):
        apart = apart * step.get("scale", 1)
    return Grid(values, np.diag([*(apart[axes.index(axis)] for axis in "xyz"), 1.0]), False)
