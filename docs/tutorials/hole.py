"""A square plate with a hole, pulled at its upper and lower edge, at rest."""

from pdmesh import Circle, Material, Run, Scene, Static, box

spacing = 5e-4  # m: between nodes
size = 0.1  # m: of the plate
radius = 5e-3  # m: of the hole
traction = 1e6  # Pa

glass = Material(E=65e9, rho=2235, G0=204)
half = size / 2
run = Run(solver="static", static=Static(floating=True))  # nothing supports the plate: its loads balance
scene = (
    Scene(box(-half, -half, half, half), 4 * spacing, glass, run=run)
    .hole(Circle(0, 0, radius))
    .refine("hole", 3 * radius, spacing)
    .load("top", traction=(0, traction))
    .load("bottom", traction=(0, -traction))
)
