"""A folder of DICOM slices, and the bone in it as a threshold that is cleaned."""

import vgs

ct = vgs.read("dicom")
print(ct, ct.axis_codes)

bone = vgs.Roi.from_threshold(ct, 226, 3071, largest=1, fill_holes=True)
splats = vgs.fit(ct, bone, quality="preview")
splats.save("bone.vgs")
print(bone, splats)
