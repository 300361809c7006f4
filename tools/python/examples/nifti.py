"""A CT and a mask as NIfTI, through nibabel: fit, measure, save, and back to a volume."""

import nibabel

import vgs

ct = nibabel.load("ct.nii.gz")
mask = nibabel.load("bones.nii.gz")

bones = vgs.fit(ct, mask, quality="preview")
print(bones, bones.evaluate(ct, mask))
bones.save("bones.ply", force=True)

again = bones.rasterize(like=ct)
nibabel.save(again.to_nibabel(), "again.nii.gz")
