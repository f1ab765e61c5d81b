"""The crack of a pre-cracked glass plate branches. Its three fragments bounce from walls and collide.

Source: mechanics. The halves move apart at the start, the crack runs and branches, the fragments bounce from rigid
walls and meet again where the plate broke. All is symmetric about the middle.
Elastic, brittle, plane stress; contact between the walls and the plate, and between its fragments, without friction.
Calibrated: G0, so that the crack branches once.
"""

from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
length, height, crack = 0.1, 0.04, 0.04  # m; crack: from the left edge
speed = 1.0  # m/s: of each half, away from the other
gap = 0.1e-3  # m: between plate and wall
duration = 0.2e-3  # s

glass = Material(E=72e9, rho=2440, G0=14)
half, held = height / 2, ("x", "y", "spin")

scene = (
    Scene(box(0, -half, length, half), spacing, glass, run=Run(duration=duration, every=50, ledger=50))
    .crack([(0, 0), (crack, 0)])
    .move(box(0, -half, length, 0), initial_velocity=(0.0, -speed), name="lower half")
    .move(box(0, 0, length, half), initial_velocity=(0.0, speed), name="upper half")
)
for name, start in (("lower wall", -half - gap - 4e-3), ("upper wall", half + gap)):
    scene = scene.rigid(box(-5e-3, start, length + 5e-3, start + 4e-3), name, held=held)
