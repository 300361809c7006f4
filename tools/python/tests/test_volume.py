"""Volumes and regions: layouts, spaces, other packages, bad input."""

from __future__ import annotations

import io
import pathlib

import nibabel
import numpy as np
import pytest
import SimpleITK

import vgs

AFFINE = np.array([[-0.8, 0.1, 0, 30], [0, 0.9, -0.2, -12], [0.1, 0, 2.5, 700], [0, 0, 0, 1]])


@pytest.mark.parametrize("order", ["F", "C"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16, np.uint8, np.bool_, ">i2"])
def test_an_array_keeps_its_values_and_places(ball, order, dtype):
    array = np.asarray(
        np.clip(ball, 0, 200) > 100 if np.dtype(dtype) == bool else np.clip(ball, 0, 200), dtype, order=order
    )
    volume = vgs.Volume(array, AFFINE)
    assert volume.shape == (24, 20, 16)
    np.testing.assert_array_equal(volume.array, array.astype(np.float32))
    assert np.shares_memory(volume.array, array) == (order == "F" and np.dtype(dtype) == np.float32)


@pytest.mark.parametrize("view", [np.s_[::-1], np.s_[:, ::2], np.s_[1:-1, 2:, ::-1]])
def test_views_of_arrays_are_read_as_they_look(ball, view, tmp_path):
    part = ball.astype(np.float32)[view]
    vgs.Volume(part, AFFINE).save(tmp_path / "part.nii")
    np.testing.assert_array_equal(nibabel.load(tmp_path / "part.nii").get_fdata(), part)


def test_a_part_and_a_resolution_are_read_of_zarr(ball, tmp_path):
    whole = vgs.Volume(ball.astype(np.float32), AFFINE)
    whole.save(tmp_path / "ball.zarr")
    np.testing.assert_array_equal(vgs.read(tmp_path / "ball.zarr").array, whole.array)
    part = vgs.read(tmp_path / "ball.zarr", voxels=[[2, 9], [0, 20], [5, 6]])
    np.testing.assert_array_equal(part.array, whole.array[2:9, :, 5:6])
    np.testing.assert_allclose(part.affine[:3, 3], (AFFINE @ [2, 0, 5, 1])[:3], atol=1e-9)
    for wrong in [{"level": 1}, {"voxels": [[2, 25], [0, 20], [5, 6]]}]:
        with pytest.raises(vgs.UsageError) as raised:
            vgs.read(tmp_path / "ball.zarr", **wrong)
        assert raised.value.code in ["VGS-ZAR-006", "VGS-VOL-026"]
    with pytest.raises(vgs.CannotCreateError):
        whole.save(tmp_path / "ball.zarr")
    whole.save(tmp_path / "ball.zarr", force=True)


def test_a_file_is_read_as_nibabel_and_simpleitk_read_it(phantom, ct):
    image = nibabel.load(phantom)
    np.testing.assert_allclose(ct.array, image.get_fdata(), atol=1e-3)
    np.testing.assert_allclose(ct.affine, image.affine, atol=1e-4)
    assert ct.unit == "hu"
    sitk = SimpleITK.ReadImage(str(phantom))
    back = ct.to_sitk()
    for a, b in [(sitk.GetSpacing(), back.GetSpacing()), (sitk.GetOrigin(), back.GetOrigin())]:
        np.testing.assert_allclose(a, b, atol=1e-3)
    np.testing.assert_allclose(sitk.GetDirection(), back.GetDirection(), atol=1e-4)
    np.testing.assert_allclose(SimpleITK.GetArrayFromImage(sitk), SimpleITK.GetArrayFromImage(back), atol=1e-3)


def test_images_of_other_packages_are_the_same_region(phantom, ct, bone):
    for image in (phantom, str(phantom), nibabel.load(phantom), SimpleITK.ReadImage(str(phantom)), ct):
        assert vgs.Roi.from_threshold(image, 226, 3071).voxels == bone.voxels, type(image)
    image = ct.to_nibabel()
    assert np.shares_memory(np.asanyarray(image.dataobj), ct.array)


def test_masks_of_all_kinds_are_the_same_region(ct, bone, tmp_path):
    mask = (bone.array > 0).astype(np.uint8)
    nibabel.save(nibabel.Nifti1Image(mask, ct.affine), tmp_path / "mask.nii.gz")
    image = nibabel.load(tmp_path / "mask.nii.gz")
    kinds = [mask, mask.astype(bool), np.ascontiguousarray(mask), tmp_path / "mask.nii.gz", image]
    kinds += [SimpleITK.ReadImage(str(tmp_path / "mask.nii.gz")), vgs.Volume(mask, ct.affine), bone]
    for kind in kinds:
        found = vgs.Roi.from_mask(kind, ct)
        np.testing.assert_array_equal(found.array, bone.array, err_msg=str(type(kind)))


def test_labels_are_chosen_by_number_and_name(ct, bone):
    marks = np.where(bone.array > 0, 2, 0)
    marks[:, :, : ct.shape[2] // 2] *= 3
    labels = vgs.Volume(marks, ct.affine, labels={2: "upper, bone", 6: "lower"})
    assert vgs.Roi.from_mask(labels, ct, 2).voxels + vgs.Roi.from_mask(labels, ct, "lower").voxels == bone.voxels
    for both in ([2, 6], ["upper, bone", 6], "all"):
        assert vgs.Roi.from_mask(labels, ct, both).voxels == bone.voxels
    assert vgs.Roi.from_mask(labels, ct, "all").label_names == {2: "upper, bone", 6: "lower"}
    with pytest.raises(vgs.UsageError, match="lowr"):
        vgs.Roi.from_mask(labels, ct, "lowr")


def test_an_array_is_a_mask_of_the_volume_s_shape(ct, bone):
    mask = bone.array > 0
    for wrong in (mask[::2, ::2], mask[:-1], np.ones((1, 1, 1)), np.moveaxis(mask, 0, 2)[:, :-2]):
        with pytest.raises(vgs.UsageError, match="shape|voxels"):
            vgs.Roi.from_mask(wrong, ct)


def test_a_volume_of_something_that_has_a_place_keeps_it(ct, bone):
    for thing in (ct, bone, ct.to_nibabel(), ct.to_sitk()):
        with pytest.raises(vgs.UsageError, match="Volume.of"):
            vgs.Volume(thing)
    for thing in (ct, ct.to_nibabel(), ct.to_sitk()):
        taken = vgs.Volume.of(thing, unit="arbitrary")
        np.testing.assert_allclose(taken.affine, ct.affine, atol=1e-4)
        assert taken.unit == "arbitrary"
    with pytest.raises(vgs.UsageError, match="HU"):
        vgs.Volume(ct.array, unit="HU")


def test_dlpack_is_taken(ball):
    class Tensor:
        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **keywords):
            return self.array.__dlpack__(**keywords)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    np.testing.assert_array_equal(vgs.Volume(Tensor(ball)).array, ball.astype(np.float32))


def test_volumes_are_compared(ct, bone, splats):
    assert ct.compare(ct).psnr_db == float("inf") and ct.compare(ct).voxels == ct.array.size
    found = ct.compare(ct.array + 10, bone, range=(-1000, 2000))
    assert (found.voxels, found.mean_hu, found.largest_hu) == (
        bone.voxels,
        pytest.approx(10),
        pytest.approx(10, rel=1e-4),
    )
    assert found.psnr_db == pytest.approx(20 * np.log10(300), abs=0.01)
    rasterised = ct.compare(splats.rasterize(quantity="field"), bone)
    assert rasterised.rmse_hu == pytest.approx(splats.evaluate(ct, bone).rmse_hu, rel=1e-2)
    with pytest.raises(vgs.BadDataError):
        ct.compare(vgs.Volume(ct.array[1:], ct.affine))


def test_a_volume_may_be_changed_in_place(ct):
    volume = vgs.Volume(ct.array.copy(order="F"), ct.affine)
    volume.array[:] = -1000
    volume.array[3:9, 3:9, 3:9] = 500
    assert vgs.Roi.from_threshold(volume, 226, 3071).voxels == 6**3


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ((np.zeros((4, 4)),), vgs.UsageError, "2 axes"),
        ((np.zeros((4, 4, 4, 2)),), vgs.UsageError, "4 axes"),
        ((np.zeros((4, 4, 4), complex),), vgs.UsageError, "complex"),
        ((np.array([[["a"]]]),), vgs.UsageError, "<U1"),
        ((np.zeros((4, 4, 4)), np.eye(3)), vgs.UsageError, "4 by 4"),
        ((np.zeros((4, 4, 4)), np.zeros((4, 4))), vgs.UsageError, "affine"),
        ((np.zeros((4, 4, 4)), np.diag([1, 0, 1, 1])), vgs.UsageError, "plane"),
        ((np.zeros((4, 4, 4)), np.diag([1, np.nan, 1, 1])), vgs.UsageError, "finite"),
    ],
)
def test_what_is_no_volume_is_refused(arguments, error, says):
    with pytest.raises(error, match=says) as raised:
        vgs.Volume(*arguments)
    assert raised.value.code.startswith("VGS-PY-") and raised.value.help and isinstance(raised.value, ValueError)


def test_bytes_and_open_files_are_read_like_their_file(phantom, ct):
    content = pathlib.Path(phantom).read_bytes()
    with open(phantom, "rb") as file:
        for given in (content, io.BytesIO(content), file):
            np.testing.assert_array_equal(vgs.Volume.of(given).array, ct.array)
    with pytest.raises(vgs.BadDataError, match="^bytes: "):
        vgs.read(content[:1000])
    with pytest.raises(vgs.UsageError, match="a path is needed"):
        vgs.read(bytes(128) + b"DICM")


def test_files_that_cannot_be_read_say_why(tmp_path):
    with pytest.raises(FileNotFoundError) as missing:
        vgs.read(tmp_path / "missing.nii.gz")
    assert missing.value.exit_code == 66 and "missing.nii.gz" in str(missing.value)
    damaged = tmp_path / "damaged.nii.gz"
    damaged.write_bytes(b"\x1f\x8b\x08 damaged")
    with pytest.raises(vgs.BadDataError) as bad:
        vgs.read(damaged)
    assert bad.value.file == str(damaged) and bad.value.exit_code == 65


def test_a_file_is_kept_unless_force_is_set(ct, tmp_path: pathlib.Path):
    ct.save(tmp_path / "ct.nii")
    with pytest.raises(FileExistsError):
        ct.save(tmp_path / "ct.nii")
    ct.save(tmp_path / "ct.nii", force=True)
    with pytest.raises(vgs.UsageError):
        ct.save(tmp_path / "ct.png")


def test_a_series_of_npy_has_its_spacing(tmp_path, ball):
    np.save(tmp_path / "ct.npy", ball.astype(np.float32))
    assert vgs.read(tmp_path / "ct.npy", voxel_mm=0.5).spacing_mm == (0.5, 0.5, 0.5)
    assert vgs.read(tmp_path / "ct.npy", voxel_mm=(0.5, 1, 2)).spacing_mm == (0.5, 1.0, 2.0)
