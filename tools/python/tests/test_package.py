"""The package as a whole: types, documentation, examples, the device that is missing."""

from __future__ import annotations

import inspect
import os
import pathlib
import shutil
import subprocess
import sys

import nibabel
import numpy as np
import pydicom
import pytest
from conftest import through_runner

import vgs

EXAMPLES = sorted((pathlib.Path(__file__).parent.parent / "examples").glob("*.py"))


def test_everything_public_is_documented():
    for name in vgs.__all__:
        thing = getattr(vgs, name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert thing.__doc__, name
            for member, what in vars(thing).items() if inspect.isclass(thing) else []:
                if not member.startswith("_") and (callable(what) or isinstance(what, property)):
                    assert inspect.getdoc(what), f"{name}.{member}"


def test_every_argument_is_documented():
    for function in (vgs.fit, vgs.read, vgs.render, vgs.Roi.from_mask, vgs.Roi.from_threshold, vgs.SplatSet.rasterize):
        for argument in inspect.signature(function).parameters:
            if argument != "self":
                assert f"{argument}:" in function.__doc__, f"{function.__name__}: {argument}"


def test_types_pass_mypy():
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, "-p", "vgs"]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


def test_without_a_driver_it_says_what_to_install():
    environment = {**os.environ, "VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}
    code = (
        "import vgs\ntry: vgs.render([[[1.0]]], size=(8, 8))\nexcept vgs.DeviceUnavailableError as e: print(e, e.help)"
    )
    told = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert "mesa-vulkan-drivers" in told.stdout, told


@pytest.fixture(scope="module")
def folder(tmp_path_factory, phantom, ct, splats):
    """The files that the examples name."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copy(phantom, folder / "ct.nii.gz")
    splats.save(folder / "bones.ply")
    bone = ct.array >= 226
    vgs.Volume(bone, ct.affine).save(folder / "bones.nii.gz")
    marks = np.where(bone, 5, 0)
    marks[:, :, : ct.shape[2] // 2] *= 10
    header = "".join(
        f'<Label Key="{number}"><![CDATA[{name}]]></Label>' for number, name in ((5, "liver"), (50, "aorta"))
    )
    image = nibabel.Nifti1Image(marks.astype(np.uint8), ct.affine)
    text = f"<?xml version='1.0'?><CaretExtension><VolumeInformation Index='0'><LabelTable>{header}</LabelTable></VolumeInformation></CaretExtension>"
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, text.encode()))
    nibabel.save(image, folder / "segmentation.nii.gz")
    (folder / "cases").mkdir()
    for case in range(10):
        shutil.copy(phantom, folder / "cases" / f"case-{case}.nii.gz")
    (folder / "cases" / "case-4.nii.gz").write_bytes(phantom.read_bytes()[:2000])
    write_dicom(ct, folder / "dicom")
    return folder


def write_dicom(ct, folder):
    """Writes a volume as slices, as a scanner does."""
    folder.mkdir()
    lps = np.diag([-1.0, -1.0, 1.0]) @ ct.affine[:3]
    spacing = np.linalg.norm(lps[:, :3], axis=0)
    series, frame = pydicom.uid.generate_uid(), pydicom.uid.generate_uid()
    for k in range(ct.shape[2]):
        slice_ = pydicom.Dataset()
        slice_.file_meta = pydicom.dataset.FileMetaDataset()
        slice_.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        slice_.file_meta.MediaStorageSOPClassUID = slice_.SOPClassUID = pydicom.uid.CTImageStorage
        slice_.file_meta.MediaStorageSOPInstanceUID = slice_.SOPInstanceUID = pydicom.uid.generate_uid()
        slice_.Modality, slice_.SeriesInstanceUID, slice_.FrameOfReferenceUID = "CT", series, frame
        slice_.StudyInstanceUID, slice_.InstanceNumber = series, k + 1
        slice_.Rows, slice_.Columns = ct.shape[1], ct.shape[0]
        slice_.PixelSpacing = [f"{spacing[1]:.9g}", f"{spacing[0]:.9g}"]
        slice_.ImageOrientationPatient = [f"{n:.9g}" for n in (lps[:, :2] / spacing[:2]).T.ravel()]
        slice_.ImagePositionPatient = [f"{n:.9g}" for n in lps @ [0, 0, k, 1]]
        slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
        slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit, slice_.PixelRepresentation = 16, 16, 15, 1
        slice_.RescaleIntercept, slice_.RescaleSlope = 0, 1
        slice_.PixelData = np.rint(ct.array[:, :, k].T).astype("<i2").tobytes()
        slice_.save_as(folder / f"{k:03}.dcm", enforce_file_format=True)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_examples_run(example, folder):
    done = subprocess.run(
        through_runner(sys.executable, example), cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout
    if example.name == "cases.py":
        rows = (folder / "cases.csv").read_text().splitlines()
        assert len(rows) == 11 and [row.endswith(",") for row in rows].count(False) == 2, rows


def test_a_forked_process_says_that_it_cannot_go_on():
    code = (
        "import os, sys, vgs, numpy as np\n"
        "v = vgs.Volume(np.full((12, 12, 12), 500.0))\n"
        "how = dict(density=0.05, iterations=5, progress=False)\n"
        "vgs.fit(v, (226, 3071), **how)\n"
        "pid = os.fork()\n"
        "if pid == 0:\n"
        "    try: vgs.fit(v, (226, 3071), **how)\n"
        "    except vgs.DeviceUnavailableError as e: os._exit(7 if 'spawn' in e.help else 8)\n"
        "    os._exit(9)\n"
        "sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n"
    )
    command = through_runner(sys.executable, "-c", code)
    assert subprocess.run(command, check=False, timeout=60).returncode == 7
