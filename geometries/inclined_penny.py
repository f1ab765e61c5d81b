"""A block of glass with an inclined penny-shaped crack is pulled apart fast. The crack turns as it grows.

Source: the shape is that of M. K. Kassir and G. C. Sih, J. Appl. Mech. 33 (1966) 601-611, whose crack is elliptical.
27 000 nodes 1 mm apart, in space; the normal of the crack is 30 degrees from the pull.
Calibrated: the speed of the grips, so that the crack reaches the sides in 40 us.
"""

import numpy as np

from pdmesh import Body, Box, Material, Run, ramp

spacing = 1e-3  # m: between nodes
side = 0.03  # m: of the block
radius = 6e-3  # m: of the crack
angle = 30.0  # degrees: between its normal and the pull
speed = 0.4  # m/s: of each grip
duration = 4e-5  # s

glass = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
turned, around, half = np.radians(angle), np.linspace(0, 2 * np.pi, 48, endpoint=False), side / 2
disc = radius * np.column_stack([np.cos(around) * np.cos(turned), np.sin(around), np.cos(around) * np.sin(turned)])

scene = (
    Body(Box((-half, -half, -half), (half, half, half)), spacing, glass, run=Run(duration=duration))
    .crack([np.array([(0, 0, 0), disc[k - 1], disc[k]]) for k in range(len(disc))], "penny")
    .move("top", velocity=(None, None, speed), rows=3, profile=ramp(2e-6))
    .move("bottom", velocity=(None, None, -speed), rows=3, profile=ramp(2e-6))
)
