"""Labels of TotalSegmentator (--ml): some structures in one fit, each splat with its label."""

import vgs

ct = vgs.read("ct.nii.gz")
organs = vgs.fit(ct, "segmentation.nii.gz", labels=["aorta", "liver"], quality="preview")

for number, name in organs.label_names.items():
    part = organs.with_label(number)
    print(f"{name}: {len(part)} splats, {part.intensities.mean():.0f} HU")
organs.save("organs.vgs")

# What is shown of them is chosen later.
picture = vgs.render(organs, objects={"liver": {"opacity": 0.3}, "aorta": {"colour": "#d02020"}})
print(picture.shape)
