"""A figure: the CT beside its splats, and how much they differ."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import vgs

ct = vgs.read("ct.nii.gz")
bones = vgs.load("bones.ply")
how = {"tf": "CT-Bone", "camera": "anterior-left", "size": (300, 300)}
pictures = {"CT": vgs.render(ct, roi=(226, 3071), **how), f"{len(bones)} splats": vgs.render(bones, **how)}

figure, axes = plt.subplots(1, 2, figsize=(8, 4))
for axis, (title, picture) in zip(axes, pictures.items()):
    axis.imshow(picture)
    axis.set_title(title)
    axis.axis("off")
figure.savefig("figure.png", dpi=150)
print(vgs.compare(*pictures.values()))
