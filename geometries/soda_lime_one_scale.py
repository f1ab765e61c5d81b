"""The pre-cracked plate of soda-lime glass of soda_lime.geo with a uniform spacing of 1 mm: 4242 nodes.

Source: A. De Checchi, master's thesis, University of Padua 2012/13, "Implementazione di tecniche di grid generation
e refinement nell'analisi peridinamica 2D", after Y. D. Ha and F. Bobaru, Int. J. Fract. 162 (2010) 229-244. The
thesis counts 42 rows: from half a spacing to 20.5 mm from the crack. The plate is therefore 41 mm high instead of 40.
Calibrated: the horizon ratio (4), which gives the critical stretches of the thesis's table 4, and the rows that carry
the load: 8, the same strip as the four coarse rows on two scales.
"""

from pdmesh import Material, Run, Scene, box

spacing = 1e-3  # m: between nodes
horizon = 4.0  # horizon over spacing
traction = 12e6  # Pa: on the upper and the lower edge
rows = 8  # of nodes that carry it, the 8 mm of the four coarse rows on two scales
crack = 0.05  # m: length of the edge crack

glass = Material(E=72e9, rho=2440, G0=135, micromodulus="conical")
half = 0.02 + spacing / 2

scene = (
    Scene(box(0, -half, 0.1, half), spacing, glass, horizon, Run(time_step=25e-9, steps=1700, every=50))
    .crack([(0, 0), (crack, 0)])
    .load("top", traction=(0, traction), rows=rows)
    .load("bottom", traction=(0, -traction), rows=rows)
)
