"""A drop weight hits a beam of PMMA on two rollers and rebounds.

Source: mechanics of a mass on a spring. The hammer, a rigid body of 100 kg per metre of thickness, hits a beam of 200 x
30 mm over a span of 160 mm at 1 m/s. On a beam without mass it would stay for pi sqrt(M / k) = 3.6 ms, with k of
Timoshenko's beam and 17/35 of its mass, and leave at 1 m/s. Found: 3.5 ms, in pulses of the beam's vibration, and 0.98.
Elastic, brittle, plane stress. The hammer and the rollers are rigid and without friction.
Calibrated: nothing.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, box

spacing = 1.5e-3  # m: between nodes
span, depth, over = 0.16, 0.03, 0.02  # m; over: beyond each roller
radius = 6e-3  # m: of the rollers
mass, speed = 100.0, 1.0  # kg/m, m/s: of the hammer
duration = 5e-3  # s

pmma = Material(E=3.3e9, rho=1180, G0=400)
half, held = span / 2 + over, ("x", "y", "spin")

scene = Scene(box(-half, 0, half, depth), spacing, pmma, run=Run(duration=duration, every=400, ledger=10)).rigid(
    box(-6e-3, depth, 6e-3, depth + 24e-3), "hammer", mass, (0.0, -speed), held=("x", "spin")
)
for name, x in (("left", -span / 2), ("right", span / 2)):
    scene = scene.rigid(Point(x, -radius).buffer(radius), f"{name} roller", held=held)
