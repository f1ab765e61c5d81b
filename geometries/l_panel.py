"""The short arm of an L-shaped panel of concrete is lifted until the crack from its corner has grown through.

Source: B. Winkler, thesis, Innsbruck (2001): 0.5 x 0.5 m, 0.1 m thick, E = 25.85 GPa, f_t = 2.7 MPa, G_f = 65 J/m^2.
Tests carry 7 to 7.5 kN, and their cracks rise from the corner by some 40 to 60 mm; the one here stays nearly level.
Calibrated: nothing. Bonds have nu = 1/3 in the place of 0.18, and their crack runs level 6 mm below the corner. Those
with shear (`pdsolve --set material.model=micropolar --set material.nu=0.18`) carry 7.15 kN at 0.15 mm, 7.8 kN at
0.18 mm with G_f = 90 J/m^2, and their crack runs level 6 mm above it. With 65 J/m^2, a drive by normal stretch alone
(7.9 kN) or a horizon of 4 spacings (7.15 kN) leaves that height. The foot is clamped. The arm is lifted at one node
30 mm from its end, as two neighbours would clamp it.
"""

from shapely import Point, Polygon

from pdmesh import Material, Run, Scene, Static, ramp

spacing = 0.0125  # m: between nodes
horizon = 3.0  # horizon over spacing
lift = 1e-3  # m: of the arm in the end
load_steps = 80  # through the panel's whole width
size, arm = 0.5, 0.25  # m

concrete = Material(E=25.85e9, rho=2400, G0=65, law="cohesive", f_t=2.7e6, shape="exponential", micromodulus="constant")
outline = Polygon([(0, 0), (arm, 0), (arm, arm), (size, arm), (size, size), (0, size)])
x = size - spacing * round(0.03 / spacing)
run = Run(solver="static", static=Static(load_steps=load_steps))

scene = (
    Scene(outline, spacing, concrete, horizon, run)
    .fix("bottom", rows=1, name="foot")
    .fix(Point(x, arm), x=None, y=lift, profile=ramp(1), breakable=True, name="arm")
)
