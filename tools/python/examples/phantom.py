"""A volume that is an array: a hollow ball of bone in water, [i, j, k] with voxels of 1 mm."""

import numpy as np

import vgs

i, j, k = np.indices((48, 48, 48)) - 23.5
radius = np.sqrt(i**2 + j**2 + k**2)
ball = vgs.Volume(np.where(abs(radius - 15) < 3, 900.0, 0.0), unit="hu")

shell = vgs.fit(ball, (226, 3071), splats=2000, iterations=100)
intensity, occupancy = shell.field([[38.5, 23.5, 23.5], [23.5, 23.5, 23.5]])
print(f"in the shell {intensity[0]:.0f} HU, occupancy {occupancy[0]:.2f}; in its middle {occupancy[1]:.2f}")
