"""The crack of a pre-cracked glass plate branches (correspondence model, 16482 nodes, 0.5 mm apart).

Source: the plate of J.-H. Song, H. Wang, T. Belytschko (2008) and M. J. Borden and others (2012), the latter with 3
J/m^2, with the strength of X. Zhou, Y. Wang, Q. Qian (2016).
Calibrated: the rows that carry the load, and the horizon. The strength does not scale with the horizon: 1.5 mm is about
where the field of a crack that costs G0 reaches the strength. With a smaller horizon the crack starts earlier, runs
faster and branches elsewhere.
"""

from pdmesh import Material, Run, Scene, box

spacing = 0.5e-3  # m: between nodes
horizon = 3.0  # horizon over spacing
traction = 1e6  # Pa: on the upper and the lower edge
rows = 3  # of nodes that carry it
crack = 0.05  # m: length of the edge crack

glass = Material(
    E=32e9, rho=2450, G0=3, nu=0.2, model="correspondence", failure="stress", strength=3.08e6, control="silling"
)
half = 0.02 + spacing / 2  # so that rows of nodes are half a spacing off the crack

scene = (
    Scene(box(0, -half, 0.1, half), spacing, glass, horizon, Run(time_step=33e-9, steps=1820, every=91))
    .crack([(0, 0), (crack, 0)])
    .load("top", traction=(0, traction), rows=rows)
    .load("bottom", traction=(0, -traction), rows=rows)
)
