"""A notched beam of concrete in quasi-static three-point bending, until its crack has grown through the beam.

Source: P.-E. Petersson, report TVBM-1006, Lund (1981): 2 x 0.2 m, 50 mm thick, notched to half its height, E = 30 GPa,
f_t = 3.33 MPa, G_f = 124 J/m^2. Independent programs have its peak at 0.75 to 0.85 kN.
Calibrated: nothing. Bonds have nu = 1/3 instead of 0.2. Each support is one node, because two neighbours would clamp
the beam. The load is applied to one node too, half a spacing beside the notch.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

layers = 11  # spacings over the height, an odd number, so that the notch ends between two rows
horizon = 3.0  # horizon over spacing
deflection = 2e-3  # m: in the end
length, height = 2.0, 0.2  # m

concrete = Material(E=30e9, rho=2400, G0=124, law="cohesive", f_t=3.33e6, shape="bilinear", micromodulus="constant")
spacing = height / layers
beside = spacing / 2  # m: nodes are half a spacing beside the ends and the notch

scene = (
    Scene(box(0, 0, length, height), spacing, concrete, horizon, Run(solver="static", static=Static()))
    .crack([(length / 2, 0), (length / 2, height / 2)])
    .pin(beside, 0, name="left")
    .roller(length - beside, 0, name="right")
    .fix(Point(length / 2 - beside, height), x=None, y=-deflection, profile=ramp(1), breakable=True, name="middle")
    .gap("mouth", (length / 2 - beside, 0), (length / 2 + beside, 0))
    .load_cell("supports", "left", "right")
)
