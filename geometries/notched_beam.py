"""A notched beam of concrete in three-point bending, at rest, until its crack has grown through the beam.

Source: P.-E. Petersson, report TVBM-1006, Lund (1981): 2 x 0.2 m, 50 mm thick, notched to half its height, E = 30 GPa,
f_t = 3.33 MPa, G_f = 124 J/m^2. Independent programs have its peak at 0.75 to 0.85 kN.
Calibrated: nothing. Bonds have nu = 1/3 instead of 0.2. Each support is one node, because two neighbours would clamp
the beam. The load is applied to one node too, half a spacing beside the notch.
"""

from pdmesh import Material, Run, Scene, Static, box, ramp

layers = 11  # spacings over the height, an odd number, so that the notch ends between two rows
horizon = 3.0  # horizon over spacing
deflection = 2e-3  # m: in the end
length, height = 2.0, 0.2  # m

concrete = Material(E=30e9, rho=2400, G0=124, law="cohesive", f_t=3.33e6, shape="bilinear", micromodulus="constant")
spacing = height / layers
beside = spacing / 2  # m: nodes are half a spacing beside the ends and the notch


def node(x, y):
    """A box around one node."""
    return box(x - spacing / 4, y - spacing / 4, x + spacing / 4, y + spacing / 4)


scene = (
    Scene(box(0, 0, length, height), spacing, concrete, horizon, Run(solver="static", static=Static()))
    .crack([(length / 2, 0), (length / 2, height / 2)])
    .fix(node(beside, 0), name="left")
    .fix(node(length - beside, 0), x=None, name="right")
    .fix(node(length / 2 - beside, height), x=None, y=-deflection, profile=ramp(1), breakable=True, name="middle")
)
