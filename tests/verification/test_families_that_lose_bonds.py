"""Correspondence whose families lose bonds: the stable time step stays stable, and the message knows its cause."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from messages import mentions
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Load, Run
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import books
from pdsolve.run.motion_accounts import unstable_words
from pdsolve.run.operator_factory import bonded, intact_stable_step
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate


def torn(steps: int = 150, pull: float = 50e9, **settings: str) -> Model:
    """A cracked plate of glass that is pulled apart suddenly."""
    glass = msgspec.structs.replace(GLASS, nu=0.2, model="correspondence", **settings)
    grid = dataclasses.replace(square_grid(31, 16), cracks=np.array([[-1e-3, 0.0075, 0.010, 0.0075]]))
    pulls = tuple(
        Load(box=(-1.0, y - 1e-4, 1.0, y + 1e-4), body_force=(0.0, sign * pull)) for y, sign in ((0.0, -1), (0.015, 1))
    )
    return plate(grid, 3, material=glass, conditions=pulls, run=Run(steps=steps, every=steps, ledger=10))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("failure", "control", "pull"),
    [("energy", "silling", 15e9), ("stretch", "silling", 50e9), ("stretch", "wan", 50e9)],
)
def test_the_stable_step_is_stable_while_bonds_break(failure: str, control: str, pull: float) -> None:
    with simulate(torn(failure=failure, control=control, pull=pull), None, Options(threads=1)) as results:
        found = results.summary()
    assert found["broken_bonds"] > 200
    assert abs(found["balance"]) <= 0.02  # measured


@pytest.mark.slow
def test_no_family_is_stiffer_than_all_at_the_start() -> None:
    """A node with two bonds nearly in a line has no gradient; one with half of its bonds has its own."""
    system, _ = prepare(torn(), Options(threads=1))
    operator, node = bonded(system.operator), 200
    law, bonds = operator.columns, operator._bonds
    first, xi = bonds.start[node], bonds.xi[bonds.start[node] : bonds.start[node + 1]]
    for left, stands in ((xi[:, 0] > 0, True), ((xi[:, 0] > 2.5e-3) | (xi[:, 1] > 2.5e-3), False)):
        law.broken[first : first + len(xi)] = ~left
        operator.law.mend(law, operator._list, np.array([node]))
        assert law.inverse[node].any() == stands, left.sum()


@pytest.mark.slow
def test_a_step_that_became_too_long_is_said_to_be_the_cause() -> None:
    """With whole families the step is not; with stiffer ones it is."""
    system, state = prepare(torn(), Options(threads=1, kernel="listed"))
    operator, node = bonded(system.operator), 200
    entry = books(system, state, 0)
    assert intact_stable_step(system.model, operator) == pytest.approx(system.bound * np.sqrt(1.8), rel=1e-9)
    long = dataclasses.replace(system, time_step=1.34 * system.bound, bound=1.34 * system.bound)
    assert "not the cause" in unstable_words(long, entry, 1.0, node)
    operator.columns.inverse[:] *= 3  # as of families that have lost bonds
    said = unstable_words(long, entry, 1.0, node)
    assert "not the cause" not in said
    assert mentions(said, f"{intact_stable_step(system.model, operator):.4g} s", "run.time_step")
