"""Blocks in space whose halves are moved apart until all bonds between them are broken."""

from __future__ import annotations

import msgspec
import numpy as np

from pdmesh import Body, Box, Material
from pdmesh.drawing.building import meshed
from pdmesh.grid.building import build
from pdmesh.model.document import Displacement, Run
from pdmesh.model.material_constants import critical_stretch
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

H = 1e-3  # m: between nodes
FIRST, LAST, GROWTH = 0.3, 15.0, 1.01  # openings over that of the shortest bonds at their limit, and from step to step


def parted(material: Material, wide: int, layers: int) -> tuple[Results, float]:
    """A block of wide x wide nodes and so many layers, halved, and the area of the cut, m^2."""
    a, b = wide * H / 2, layers * H / 2
    found = build(meshed(Body(Box((-a, -a, -b), (a, a, b)), H, material)))
    count, dt = int(np.log(LAST / FIRST) / np.log(GROWTH)) + 1, 1e-8
    opening = LAST * float(critical_stretch(material, np.array([3 * H]))[0]) * H
    times = ((0.0, 0.0), *((dt * (k + 1), FIRST / LAST * GROWTH**k) for k in range(count)))
    halves = tuple(
        Displacement(box=(-1, -1, min(z, 0), 1, 1, max(z, 0)), x=0.0, y=0.0, z=z * opening / 2, profile=times,
                     breakable=True)
        for z in (1, -1)
    )  # fmt: skip
    run = Run(time_step=dt, steps=count, every=count)
    settings = msgspec.structs.replace(found.settings, conditions=halves, run=run)
    return simulate(Model(found.grid, settings), None, Options(threads=1)), 4 * a * a
