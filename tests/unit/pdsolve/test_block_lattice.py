"""The fast kernel against the listed one: the same forces, the same broken bonds, the same energies."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import msgspec
import numba
import numpy as np
import pytest
from kernel_comparison import GRIDS, both, cracked, nearly, torn
from messages import naming
from plates import GLASS, plate, square_grid, two_scale_grid
from system_checks import bonds_of, broken, kept, worst

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Acceleration, Displacement, Run, Velocity
from pdsolve.lattice import block_bonds
from pdsolve.lattice.block_bonds import Distinct
from pdsolve.lattice.blocks import Blocks
from pdsolve.lattice.operator import BlockLattice
from pdsolve.model import ModelError
from pdsolve.numerics import thread_team
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.progress import format_summary_lines
from pdsolve.run.recorder import list_breaks_since
from pdsolve.run.simulation import simulate
from pdsolve.run.subdomain import restore_state
from pdsolve.run.system import PreparedRun

SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)


@pytest.mark.quick_cases(13)
@pytest.mark.parametrize("law", ["brittle", "bilinear"])
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("name", GRIDS)
def test_one_step_from_anywhere(name: str, mode: str, law: str) -> None:
    """Large random displacements: accelerations, broken bonds, what breaking and softening spent, energies."""
    fast, listed = both(plate(GRIDS[name], material=SOFT if law == "bilinear" else GLASS), mode)
    for problem in (fast, listed):
        random = np.random.default_rng(3)
        problem.state.value[:] = 3e-7 * random.standard_normal(problem.state.value.shape)
        problem.state.rate[:] = 3.0 * random.standard_normal(problem.state.value.shape)
        problem.advance(1, 2)
        problem.advance(2, 3)
    assert 0 < len(broken(listed).step) < 0.9 * listed.system.directed_bond_count
    assert all(map(np.array_equal, broken(fast), broken(listed)))
    assert (worst(listed).max(initial=0.0) > 0) == (law == "bilinear")
    for field in ("value", "rate", "second", "dissipated"):
        assert nearly(getattr(fast.state, field), getattr(listed.state, field), 1e-12), field  # measured 1e-14
    if law == "bilinear":
        assert nearly(worst(fast), worst(listed), 1e-12)
    for found, expected in zip(
        fast.system.operator.energies(fast.state), listed.system.operator.energies(listed.state), strict=True
    ):
        assert nearly(found, expected, 1e-12)


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("law", ["brittle", "bilinear"])
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("name", GRIDS)
def test_a_whole_run(name: str, mode: str, law: str) -> None:
    """A plate torn to pieces: the same bonds break in the same steps, and the books agree."""
    fast, listed = both(torn(GRIDS[name], material=SOFT if law == "bilinear" else GLASS), mode)
    for problem in (fast, listed):
        for first in range(1, 121, 8):
            problem.advance(first, first + 8)
    assert len(broken(listed).step) > 0
    assert all(map(np.array_equal, broken(fast), broken(listed)))
    for field in ("value", "rate", "work"):
        assert nearly(getattr(fast.state, field), getattr(listed.state, field), 1e-10), field
    assert compute_energy_balance_row(*fast, 120)[2:] == pytest.approx(
        compute_energy_balance_row(*listed, 120)[2:], rel=1e-10, abs=1e-9
    )


def blocks_of(problem: PreparedRun) -> Blocks:
    """The arrays of the fast kernel."""
    assert isinstance(problem.system.operator, BlockLattice)
    return problem.system.operator.blocks


def stretched(problem: PreparedRun, strain: float) -> None:
    """Put the plate, at rest, under this strain along x."""
    problem.state.value[:] = 0
    problem.state.value[:, 0] = strain * problem.system.model.grid.position[:, 0]
    problem.state.rate[:], problem.state.second[:] = 0, 0


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_bonds_that_have_softened_stay_so_when_they_are_let_go(mode: str) -> None:
    """Far below the peak of the law again, and after a resume there: weaker than new, and the same to the last bit."""
    model = plate(GRIDS["two scales"], material=SOFT, run=Run(time_step=1e-12))
    fast, listed = both(model, mode)
    new, again = both(model, mode)[0], both(model, mode)[0]
    flags, of_new, of_again = (blocks_of(problem).softened for problem in (fast, new, again))
    at_rest = kept(new)
    peak = float(bonds_of(listed).peak.min())
    for problem in (fast, listed):
        stretched(problem, 1.2 * peak)
        problem.advance(1, 2)
        assert not len(broken(problem).step)
    for problem in (fast, listed, new):
        stretched(problem, 0.1 * peak)
        problem.advance(2, 3)
    assert nearly(fast.state.second, listed.state.second, 1e-11)  # measured 2e-15
    assert not nearly(fast.state.second, new.state.second, 0.05)  # measured 0.095 and 0.12
    assert nearly(fast.system.operator.energies(fast.state)[1], listed.system.operator.energies(listed.state)[1], 1e-12)
    assert fast.system.operator.energies(fast.state)[1].max() > 0
    restore_state(*again, 2, kept(fast), list_breaks_since(fast.system, 0))
    assert flags.any()
    assert np.array_equal(of_again, flags)
    for problem in (fast, again):
        problem.advance(3, 6)
    assert fast.state.second.tobytes() == again.state.second.tobytes()
    restore_state(*fast, 0, at_rest, list_breaks_since(fast.system, 0))
    assert not flags.any()
    assert not of_new.any()


def test_held_components() -> None:
    """Displacements, velocities and accelerations prescribed in time, and what holding them takes."""
    conditions = (
        Displacement(box=(0.0, 0.0, 20e-3, 1e-3), x=0.0, y=1e-6, profile=((0.0, 0.0), (1e-6, 1.0), (2e-6, -1.0))),
        Velocity(box=(0.0, 10e-3, 9e-3, 11e-3), y=2.0, profile=((0.0, 1.0), (2e-6, 0.0))),
        Acceleration(box=(15e-3, 10e-3, 20e-3, 11e-3), x=1e6),
    )
    fast, listed = both(torn(GRIDS["one scale"], conditions=conditions), "conservative")
    for problem in (fast, listed):
        problem.advance(1, 30)
        problem.advance(30, 61)
    assert np.abs(listed.state.work).max() > 0
    for field in ("value", "rate", "second", "work"):
        assert nearly(getattr(fast.state, field), getattr(listed.state, field), 1e-11), field
    assert nearly(fast.system.drive.held_force, listed.system.drive.held_force, 1e-11)


@pytest.mark.slow
def test_single_precision() -> None:
    fast, _ = both(plate(two_scale_grid()), "conservative", "float32")
    _, listed = both(plate(two_scale_grid()), "conservative")
    for problem in (fast, listed):
        problem.state.value[:] = 1e-7 * np.random.default_rng(1).standard_normal(problem.state.value.shape)
        problem.advance(1, 2)
    assert fast.state.second.dtype == np.float32
    assert nearly(fast.state.second, listed.state.second, 3e-6)  # measured 3e-7


@pytest.mark.slow
@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one core")
@pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_the_same_bits_on_two_threads_and_in_parts(precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many threads, and wherever a sequence of steps is taken apart."""
    model = torn(cracked(), material=SOFT)
    problems = []
    for threads, parts in ((1, (1, 61)), (2, (1, 61)), (2, (1, 2, 3, 20, 24, 61))):
        problem = prepare(model, Options("conservative", precision, threads))
        for first, last in itertools.pairwise(parts):
            problem.advance(first, last)
        problems.append(problem)
    monkeypatch.setattr(thread_team, "LEAST", 1)  # else energies of so few nodes are summed by one thread
    energies = [p.system.operator.energies(p.state) for p in problems]
    assert energies[0][1].max() > 0
    columns = [(*p.state, *broken(p), worst(p), *of) for p, of in zip(problems, energies, strict=True)]
    first, *others = ([column.tobytes() for column in of] for of in columns)
    assert len(broken(problems[0]).step) > 0
    assert len(worst(problems[0])) > 0
    assert all(other == first for other in others)


@pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_what_is_not_a_number_spreads(precision: str) -> None:
    """A displacement that is not a number reaches the node's neighbours, and no one else, in the next step."""
    problem = prepare(plate(square_grid(21, 12)), Options(precision=precision))
    problem.state.value[130, 0] = np.nan
    problem.advance(1, 2)
    bonds = bonds_of(problem)
    near = np.append(bonds.neighbour[bonds.start[130] : bonds.start[131]], 130)
    assert np.array_equal(np.flatnonzero(np.isnan(problem.state.second).any(axis=1)), np.sort(near))


def test_the_order_of_nodes_does_not_matter() -> None:
    grid, random = square_grid(21, 12), np.random.default_rng(0)
    shuffled = random.permutation(len(grid))
    names = ("ids", "position", "delta", "border", "hole_id")
    fast, listed = both(plate(dataclasses.replace(grid, **{n: getattr(grid, n)[shuffled] for n in names})), "thesis")
    for problem in (fast, listed):
        problem.state.value[:] = 1e-7 * np.random.default_rng(1).standard_normal(problem.state.value.shape)
        problem.advance(1, 2)
    assert nearly(fast.state.second, listed.state.second, 1e-12)


def test_nodes_without_a_lattice_are_listed() -> None:
    grid = square_grid(21, 12)
    scattered = dataclasses.replace(grid, position=grid.position + 1e-5 * np.random.default_rng(0).random((252, 2)))
    assert prepare(plate(scattered), Options()).system.operator.name == "listed"
    with pytest.raises(ModelError, match=naming("kernel", found="blocks", expected=("listed", "lattice"))):
        prepare(plate(scattered), Options(kernel="blocks"))


def test_without_a_compiler_all_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("numba.config.DISABLE_JIT", True)
    model = plate(square_grid(21, 12))
    assert prepare(model, Options()).system.operator.name == "listed"
    with pytest.raises(ModelError, match=naming("kernel", found="blocks", expected=("listed", "compiled"))):
        prepare(model, Options(kernel="blocks"))


def test_the_results_say_which_kernel() -> None:
    with simulate(torn(square_grid(9, 6), run=Run(time_step=1e-8, steps=1))) as results:
        assert results.meta()["kernel"] == results.summary()["kernel"] == "blocks"


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("name", GRIDS)
def test_bonds_are_found_by_their_ends(name: str, mode: str) -> None:
    """All bonds of the list are in the blocks, each once, and every one is found again."""
    problem = prepare(plate(GRIDS[name]), Options(mode))
    blocks = blocks_of(problem)
    bonds = bonds_of(problem)
    source = np.repeat(np.arange(len(problem.system.initial_bond_counts)), np.diff(bonds.start))
    numbers = block_bonds.find_bonds(blocks, blocks.mask, source, bonds.neighbour.astype(np.int64))
    assert np.array_equal(np.sort(numbers), block_bonds.numbers_of_bits(blocks.mask))
    for found, expected in zip(block_bonds.ends_of_bonds(blocks, numbers), (source, bonds.neighbour), strict=True):
        assert np.array_equal(found, expected)


def test_values_that_differ_by_round_off_stay_near_their_own() -> None:
    """A chain of small steps is no reason to become the next value, nor to drift further than the tolerance."""
    chain = 1 + 0.9e-11 * np.arange(40)
    values = np.random.default_rng(1).permutation(np.concatenate([chain, chain + 1, [3.0]]))
    distinct = Distinct(0.5e-11)  # 1.5e-11 of the largest
    for part in np.split(values, 3):
        number = distinct.numbers(part)
        assert np.abs(distinct.values[number] - part).max() <= 1.5e-11
    assert len(distinct.values) < 60


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize(
    ("x0", "columns", "rows", "delta"), [(10.1, 70, 40, 1e-3), (0.37, 70, 40, 1e-4), (0.0, 1500, 8, 1e-4)]
)
def test_plates_far_away_or_long(mode: str, x0: float, columns: int, rows: int, delta: float) -> None:
    """Round-off of positions makes all stiffnesses different; the blocks' are still the list's."""
    grid = square_grid(columns, rows, delta, x0=x0)
    fast, listed = both(plate(grid), mode)
    for problem in (fast, listed):
        problem.state.value[:] = 1e-6 * delta * np.random.default_rng(1).standard_normal(problem.state.value.shape)
        problem.advance(1, 2)
    assert nearly(fast.state.second, listed.state.second, 1e-11)  # measured 7e-13


def test_the_summary_says_where_bonds_are_and_what_moves_nodes(small_results: Path) -> None:
    """And of a file of an earlier release the kernel alone."""
    with Results.open(small_results) as results:
        summary = results.summary()
    assert "(blocks, fused march)" in format_summary_lines(small_results, summary)[1]
    del summary["layout"], summary["integrator"]
    assert "(blocks)" in format_summary_lines(small_results, summary)[1]
