"""A steel ball of 10 mm goes through a plate of glass at 30 m/s. It crushes the glass, and radial cracks grow.

Source: none; mechanics. The plate of 60 x 60 x 4 mm is free, and so is the ball, which is rigid with a round surface.
Elastic, brittle, bonds in space; contact without friction.
Calibrated: nothing.
"""

from math import pi

from pdmesh import Body, Box, Material, Run, Sphere

spacing = 1e-3  # m: between nodes
side = 0.06  # m: of the plate
thickness = 4e-3  # m
radius = 5e-3  # m: of the ball
gap = 0.1e-3  # m: between ball and plate
speed = 30.0  # m/s: of the ball
duration = 0.25e-3  # s

glass = Material(E=72e9, rho=2440, G0=8)
half, mass = side / 2, 7850 * 4 / 3 * pi * radius**3

scene = Body(
    Box((-half, -half, -thickness), (half, half, 0)), spacing, glass, run=Run(duration=duration, every=40, ledger=10)
).rigid(Sphere((0, 0, radius + gap), radius), "ball", mass, (0, 0, -speed), radius=radius)
