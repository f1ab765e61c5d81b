"""Fragments of a plate whose crack has branched, which come back from walls and collide."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from plates import shipped
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from benchmarks.balance_rows import compute_energy_balance_row
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "sizes", "along", "most"),
    [
        (1.0, [1096, 1770, 1096], [-0.29, 0.37, -0.29], 0.07),  # 0.057 of the energy is made in rubble
        (0.5, [1253, 1470, 1253], [-0.21, 0.36, -0.21], 0.03),  # 0.024
    ],
    ids=["own step", "half of it"],
)
def test_fragments_of_a_branched_crack_push_each_other_apart_as_mirror_images(
    share: float, sizes: list[int], along: list[float], most: float
) -> None:
    built = shipped("branched_fragments.py")
    step = share * prepare(Model(built.grid, built.settings), Options(threads=1)).system.time_step
    settings = replace(built.settings, run=replace(built.settings.run, time_step=step))
    system, state = both = prepare(Model(built.grid, settings), Options(threads=1))
    position, own = system.model.grid.position, system.model.grid.bodies.number == 0  # type: ignore[union-attr]
    last = int(160e-6 / system.time_step)
    both.advance(1, last)
    source, target = system.operator.bonds()
    joined = csr_array((np.ones(len(source)), (source, target)), (len(position),) * 2)
    number = connected_components(joined, directed=False)[1]
    fragments = [own & (number == k) for k in np.flatnonzero(np.bincount(number[own]) > 300)]
    lower, wedge, upper = sorted(fragments, key=lambda nodes: position[nodes, 1].mean())
    counts = [int(nodes.sum()) for nodes in (lower, wedge, upper)]
    assert counts[0] == counts[2]
    assert counts == pytest.approx(sizes, rel=0.02)
    mass = system.area * system.model.rho
    momentum = np.array([mass[nodes] @ state.rate[nodes] for nodes in (lower, wedge, upper)])
    speed = momentum / [[mass[nodes].sum()] for nodes in (lower, wedge, upper)]
    assert speed[:, 0] == pytest.approx(along, abs=0.02)  # pushed apart
    assert speed[2] == pytest.approx(speed[0] * [1, -1], abs=1e-6)
    assert abs(momentum[:, 0].sum()) < 0.06 * momentum[1, 0]  # .022: the rest is with the rubble
    entry = compute_energy_balance_row(system, state, last)
    assert abs(entry.balance_error(system.initial_energy)) < most
