"""A beam in quasi-static three-point bending, ten times as long as it is high.

Source: S. P. Timoshenko's beam, w = F L^3 / (48 E I) + F L / (4 k G A) with k = 5/6. Single nodes at
mid-height of the ends support the beam, so that nothing is indented.
Calibrated: the load, which bends a beam of glass by less than a thousandth of its height.
"""

from pdmesh import Material, Run, Scene, box

length = 0.1  # m: between the supports
height = 0.01  # m
layers = 16  # spacings over the height, an even number
horizon = 3.0  # horizon over spacing
force = 1.6e3  # N/m: in the middle, per unit thickness

glass = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
half, spacing = height / 2, height / layers


def node(x, y):
    """A box around one node."""
    return box(x - spacing / 4, y - spacing / 4, x + spacing / 4, y + spacing / 4)


scene = (
    Scene(box(0, -half, length, half), spacing, glass, horizon, Run(solver="static"))
    .fix(node(0, 0), name="left")
    .fix(node(length, 0), x=None, name="right")
    .load(node(length / 2, half), body_force=(0, -force / (spacing * spacing / 2)), name="force")
)
