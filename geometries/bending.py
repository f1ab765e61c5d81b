"""A beam in three-point bending, ten times as long as it is high: the deflection of Timoshenko's beam, at rest.

Source: S. P. Timoshenko's beam with a shear coefficient of 5/6; supported by single nodes at mid-height of its ends, so
that nothing is indented.
Calibrated: the load, which bends a beam of glass by a thousandth of its height.
"""

from pdmesh.scene import Material, Run, Scene, box

length = 0.1  # m: between the supports
height = 0.01  # m: nominal; nodes span one spacing less
rows = 16  # of nodes over the height
horizon = 3.0  # horizon over spacing
force = 1.6e3  # N/m: in the middle, per unit thickness

spacing = height / rows
glass = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
half = spacing * (rows - 1) / 2
low = half - spacing / 2


def node(x, y):
    """A box around one node."""
    return box(x - spacing / 4, y - spacing / 4, x + spacing / 4, y + spacing / 4)


scene = (
    Scene(box(0, 0, length, 2 * half), spacing, glass, horizon, Run(solver="static"))
    .fix(node(0, low), name="left")
    .fix(node(length, low), x=None, name="right")
    .load(node(length / 2, 2 * half), body_force=(0, -force / (spacing * spacing / 2)), name="force")
)
