"""A beam of mortar with a notch beside its middle in quasi-static three-point bending: a mixed-mode crack.

Source: R. John, S. P. Shah, J. Struct. Eng. ASCE 116 (1990) 585-602: 229 x 76 x 25 mm, a span of 203 mm, a notch of
19 mm at a share `offset` of half the span. Cracks start at the notch below an offset of some 0.7 and rise to the load.
Calibrated: E, f_t and G_f, which are those of an ordinary mortar. Bonds have nu = 1/3.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

layers = 15  # spacings over the height
horizon = 3.0  # horizon over spacing
offset = 0.5  # of half the span: from the middle to the notch
deflection = 2e-4  # m: in the end
load_steps = 40  # in which a crack would go through
span, beyond, height, notch = 0.2032, 0.0127, 0.0762, 0.019  # m

mortar = Material(E=30e9, rho=2400, G0=50, law="cohesive", f_t=3.5e6, shape="bilinear", micromodulus="constant")
spacing = height / layers
foot = -spacing * round(offset * span / 2 / spacing)
run = Run(solver="static", static=Static(load_steps=load_steps))

scene = (
    Scene(box(-span / 2 - beyond, 0, span / 2 + beyond, height), spacing, mortar, horizon, run)
    .crack([(foot, 0), (foot, notch)])
    .pin(-span / 2, 0, name="left")
    .roller(span / 2, 0, name="right")
    .fix(Point(0, height), x=None, y=-deflection, profile=ramp(1), breakable=True, name="middle")
    .gap("mouth", (foot - spacing / 2, 0), (foot + spacing / 2, 0))
)
