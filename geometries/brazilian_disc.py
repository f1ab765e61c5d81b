"""A disc of concrete is pressed between two flats until it splits: the Brazilian test, quasi-static.

Source: the splitting test, as in ASTM C496, has a strength of 2 F / (pi D t). The disc has 100 mm and two flat arcs of
10 degrees.
Calibrated: nothing. Bonds have nu = 1/3. They soften by their stretch, to which the pressure along the loaded diameter
adds, three times the tension. First bonds soften at 0.4 f_t; the disc splits at 0.95 f_t.
"""

from math import cos, radians, sin

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

spacing = 0.002  # m: between nodes
horizon = 3.0  # horizon over spacing
diameter = 0.1  # m
arc = 10.0  # degrees: of each flat
closing = 8.5e-5  # m: of the flats in the end
load_steps = 40  # in which the disc would be split
G0 = 100.0  # J/m^2

concrete = Material(E=30e9, rho=2400, G0=G0, law="cohesive", f_t=3e6, shape="bilinear", micromodulus="constant")
radius = diameter / 2
half, flat = radius * cos(radians(arc / 2)), radius * sin(radians(arc / 2))  # m
outline = Point(0, 0).buffer(radius, quad_segs=64).intersection(box(-radius, -half, radius, half))
run = Run(solver="static", static=Static(load_steps=load_steps))

scene = (
    Scene(outline, spacing, concrete, horizon, run)
    .fix([(-flat, -half), (flat, -half)], x=None, y=closing / 2, profile=ramp(1), breakable=True, name="lower")
    .fix([(-flat, half), (flat, half)], x=None, y=-closing / 2, profile=ramp(1), breakable=True, name="upper")
    .fix(Point(0, half), x=0, y=None, breakable=True, name="middle")
    .gap("width", (-radius / 2, 0), (radius / 2, 0))
)
