"""A notched bar of glass is torn in two. Its halves bounce from walls and collide with their broken faces.

Source: mechanics. The halves move apart at the start, the ligament between the notches breaks, each half bounces from a
rigid wall, and both collide where the bar broke. All is symmetric, so that a perfect collision exchanges velocities.
Elastic, brittle, plane stress; contact between the walls and the bar, and between its fragments, without friction.
Calibrated: nothing.
"""

from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
length, height, notch = 0.06, 0.02, 7e-3  # m; notch: depth of each of the two
speed = 1.0  # m/s: of each half, away from the other
gap = 0.3e-3  # m: between bar and wall
duration = 0.75e-3  # s

glass = Material(E=72e9, rho=2440, G0=8)
half, held = length / 2, ("x", "y", "spin")

scene = (
    Scene(box(-half, 0, half, height), spacing, glass, run=Run(duration=duration, every=100, ledger=50))
    .crack([(0, 0), (0, notch)])
    .crack([(0, height - notch), (0, height)])
    .move(box(-half, 0, 0, height), initial_velocity=(-speed, 0.0), name="left half")
    .move(box(0, 0, half, height), initial_velocity=(speed, 0.0), name="right half")
)
for name, start in (("left wall", -half - gap - 4e-3), ("right wall", half + gap)):
    scene = scene.rigid(box(start, -2e-3, start + 4e-3, height + 2e-3), name, held=held)
