"""A compact-tension specimen of steel under repeated loads. Its crack grows a little with every cycle.

Source: the shape is that of ASTM E647 (W = 50 mm, a / W = 0.3); the growth is da/dN = C dK^m, after P. Paris and
F. Erdogan, J. Basic Engng 85 (1963) 528. Bonds tire after S. A. Silling and A. Askari, SAND2014-18590 (2014): each
cycle takes A eps^m of a bond's life, where eps is the range of its stretch.
Calibrated: nothing. C is proportional to A, so that one run gives the A of any C (`pdpost fatigue`).
Loads are spread over short lines instead of pins. `ratio` is the least load of a cycle over the largest.
"""

from pdmesh import Fatigue, Material, Run, Scene, box

spacing = 1e-3  # m
horizon = 3.0  # horizon over spacing
W = 0.05  # m: from the load line to the back
crack = 0.015  # m: from the load line to its end
load = 0.5e6  # N/m, the largest of a cycle
ratio = 0.0
A = 1e9
m = 4.0
C = 0.0  # m a cycle at 1 Pa m^0.5; above 0 a crack of particles grows by K in place of bonds that tire
steps = 60  # of ten jumps each, at most

steel = Material(E=200e9, rho=7850, G0=1e6)
bonds = Run(solver="static", steps=steps, every=2, fatigue=Fatigue(A=A, m=m, ratio=ratio))
by_K = Run(solver="static", steps=steps, every=1, cracks="particles", fatigue=Fatigue(C=C or None, m=m, ratio=ratio))
half, arm, pad, beside = 0.6 * W, 0.275 * W, 2e-3, 0.6 * spacing
traction = load / (2 * pad)

scene = (
    Scene(box(-0.25 * W, -half, W, half), spacing, steel, horizon, by_K if C else bonds)
    .crack([(-0.25 * W, 0), (crack, 0)])
    .load([(-pad, arm), (pad, arm)], (0, traction), name="upper")
    .load([(-pad, -arm), (pad, -arm)], (0, -traction), name="lower")
    .fix(box(W - beside, -beside, W, beside), y=None, name="back")
    .fix(box(W - beside, 0, W, beside), x=None, name="level")
)
