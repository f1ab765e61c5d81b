"""A strip with a crack from its left edge to a third of it, pulled apart slowly, and what the rest of the way costs."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from plates import plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, Material, Run
from pdmesh.model.material_constants import poisson
from pdsolve.options import Options
from pdsolve.run.prepare import prepare


class Torn(NamedTuple):
    """What became of a strip."""

    cost: float  # energy spent for each length of the crack, over G0
    straight: float  # share of broken bonds that cross the line of the crack
    through: float  # share of the ligament's crossing bonds that are broken
    balance: float  # of energy


def torn(material: Material, ratio: float = 3.0, columns: int = 60, rows: int = 24, over: float = 1.2) -> Torn:
    """Of `columns` x `rows` nodes 1 mm apart, whose ends are moved until the strip holds `over` times what the crack is
    to cost ahead of it."""
    delta = 1e-3
    grid = square_grid(columns, rows, delta, y0=-(rows - 1) / 2 * delta)
    notch = columns // 3 * delta - delta / 2
    grid = dataclasses.replace(grid, cracks=np.array([[-1.0, 0.0, notch, 0.0]]))
    nu = poisson(material)
    stiff = material.E / (1 - nu**2)  # clamped along the crack
    if material.plane == "strain":
        stiff = material.E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    held, free = int(np.ceil(ratio)), rows - int(np.ceil(ratio))
    opening = np.sqrt(over * 2 * material.G0 * free * delta / stiff)
    end = (rows / 2 - held) * delta
    slow = 12 * rows * delta / np.sqrt(stiff / material.rho)
    ends = tuple(
        Displacement(box=(-1.0, min(y, 1.0 * np.sign(y)), 1.0, max(y, 1.0 * np.sign(y))), y=side * opening / 2, x=0.0,
                     profile=((0.0, 0.0), (slow, 1.0)))
        for y, side in ((end, 1), (-end, -1))
    )  # fmt: skip
    model = plate(grid, ratio, material=material, conditions=ends, run=Run())
    system, state = prepare(model, Options(threads=1))
    steps = int((slow + 2.5 * columns * delta / np.sqrt(material.E / 2 / material.rho)) / system.time_step)
    system.stepper.advance(state, 1, steps)
    found, broken = compute_energy_balance_row(system, state, steps), system.operator.broken()
    y = grid.position[:, 1]
    crosses = y[broken.source] * y[broken.target] < 0
    source, target = system.operator.bonds(at_start=True)
    ligament = int((y[source] * y[target] < 0).sum())
    length = columns * delta - delta / 2 - notch
    return Torn(
        found.dissipated / (material.G0 * length),
        float(crosses.mean()) if len(crosses) else 1.0,
        float(crosses.sum() / ligament),
        found.balance_error(0.0),
    )
