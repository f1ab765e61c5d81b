"""A plate of Duran 50 glass, 1 x 1 m, with an edge crack of a quarter of a metre, pulled suddenly at two ends.

Source: the glass of duran50.geo (A. De Checchi, master's thesis, University of Padua 2012/13, after Y. D. Ha and
F. Bobaru, Int. J. Fract. 162 (2010) 229-244) in a plate so large that no wave returns from the far edges before the
crack has run. It is made for a moving fine zone: 16 million nodes at 0.25 mm.
Calibrated: nothing. The crack lies half a spacing above the middle, between two rows of nodes.
"""

from pdmesh import Material, Run, Scene, box

spacing = 5e-3  # m: between nodes
side = 1.0  # m: of the plate
horizon = 4.0  # horizon over spacing
traction = 8e6  # Pa: on the upper and the lower edge
crack = 0.25  # m: length of the edge crack
duration = 270e-6  # s: the crack has then run 0.3 m
frames = 2  # that are written
adapt = "hybrid"  # none: the fine lattice everywhere

E, rho = 65e9, 2235.0
glass = Material(E=E, rho=rho, G0=204, micromodulus="conical")
step = 1.2 * spacing * (rho / E) ** 0.5  # a little less than what the solver finds
steps = round(duration / step)
middle = side / 2 + spacing / 2

scene = (
    Scene(
        box(0, 0, side, side),
        spacing,
        glass,
        horizon,
        Run(time_step=step, steps=steps, every=-(-steps // frames), fields=("ux", "uy", "damage"), adapt=adapt),
    )
    .crack([(0, middle), (crack, middle)])
    .load("top", traction=(0, traction), rows=1)
    .load("bottom", traction=(0, -traction), rows=1)
)
