"""Labels of TotalSegmentator (--ml): some structures in one fit, each splat with its label."""

import vgs

ct = vgs.read("ct.nii.gz")
organs = vgs.fit(ct, "segmentation.nii.gz", labels=["aorta", "liver"], quality="preview")

# Splats make the sum right at the voxels: a mean over an organ is taken there.
decoded = organs.rasterize(like=ct)
for number, name in organs.label_names.items():
    mask = vgs.Roi.from_mask("segmentation.nii.gz", ct, number).array > 0
    print(f"{name}: {len(organs.with_label(number))} splats, {decoded.array[mask].mean():.0f} HU")
organs.save("organs.vgs")

# What is shown of them is chosen later.
picture = vgs.render(organs, objects={"liver": {"opacity": 0.3}, "aorta": {"colour": "#d02020"}})
print(picture.shape)
