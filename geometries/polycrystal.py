"""A plate of grains with cohesive boundaries, weaker than the grains, is pulled from the left and the right (dynamic).

Source: Voronoi cells of random seeds; cracks follow boundaries that are much weaker than the grains, as in the
deflection of a crack by an interface (He and Hutchinson, 1989).
Calibrated: nothing. Bonds have nu = 1/3.
"""

import numpy as np
import shapely

from pdmesh import Material, Run, Scene, box

spacing = 5e-5  # m: between nodes
horizon = 3.0  # horizon over spacing
size = 4e-3  # m: of the plate
grains = 24
seed = 1
weak = 0.2  # toughness and strength of boundaries over those of grains
speed = 1.0  # m/s: of the left and the right edge
duration = 4e-6  # s

grain = Material(E=370e9, rho=3900, G0=40, law="cohesive", f_t=200e6, shape="linear")
outline = box(0, 0, size, size)
seeds = shapely.MultiPoint(np.random.default_rng(seed).uniform(0, size, (grains, 2)))
cells = shapely.voronoi_polygons(seeds, extend_to=outline)

scene = Scene(outline, spacing, grain, horizon, Run(duration=duration, every=100))
for number, cell in enumerate(cells.geoms, start=1):
    scene = scene.region(cell.intersection(outline), grain, f"grain {number}")
scene = (
    scene.interface(("*", "*"), G0=weak * grain.G0, f_t=weak * grain.f_t, name="boundaries")
    .move("left", velocity=(-speed, None), rows=3)
    .move("right", velocity=(speed, None), rows=3)
)
