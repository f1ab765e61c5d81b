"""The arms of a double-cantilever beam of glass are opened at their ends (quasi-static).

Source: arms of height h and a crack of length a from the load, as beams on an elastic foundation: K = 2 sqrt(3) P a
(1 + 0.64 h / a) / h^1.5 with the load P per thickness (M. F. Kanninen, Int. J. Fract. 9 (1973) 83-92).
Calibrated: nothing. Bonds have nu = 1/3. Each load is one node; nothing breaks at this opening.
"""

from shapely import Point

from pdmesh import Material, Run, Scene, Static, box, ramp

spacing = 1e-3  # m: between nodes
horizon = 3.0  # horizon over spacing
arm = 0.02  # m: height of an arm
crack = 0.08  # m: from the loads to the tip
length = 0.18  # m: from the loads to the far end
opening = 2e-6  # m: of the loads in the end
load_steps = 1  # of the loads, or of a growing crack
cracks = "bonds"  # or "particles": at an opening of 4e-4 and more the crack grows, its length being
# the control; its tip needs room of 3.5 horizons, so 1 mm between nodes or less

glass = Material(E=72e9, rho=2500, G0=8.0)
behind = arm  # m: what is behind the loads
control = "crack" if cracks == "particles" else None
run = Run(solver="static", static=Static(load_steps=load_steps, control=control), cracks=cracks)

scene = (
    Scene(box(-behind, -arm, length, arm), spacing, glass, horizon, run)
    .crack([(-behind, 0), (crack, 0)])
    .fix(Point(0, arm), x=None, y=opening / 2, profile=ramp(1), name="upper")
    .fix(Point(0, -arm), x=None, y=-opening / 2, profile=ramp(1), name="lower")
    .pin(length, 0, name="end")
    .roller(length, arm, along="y", name="no rotation")
    .gap("loads", (0, arm), (0, -arm))
)
