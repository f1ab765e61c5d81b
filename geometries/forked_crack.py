"""The crack of a pre-cracked glass plate branches, modelled by crack particles (16482 nodes, 0.5 mm apart).

Source: the plate of `branching_plate.py`, made of bonds; J.-H. Song, H. Wang, T. Belytschko, Comput. Mech. 42 (2008)
239-250, whose crack forks 65 to 70 mm from the left edge.
Calibrated: the horizon, as there; the strength is compared with the mean stress within 1.5 horizons of a tip.
"""

from pdmesh import Material, ParticleRules, Run, Scene, box

spacing = 0.5e-3  # m: between nodes
horizon = 3.0  # horizon over spacing
traction = 1e6  # Pa: on the upper and the lower edge
rows = 3  # of nodes that carry it
crack = 0.05  # m: length of the edge crack
strength = 3.08e6  # Pa

glass = Material(E=32e9, rho=2450, G0=3)
half = 0.02 + spacing / 2  # so that rows of nodes are half a spacing off the crack
rules = ParticleRules(criterion="stress", strength=strength)
run = Run(time_step=50e-9, steps=1200, every=60, cracks="particles", particles=rules)

scene = (
    Scene(box(0, -half, 0.1, half), spacing, glass, horizon, run)
    .crack([(0, 0), (crack, 0)])
    .load("top", traction=(0, traction), rows=rows)
    .load("bottom", traction=(0, -traction), rows=rows)
)
