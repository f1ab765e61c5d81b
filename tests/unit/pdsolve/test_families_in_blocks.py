"""State-based laws in blocks against the list: the same forces, the same broken bonds, the same energies."""

from __future__ import annotations

import itertools
from typing import Any

import msgspec
import numpy as np
import pytest
from kernel_comparison import GRIDS, both, nearly, torn
from plates import GLASS, plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Material
from pdsolve.lattice.family_operator import FamilyLattice
from pdsolve.laws.bond_arrays import Now
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

SVK: dict[str, Any] = {"model": "correspondence", "solid": "svk"}
LAWS: dict[str, dict[str, Any]] = {
    "ordinary": {"model": "ordinary"},
    "ordinary by energy": {"model": "ordinary", "failure": "energy"},
    "correspondence": {"model": "correspondence"},
    "svk by energy": SVK | {"failure": "energy"},
    "svk by stress": SVK | {"failure": "stress", "strength": 2e7},
    "wan": SVK | {"control": "wan"},
    "wan by energy": SVK | {"control": "wan", "failure": "energy"},
    "rate, no control": {"model": "correspondence", "form": "rate", "control": "none", "plane": "strain"},
}

SLOW = pytest.mark.slow  # to compile


def glass(law: str) -> Material:
    """Glass of this law."""
    return msgspec.structs.replace(GLASS, **({"nu": 0.2} | LAWS[law]))


def gone(problem: PreparedRun) -> set[tuple[int, int, int]]:
    """Step and both nodes of each broken bond."""
    return set(zip(*(column.tolist() for column in problem.system.operator.broken()), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("law", [pytest.param(law, marks=SLOW if law.startswith("wan") else ()) for law in LAWS])
@pytest.mark.parametrize("name", GRIDS)
def test_steps_from_anywhere(name: str, law: str) -> None:
    """Random displacements: accelerations, broken bonds, what they spent, energies, and what frames show."""
    problems = both(plate(GRIDS[name], material=glass(law)), "conservative")
    for problem in problems:
        random = np.random.default_rng(3)
        problem.state.value[:] = 2e-7 * random.standard_normal(problem.state.value.shape)
        problem.state.rate[:] = 2.0 * random.standard_normal(problem.state.value.shape)
        problem.advance(1, 2)
        problem.advance(2, 3)
    fast, listed = problems
    assert isinstance(fast.system.operator, FamilyLattice)
    assert 0 < len(gone(listed)) < 0.95 * listed.system.directed_bond_count
    assert gone(fast) == gone(listed)
    for field in ("value", "rate", "second", "dissipated"):
        assert nearly(getattr(fast.state, field), getattr(listed.state, field), 1e-11), field  # measured 2e-14
    for found, expected in zip(*(p.system.operator.energies(p.state) for p in problems), strict=True):
        assert nearly(found, expected, 1e-11)
    shown, expected_fields = (p.system.operator.fields(p.state) for p in problems)
    assert shown.keys() == expected_fields.keys()
    for field, values in expected_fields.items():
        if field == "szz" and glass(law).plane == "stress":  # round-off
            continue
        assert nearly(shown[field], values, 1e-10), field


@pytest.mark.slow
@pytest.mark.parametrize("law", ["ordinary", "svk by stress"])
def test_a_whole_run(law: str) -> None:
    """A plate torn to pieces: the same bonds break in the same steps, and the books agree."""
    fast, listed = both(torn(GRIDS["cracked"], material=glass(law)), "conservative")
    for problem in (fast, listed):
        for first in range(1, 121, 8):
            problem.advance(first, first + 8)
    assert len(gone(listed)) > 0
    assert gone(fast) == gone(listed)
    for field in ("value", "rate", "work"):
        assert nearly(getattr(fast.state, field), getattr(listed.state, field), 1e-9), field
    assert compute_energy_balance_row(*fast, 120)[2:] == pytest.approx(
        compute_energy_balance_row(*listed, 120)[2:], rel=1e-9, abs=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("law", ["ordinary", "correspondence", "wan"])
def test_both_ends_of_a_bond_pull_alike_to_the_bit(law: str) -> None:
    """All bonds lost but one a node, the sums of whole families kept: f_ij = -f_ji."""
    problem = prepare(plate(square_grid(40, 30), material=glass(law)), Options())
    operator, state = problem.system.operator, problem.state
    assert isinstance(operator, FamilyLattice)
    state.value[:] = 1e-6 * np.random.default_rng(1).standard_normal(state.value.shape)
    now = Now(state.value, state.rate, 0, 0.0)
    between = operator._between(now)
    source, target = operator.bonds()
    free, pairs = np.ones(len(state.value), dtype=bool), []
    for i, j in np.random.default_rng(2).permutation(np.column_stack([source, target])).tolist():
        if free[i] and free[j]:
            free[[i, j]] = False
            pairs.append((i, j))
    kept = set(itertools.chain(pairs, ((j, i) for i, j in pairs)))
    ends = zip(source.tolist(), target.tolist(), strict=True)
    lost = np.array([k for k, pair in enumerate(ends) if pair not in kept])
    operator._lose(lost, np.zeros(0, dtype=np.int64))
    force = np.zeros(state.value.shape)
    operator._accumulate_bond_forces(now, between, force)
    one, other = np.array(pairs).T
    assert len(one) > 500
    assert (force[one] != 0).all()
    assert np.array_equal(force[one], -force[other])


@pytest.mark.slow
def test_slots_share_what_lanes_have_in_common() -> None:
    """Inside a lattice all bonds of a slot have the same numbers, round-off aside."""
    problem = prepare(plate(square_grid(256, 40, x0=3.7), material=glass("ordinary")), Options())
    assert isinstance(problem.system.operator, FamilyLattice)
    kind = problem.system.operator.layout.bonds.slots[:, -1]
    assert np.mean(kind >= 0) > 0.3  # measured 0.4: no row of blocks is far from both edges
