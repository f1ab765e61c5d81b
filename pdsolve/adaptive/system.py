"""A model, prepared to be marched with a fine zone that moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve import conditions
from pdsolve.adaptive.arrays import TIPS, VALUE, Entries, Ground, Zone, ground_of, zone_of
from pdsolve.adaptive.family import fine_springs
from pdsolve.adaptive.hybrid import Hybrid
from pdsolve.adaptive.lattice import AROUND, COARSE, FINE
from pdsolve.adaptive.plate import Plate, plate_of
from pdsolve.adaptive.precracks import begin_bits, begin_coarse, begin_lack, lengthened, stiffest
from pdsolve.conditions import Drive, drive, initial_velocity, unbreakable
from pdsolve.model import Model
from pdsolve.state import State

ROOM = 64  # rows of fine nodes beyond those of the start, at least


def hybrid_of(
    model: Model, mode: str, precision: str, step_of: Callable[[Model, float], float]
) -> tuple[Hybrid, State, float]:
    """The run, its state and the surely stable step, s; `step_of` chooses the step.

    Raises ModelError for what cannot be solved so.
    """
    plate = plate_of(model, mode, precision)
    material = model.settings.material
    assert material is not None
    springs = fine_springs(material, model.settings.horizon.ratio, plate.h)
    ground = ground_of(plate.at, springs, plate.h, material.rho, 0.0)._replace(cracks=lengthened(plate.cracks))
    bits = np.zeros(plate.at.places, dtype=np.uint64)
    begin_bits(ground, bits)
    begin_coarse(ground)
    begin_lack(ground, bits)
    ground.lasting[plate.place] = unbreakable(model)
    most = stiffest(ground, bits)
    bound = float(np.sqrt(2 * material.rho * plate.h**2 / most))
    ground = ground._replace(dt=step_of(model, bound))
    area = areas_of(plate)
    driven = drive(model, area, True, np.float64)
    zone = _zone(plate, ground)._replace(
        bits=bits, loads=_loads(plate, driven, area), holds=_entries(plate, driven.holds, 1)
    )
    stiffness = np.full(len(model.grid), most / plate.h**2)
    hybrid, nodes = Hybrid(plate, ground, zone, driven, stiffness), len(model.grid)
    hybrid.start(initial_velocity(model))
    state = State(np.zeros((nodes, 2)), np.zeros((nodes, 2)), np.zeros((nodes, 2)), np.zeros(nodes), np.zeros(nodes))
    hybrid.energies(state)
    return hybrid, state, bound


def areas_of(plate: Plate) -> NDArray[np.float64]:
    """Areas (n,) of the fine lattice's nodes, m^2: halves on edges."""
    row, column = np.divmod(plate.place, plate.at.stride)
    ends = [np.isin(index - index.min(), (0, np.ptp(index))) for index in (row, column)]
    return np.asarray(plate.h**2 * np.where(ends[0], 0.5, 1.0) * np.where(ends[1], 0.5, 1.0))


def counts(hybrid: Hybrid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bonds (n,) of each node of the fine lattice, those that pre-cracks cut included; and without them."""
    plate, ground = hybrid.plate, hybrid.ground
    row, column = np.divmod(plate.place, plate.at.stride)
    row, column, half = row - row.min(), column - column.min(), len(ground.dx) // 2
    family, count = (np.zeros(len(row), dtype=np.int64) for _ in range(2))
    for k, (dx, dy) in enumerate(zip(ground.dx, ground.dy, strict=True)):
        family += (row + dy >= 0) & (row + dy <= plate.at.ny) & (column + dx >= 0) & (column + dx <= plate.at.nx)
        owner = plate.place if k < half else plate.place + ground.ways[k]
        count += (hybrid.zone.bits[owner] >> np.uint64(k % half)) & np.uint64(1) != 0
    return family, count


def tips_of(plate: Plate) -> NDArray[np.float64]:
    """Ends (k, 2) of pre-cracks that lie inside the plate and on no other segment, in spacings."""
    ends = plate.cracks.reshape(-1, 2)
    inner = ((ends > 1e-6) & (ends < np.array([plate.at.nx, plate.at.ny]) - 1e-6)).all(axis=1)
    alone = np.array([np.sum(np.abs(ends - end).max(axis=1) < 1e-6) == 1 for end in ends], dtype=bool)
    return ends[inner & alone]


def _zone(plate: Plate, ground: Ground) -> Zone:
    """Fine around the tips of pre-cracks, with room for more."""
    at = plate.at
    cells = np.arange(at.cells)
    x, y = cells % at.cell_stride - AROUND, cells // at.cell_stride - AROUND
    near = np.zeros(at.cells, dtype=bool)
    for tip_x, tip_y in tips_of(plate):
        away = np.maximum(np.abs(np.array([tip_x - 2 * x - 1, tip_y - 2 * y - 1])) - 1, 0)
        near |= np.hypot(*away) < TIPS
    zone = zone_of(at, len(ground.ways), ROOM + 6 * int(near.sum()))
    zone.cells[near & (zone.cells == COARSE)] = FINE
    return zone


def _loads(plate: Plate, driven: Drive, area: NDArray[np.float64]) -> Entries:
    found = _entries(plate, driven.loads, 4)
    found.value[:, VALUE] *= area[driven.loads.node]
    some = found.value[:, VALUE] != 0
    return found._replace(what=found.what[some], value=found.value[some])


def _entries(plate: Plate, driven: conditions.Entries, most: int) -> Entries:
    """Entries, with room for `most` nodes that each acts on."""
    what = np.column_stack([plate.place[driven.node], driven.axis, driven.profile, driven.kind])
    value = np.zeros((len(what), 4))
    value[:, VALUE] = driven.value
    return Entries(what, value, np.zeros((most * len(what), 2), dtype=np.int64), np.zeros(most * len(what)))
