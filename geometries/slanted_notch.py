"""A beam of PMMA in three-point bending with a notch at 45 degrees across it: the front twists until it is straight.

Source: the specimen of V. Lazarus, F.-G. Buchholz, M. Fulland, J. Wiebesiek, Int. J. Fract. 153 (2008) 141-151,
but shorter and loaded quickly. In the source too the front twists until the crack is straight across the beam.
31 200 nodes 1 mm apart, in space.
Calibrated: the speed of the stamp, so that the crack runs within half a millisecond.
"""

import numpy as np

from pdmesh import Body, Box, Material, Run, ramp

spacing = 1e-3  # m: between nodes
span = 0.1  # m: between the supports
width = 0.012  # m
height = 0.025  # m
notch = 0.009  # m: how high it is
angle = 45.0  # degrees: between the notch and the section across the beam
speed = 1.5  # m/s: of the stamp, downwards
duration = 6e-4  # s

pmma = Material(E=2.8e9, rho=1180, G0=400, micromodulus="constant")
half, wide = span / 2 + 2 * spacing, width / 2
run, off = width * np.tan(np.radians(angle)), spacing / 4  # off the middle, the notch passes between nodes
near, far = (off - run, -2 * wide), (off + run, 2 * wide)
sheet = np.array([(*near, -spacing), (*far, -spacing), (*far, notch), (*near, notch)])


def line(x, z):
    """The nodes of one row across the beam."""
    return Box((x - spacing / 2, -wide, z - spacing / 2), (x + spacing / 2, wide, z + spacing / 2))


scene = (
    Body(Box((-half, -wide, 0), (half, wide, height)), spacing, pmma, run=Run(duration=duration))
    .crack([sheet[[0, 1, 2]], sheet[[0, 2, 3]]], "notch")
    .fix(line(-(span + spacing) / 2, spacing / 2), x=None, y=None, name="left support")
    .fix(line((span + spacing) / 2, spacing / 2), x=None, y=None, name="right support")
    .move(line(spacing / 2, height - spacing / 2), velocity=(None, None, -speed), profile=ramp(5e-5), name="stamp")
)
