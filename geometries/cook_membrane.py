"""Cook's membrane: a tapered panel is clamped at one side and sheared at the other (quasi-static).

Source: R. D. Cook, J. Struct. Div. ASCE 100 (1974) 1851-1863: 48 wide, 44 and 16 high, thickness, E and load 1. The
middle of the loaded side moves by 23.96 with nu = 1/3 in plane stress, and by 18.50 with nu = 0.4999 in plane strain.
The load here is 1e-4 of that, so that displacements are small.
Calibrated: nothing.
"""

from shapely import Polygon

from pdmesh import Material, Run, Scene, Static

spacing = 1.0  # m: between nodes
horizon = 2.0  # horizon over spacing
nu = 0.33333333  # 0.4999 with `--set plane=strain`
plane = "stress"  # or "strain"
load = 1e-4  # N/m
control = "silling"  # of modes without energy

solid = Material(E=1.0, rho=1.0, G0=1.0, nu=nu, model="correspondence", plane=plane, failure="none", control=control)
outline = Polygon([(0, 0), (48, 44), (48, 60), (0, 44)])

scene = (
    Scene(outline, spacing, solid, horizon, Run(solver="static", static=Static()), units="m")
    .fix("left", rows=1, name="left")
    .load([(48, 44), (48, 60)], traction=(0, load / 16), rows=1, name="right")
)
