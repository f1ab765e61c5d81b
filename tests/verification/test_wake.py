"""Fine cells far behind crack tips that become coarse again, in a strip that is torn by its own motion."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from numpy.typing import NDArray
from plates import GLASS, STEEL, plate, square_grid
from zones import rectangle

from pdmesh.model.document import Hybrid as Settings
from pdmesh.model.document import Region, Run
from pdsolve.adaptivity.hybrid.arrays import PIECES, REGRIDS
from pdsolve.adaptivity.hybrid.engine import Hybrid
from pdsolve.adaptivity.hybrid.lattice import BORDER, COARSE, FINE
from pdsolve.model import Model, ModelError
from pdsolve.numerics.thread_team import cores
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

GRID, LATTICE = square_grid(41, 25), Run(adapt="hybrid", hybrid=Settings(wake="lattice"))
LOOKS = range(40, 441, 40)


def torn(wake: str = "lattice", threads: int = 1) -> Hybrid:
    """A free strip of glass with an edge crack, whose upper half flies up and whose lower half down."""
    grid = rectangle(160, 40, 5e-4, [(0, 19.5, 40.5, 19.5)])
    run = Run(steps=1000, adapt="hybrid", hybrid=Settings(wake=wake))
    operator = prepare(plate(grid, 4, run=run), Options(threads=threads)).system.hybrid
    assert operator is not None
    y, found = grid.position[:, 1], operator.hybrid
    assert isinstance(found, Hybrid)
    found.start(np.column_stack([np.ones(len(y)), 14 * (y / y.max() - 0.5) + 0.5]))
    return found


def energy(run: Hybrid) -> float:
    """All there is, J/m, without what changes of cells have made."""
    dissipated, _, made = run.spent
    return float(run.motion()[0] + sum(part.sum() for part in run.held())) + dissipated - made


def stretched(run: Hybrid, near: NDArray[np.bool_]) -> float:
    """The largest e of pieces and of bonds of border nodes, of owners that are `near` (places,), over that which is
    calm."""
    ground, zone, now = run.ground, run.zone, run.now
    fine, pieces, count = zone.fine, zone.pieces, int(zone.number[PIECES])
    owner, found = np.flatnonzero(near & (fine.kind == BORDER)), [0.0]
    for k, way in enumerate(ground.ways.tolist()):
        entry = fine.entry[owner // 16]
        there = (entry < 0) | (fine.own[np.maximum(entry, 0), k, owner % 16] > 0)
        eta = fine.u[now][:, owner[there] + way] - fine.u[now][:, owner[there]]
        x, y, inverse = ground.table[k, [0, 1, 4]]
        found.append((inverse * (2 * (x * eta[0] + y * eta[1]) + (eta**2).sum(axis=0))).max(initial=0.0))
    ends = []
    for which in (0, 1):
        a, b = pieces.end[:count, 2 * which], pieces.end[:count, 2 * which + 1]
        w = pieces.value[:count, which]
        between = (1 - w) * zone.coarse.u[now][:, np.where(b < 0, 0, a)] + w * zone.coarse.u[now][:, np.maximum(b, 0)]
        ends.append(np.where(b < 0, fine.u[now][:, np.where(b < 0, a, 0)], between))
    eta, (x, y) = ends[1] - ends[0], pieces.value[:count, 2:4].T
    e = pieces.value[:count, 4] * (2 * (x * eta[0] + y * eta[1]) + (eta**2).sum(axis=0))
    found.append(e[near[pieces.owner[:count]]].max(initial=0.0))
    return max(found) / ground.calm


def around(run: Hybrid, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask (places,) of fine nodes within the family's reach of cells."""
    at, found = run.plate.at, np.zeros((run.plate.at.places // run.plate.at.stride, run.plate.at.stride), dtype=bool)
    for c in cells.tolist():
        x, y = 2 * (c % at.cell_stride - 6) + 16, 2 * (c // at.cell_stride - 6) + 8
        found[y - 4 : y + 7, x - 4 : x + 7] = True
    return found.ravel()


def test_a_torn_strip_keeps_its_momentum_and_its_energy() -> None:
    """While cells become fine and coarse again; what becomes coarse is not stretched, and no bond breaks by that.

    Cells behind the tip that are stretched once more become fine again, and bonds break there.
    """
    run = torn()
    before, most, coarse, again = energy(run), 0.0, np.zeros(run.plate.at.cells, dtype=bool), 0
    for last in LOOKS:
        run.march(last - 39, last)
        cells, broken, momentum = run.zone.cells.copy(), len(run.broken().step), run.motion()[1:]
        again = max(again, int(np.count_nonzero(coarse & (cells == FINE))))
        run.march(last, last + 1)  # ends with a look
        changed = np.flatnonzero((cells == FINE) & (run.zone.cells == COARSE))
        if len(changed):
            coarse[changed], most = True, max(most, stretched(run, around(run, changed)))
            assert not around(run, changed)[run.broken().node[broken:]].any()
        assert np.abs(run.motion()[1:] / momentum - 1).max() < 1e-13  # 8e-16

    assert np.count_nonzero(coarse) > 300
    assert again > 100
    assert 0.3 < most <= 1.0
    assert energy(run) == pytest.approx(before, rel=0.02)


def test_it_goes_on_to_the_same_bits() -> None:
    """From a checkpoint between two changes, on one thread and on two."""
    whole = torn()
    whole.march(1, 221)
    assert whole.zone.number[REGRIDS] > 5
    kept = {name: values.copy() for name, values in whole.keep().items()}
    whole.march(221, 361)
    for threads in (1, 2) if cores() > 1 else (1,):
        other = torn(threads=threads)
        other.back(kept)
        other.march(221, 361)
        for name, values in whole.keep().items():
            assert np.array_equal(values, other.keep()[name]), name


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (plate(GRID, 4, material=STEEL, run=LATTICE), naming("material.law", found="bilinear", expected="brittle")),
        (plate(GRID, 2.5, run=LATTICE), naming("horizon.ratio", found="2.5", expected="3")),
        (plate(GRID, 4, regions=(Region(box=(0.0, 0.0, 1e-2, 1e-2), material=GLASS),), run=LATTICE), naming("regions")),
    ],
)
def test_what_cannot_be_coarse_again_is_refused(model: Model, words: str) -> None:
    """In one sentence that names the place."""
    with pytest.raises(ModelError, match=words) as error:
        prepare(model, Options())
    assert str(error.value).endswith("as run.hybrid.wake is lattice")
