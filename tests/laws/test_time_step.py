"""Laws of families get the time step in all their passes: a Maxwell element at each node relaxes by exp(-t / tau)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from plates import plate, square_grid

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.law import Failure, IntermediatePass, Law, NodeHistory, Passes
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.state import State, zero_state

TAU, DT, STRETCH, LIMIT = 2e-3, 1e-3, 1e-4, 0.4e-4


class MaxwellColumns(NamedTuple):
    """Columns of n nodes and b bonds."""

    broken: NDArray[np.int32]  # (b,)
    flowed: NDArray[np.float64]  # (n,) stretch that has flowed


def columns(model: Model, bonds: Bonds) -> MaxwellColumns:
    return MaxwellColumns(np.zeros(len(bonds.neighbour), np.int32), np.zeros(len(bonds.start) - 1))


def first_pass(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        m[i, 0] += bond.stretch


def finish_pass(law, now, i, m):  # type: ignore[no-untyped-def]
    m[i, 0] = (m[i, 0] - law.flowed[i]) * np.exp(-now.dt / TAU)


def intermediate_pass(law, bond, now, i, j, k, m, more):  # type: ignore[no-untyped-def]
    return None


def finish_intermediate_pass(law, now, i, m, more):  # type: ignore[no-untyped-def]
    m[i, 1] = now.dt


def accumulate_bond_force(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        f[0] += (m[i, 0] + m[j, 0]) * bond.xi[0]


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return now.dt > 0 and m[i, 0] > 0


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return law.broken[k] == 0 and m[i, 0] + m[j, 0] < 2 * LIMIT


def update_history(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    law.flowed[i] += m[i, 0] * (np.exp(now.dt / TAU) - 1)


def nodal_energy(law, now, i, m):  # type: ignore[no-untyped-def]
    return m[i, 0] ** 2, now.dt


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return 0.0, 0.0


MAXWELL = Law(
    columns_type=MaxwellColumns,
    columns=columns,
    passes=Passes(accumulate_bond_force, first_pass, finish_pass),
    energy=energy,
    width=lambda law, dimension: 2,
    scale=lambda law, bonds: np.ones(len(bonds.start) - 1),
    failure=Failure(may_fail, fails),
    again=IntermediatePass(intermediate_pass, finish_intermediate_pass),
    nodes=NodeHistory(("flowed",), update_history, nodal_energy),
)


def two_nodes() -> tuple[BondList, State]:
    """Two nodes a unit apart, pulled by `STRETCH`."""
    one = np.ones(2)
    xi = np.array([[1.0, 0.0], [-1.0, 0.0]])
    bonds = Bonds(np.array([0, 1, 2]), np.array([1, 0], np.int32), xi, one, one, one, one)
    return BondList(MAXWELL, plate(square_grid(2, 1)), bonds, True), zero_state(2, 2)._replace(
        value=np.array([[0.0, 0.0], [STRETCH, 0.0]])
    )


@pytest.mark.slow
def test_a_node_relaxes_by_the_time_step_and_breaks_when_it_is_relaxed() -> None:
    operator, state = two_nodes()
    stretches = []
    for step in range(1, 4):
        force = np.zeros((2, 2))
        operator.accumulate_force(state, force, step, DT)
        stretches.append(force[0, 0] / 2)
        if step == 1:
            assert operator.energies(state)[0] == pytest.approx(stretches[0] ** 2, rel=1e-9)
            assert not operator.energies(state)[1].any()  # the history is that of the step already
    # 0.61, 0.37: below the limit of 0.4, the bond breaks in the second step
    assert stretches == pytest.approx([STRETCH * np.exp(-DT / TAU), 0, 0], rel=1e-9, abs=1e-12)
    assert set(operator.broken().step.tolist()) == {2}


@pytest.mark.slow
def test_no_time_passes_in_quasi_static_analysis() -> None:
    operator, state = two_nodes()
    operator.update_history(state)
    force = np.zeros((2, 2))
    operator.accumulate_force(state, force, 0, 0.0)
    assert force[0, 0] == pytest.approx(2 * STRETCH, rel=1e-9)
    assert not operator.columns.flowed.any()
    assert not operator.energies(state)[1].any()
    assert not len(operator.failing(state.value))
