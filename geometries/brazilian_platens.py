"""Steel platens press a disc of concrete until it splits: the Brazilian test, quasi-static.

Source: the splitting test, as in ASTM C496, has a strength of 2 F / (pi D t). The disc has 100 mm; platens of 10 mm
touch it along a line, as drawn, and rub. Nothing else holds it.
Calibrated: nothing. Bonds have nu = 1/3. They soften by their stretch, to which the pressure along the loaded diameter
adds, three times the tension.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

spacing = 0.0025  # m: between nodes
horizon = 3.0  # horizon over spacing
diameter = 0.1  # m
strip = 0.01  # m: about the width and height of a platen, in pairs of spacings
friction = 0.2  # of steel on concrete
closing = 2e-4  # m: of the platens at most
opening = 1e-4  # m: of a gauge over the middle half of the diameter, in the end
load_steps = 40  # in which the width opens
G0 = 100.0  # J/m^2

concrete = Material(E=30e9, rho=2400, G0=G0, law="cohesive", f_t=3e6, shape="bilinear", micromodulus="constant")
steel = Material(E=200e9, rho=7850, G0=1e5, law="cohesive", f_t=500e6, shape="bilinear", micromodulus="constant")
radius, side = diameter / 2, 2 * spacing * round(strip / spacing / 2)  # m; lattices stand in line
disc = Point(0, 0).buffer(radius, quad_segs=64)
run = Run(solver="static", static=Static(load_steps=load_steps, control="width", opening=opening))

scene = Scene(disc, spacing, concrete, horizon, run)
for name, up in (("lower", -1), ("upper", 1)):
    back = up * (radius + side)  # m, the side of a platen that moves
    scene = scene.body(box(-side / 2, min(back, up * radius), side / 2, max(back, up * radius)), name, material=steel)
    moved = [(-side / 2, back), (side / 2, back)]
    scene = scene.fix(moved, x=0.0, y=-up * closing / 2, profile=ramp(1), breakable=True, name=name)
scene = scene.contact(friction=friction).gap("width", (-radius / 2, 0), (radius / 2, 0))
