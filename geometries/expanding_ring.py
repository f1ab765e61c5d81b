"""Every point of a glass ring has an initial velocity outwards. The ring breaks into fragments.

Source: the question is that of N. F. Mott ("Fragmentation of shell cases", Proc. R. Soc. Lond. A 189 (1947) 300-308)
and of D. E. Grady ("Local inertial effects in dynamic fragmentation", J. Appl. Phys. 53 (1982) 322-325); the ring is of
no source. 3984 nodes 0.5 mm apart, in space. Five seeds give 37 to 43 fragments, Grady 20, Mott 170. The strength of
the glass varies from sector to sector: critical stretches are `scatter` times a smallest-extreme-value variable above
1, drawn by `seed`, so that Mott's gamma is 1 / (scatter s0).
Calibrated: nothing.
"""

from math import cos, pi, sin

import numpy as np

from pdmesh import Body, Cylinder, Material, Run
from pdmesh.scene.solids import Shell

radius, wall = 0.02, 0.002  # m: of the middle of the wall, thickness and height
spacing = 5e-4  # m: between nodes
speed = 60.0  # m/s: outwards
duration = 2e-5  # s
sectors = 240  # of one velocity and one strength each
scatter = 0.05  # of the critical stretch
seed = 1

inner, outer, high = radius - wall / 2, radius + wall / 2, wall / 2
ring = Cylinder((0, 0, -high), (0, 0, high), outer) - Cylinder((0, 0, -2 * high), (0, 0, 2 * high), inner)
weakest = 1 + scatter * np.log(-np.log(1 - np.random.default_rng(int(seed)).random(int(sectors))))
classes = np.round(np.clip(weakest, 0.6, 1.2) * 50) / 50  # of few materials


def wedge(number: int) -> Shell:
    """A sector of the space around the axis, as a shell."""
    way = [2 * pi * (number + side - 0.5) / sectors for side in (0, 1)]
    ends = [(0.0, 0.0), *(tuple(2 * outer * np.array([cos(angle), sin(angle)])) for angle in way)]
    low, top = ([(x, y, z) for x, y in ends] for z in (-2 * high, 2 * high))
    sides = [(low[a], low[b], top[b], top[a]) for a, b in ((0, 1), (1, 2), (2, 0))]
    faces = [
        (low[0], low[2], low[1]),
        tuple(top),
        *((a, b, c) for a, b, c, _ in sides),
        *((a, c, d) for a, _, c, d in sides),
    ]
    area = 2 * outer**2 * sin(2 * pi / sectors)
    return Shell(np.array(faces), float(4 * high * area))


glass = {"E": 65e9, "rho": 2235, "micromodulus": "constant"}
scene = Body(ring, spacing, Material(G0=204, **glass), run=Run(duration=duration, every=20))
for number in range(int(sectors)):
    middle = 2 * pi * number / sectors
    part = wedge(number)
    scene = scene.move(part, initial_velocity=(speed * cos(middle), speed * sin(middle), 0), name=f"sector {number}")
    if classes[number] != 1:
        scene = scene.region(part, Material(G0=204 * float(classes[number]) ** 2, **glass), name=f"sector {number}")
