"""From a CT to splats, and to a picture."""

import matplotlib.image

import vgs

ct = vgs.read("ct.nii.gz")  # or a folder of DICOM slices, an image of nibabel or SimpleITK, an array
bone = vgs.Roi.from_threshold(ct, 226, 3071)  # or a mask: Roi.from_mask
splats = vgs.fit(ct, bone)
splats.save("bone.ply")
print(splats.evaluate(ct, bone))
matplotlib.image.imsave("bone.png", vgs.render(splats, tf="CT-Bone", camera="anterior-left"))
