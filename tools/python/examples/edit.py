"""Splats as arrays: metal is taken out, the rest is moved and saved."""

import numpy as np

import vgs

splats = vgs.load("bones.ply")
kept = splats[(splats.intensities < 2000) & (splats.scales.max(axis=1) < 20)]

# Into the middle of the patient, as some programs want it.
centre = np.average(kept.means, axis=0, weights=kept.opacities)
kept.replace(means=kept.means - centre).save("centred.ply")
print(f"{len(splats) - len(kept)} of {len(splats)} splats are left out, the others moved by {-centre} mm")
