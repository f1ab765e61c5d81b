"""A ply of carbon and epoxy with a hole is pulled along its fibres, and splits along them from the sides of the hole.

Source: constants and strengths of IM7/8552, E1 171.4, E2 9.08, G12 5.29 GPa, nu12 0.32.
Calibrated: the speed of the ends, so that waves run to and fro several times before the plate splits, and the damping.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, box, ramp

length, width, diameter = 0.06, 0.024, 0.006  # m
spacing = 5e-4  # m: between nodes
horizon = 3.0  # horizon over spacing
angle = 0.0  # degrees: of the fibres, from the pull
speed = 2.0  # m/s: of each end
duration = 8.4e-5  # s: of the run
every = 200  # steps between frames
damping = 1e5  # 1/s: so that what a split releases does not break more

ply = Material(
    E=171.4e9, E2=9.08e9, nu=0.32, G12=5.29e9, angle=angle, rho=1580, G0=1e3,
    model="correspondence", solid="orthotropic", failure="stress",
    strength=2326e6, strength_across=62.3e6, shear_strength=92.3e6,
)  # fmt: skip
plate = box(0, 0, length, width) - Point(length / 2, width / 2).buffer(diameter / 2, quad_segs=32)
run = Run(duration=duration, every=every, damping=damping)

scene = (
    Scene(plate, spacing, ply, horizon, run)
    .move("left", velocity=(-speed, None), profile=ramp(1e-5), name="pulled left")
    .move("right", velocity=(speed, None), profile=ramp(1e-5), name="pulled right")
)
