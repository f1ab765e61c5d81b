"""What is refused, what is warned of, and what is not."""

from __future__ import annotations

import dataclasses
from functools import partial
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from failure_cases import saying
from messages import mentions, naming
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid, two_scale_grid

from pdmesh.model.document import Lattice, Region, Run
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.node_grid import Grid, whole_lattice
from pdsolve.checks import closing, nearest, refuse_numbers, warn_of_missing_dissipation, warn_of_model
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.accounts import EnergyAccounts
from pdsolve.run.motion_checks import (
    InversionAndPrecisionChecks,
    compute_displacement_range,
    warn_if_plastic_strain_is_large,
)
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.run.system import PreparedRun
from pdsolve.state import Broken


def bonds(model: Model) -> np.ndarray:
    """Twelve bonds for each node."""
    return np.full(len(model.grid), 12)


@pytest.mark.parametrize("grid", [square_grid(9, 8), two_scale_grid(), square_grid(9, 8, 1e-9), square_grid(9, 8, 1e3)])
def test_plates_that_are_plates_are_not_spoken_of(grid: object) -> None:
    model = plate(grid)  # type: ignore[arg-type]
    with saying() as lines:
        refuse_numbers(model, True)
        warn_of_model(model, np.flatnonzero(bonds(model) == 0), True, True)
    assert lines == []


def lonely() -> Grid:
    """A lattice, two nodes all but at one place, and two far from all others."""
    grid = square_grid(12, 9)
    far = np.concatenate([grid.position, [[30e-3, 0.0], [30e-3, 1e-12], [50e-3, 5e-3], [57e-3, 5e-3]]])
    return Grid(
        np.arange(len(far)),
        far,
        np.full(len(far), 1e-3),
        np.zeros(len(far), bool),
        np.full(len(far), -1),
        np.empty((0, 4)),
    )


def test_the_nearest_in_a_lattice_are_a_spacing_away() -> None:
    grid = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 4, 3, 2), cracks=np.zeros((0, 9)))
    found = nearest(plate(grid))
    apart = np.sqrt(((grid.position[found.row] - grid.position) ** 2).sum(axis=1))
    assert apart == pytest.approx(1e-3, rel=1e-12)
    assert found.distance == pytest.approx(1e-3, rel=1e-12)


@pytest.mark.parametrize("grid", [square_grid(9, 8), two_scale_grid(), lonely(), square_grid(1, 1)])
def test_the_nearest_are_those_of_all_distances(grid: Grid) -> None:
    found = nearest(plate(grid))
    apart = np.hypot(*(grid.position[:, None] - grid.position[None]).T)
    np.fill_diagonal(apart, np.inf)
    assert found.distance == pytest.approx(apart.min(axis=1), rel=1e-12)
    assert apart[np.arange(len(grid)), found.row] == pytest.approx(found.distance, rel=1e-12)


def test_a_crack_between_nodes_is_not_spoken_of_and_one_through_them_is() -> None:
    cracks = np.array([[0.0, 3.5e-3, 4e-3, 3.5e-3], [5e-3, 1e-3, 5e-3, 2.5e-3]])
    model = plate(dataclasses.replace(square_grid(9, 8), cracks=cracks))
    with saying() as lines:
        warn_of_model(model, np.flatnonzero(bonds(model) == 0), True, True)
    assert len(lines) == 1
    assert mentions(lines[0], "$.notch[1]", found=("2 nodes", "node 15", "(0.005, 0.001) m"))


@pytest.mark.parametrize("E", [1e-40, 0.0, -1.0])
def test_the_material_of_a_region_is_named(E: float) -> None:
    """Numbers of models made in Python are checked as those of files are."""
    region = Region(box=(0.0, 0.0, 1.0, 1e-3), material=msgspec.structs.replace(GLASS, E=E))
    expected = ("1e-30", "1e+30")
    with pytest.raises(ModelError, match=naming("$.regions[0].material.E", found=f"{E:g}", expected=expected)):
        prepare(plate(square_grid(9, 8), regions=(region,)), Options(threads=1))


def test_a_probe_off_the_plate_is_refused() -> None:
    model = plate(square_grid(9, 8), run=Run(steps=1, probes=((0.004, 0.003), (0.02, 0.0))))
    with pytest.raises(ModelError, match=naming("$.run.probes[1]", found="(0.02, 0) m", expected="node 9")):
        simulate(model)


def moved(matrix: list[list[float]], away: float = 0.0, kind: str = "float64") -> PreparedRun:
    """A plate whose nodes are where this matrix brings them, and so far away."""
    problem = prepare(plate(square_grid(9, 8)), Options(precision=kind, threads=1))
    x = problem.system.model.grid.position
    problem.state.value[:] = x @ np.array(matrix).T - x + away
    return problem


def look_at(watch: InversionAndPrecisionChecks, u: NDArray[np.floating], broken: Broken, step: int) -> None:
    """Warn of displacements (n, d), m, as a run does."""
    extent = compute_displacement_range(u)
    if watch.triangles_may_be_inverted(extent) and (text := watch.describe_inverted_triangle(u, broken)) is not None:
        watch.warn_of_inverted_triangle(text, step)
    watch.warn_of_imprecise_displacements(extent, step)


def seen(problem: PreparedRun, looks: int = 2) -> list[str]:
    """What a watch says of that, looking so many times."""
    operator = problem.system.operator
    watch = InversionAndPrecisionChecks(problem.system.model, partial(operator.bonds, at_start=True))
    with saying() as lines:
        for step in range(looks):
            look_at(watch, problem.state.value, operator.broken(), step)
    return lines


@pytest.mark.parametrize("turn", [0.1, 1.6, 3.1, 4.0])
def test_a_plate_that_turns_is_not_crushed(turn: float) -> None:
    c, s = np.cos(turn), np.sin(turn)
    assert seen(moved([[c, -s], [s, c]], away=0.1)) == []


def test_a_plate_turned_inside_out_is_told_once() -> None:
    problem = moved([[-0.1, 0.0], [0.0, 1.0]])
    (line,) = seen(problem)
    assert mentions(line, "step 0", found=("triangle", "inside out"))
    assert seen(moved([[0.1, 0.0], [0.0, 1.0]])) == []
    source, target = problem.system.operator.bonds()
    gone = Broken(np.ones_like(source), source, target)
    problem.system.operator.restore(problem.system.operator.checkpoint_arrays(), gone)
    assert seen(problem) == []


def test_digits_that_do_not_suffice_are_told_once() -> None:
    (line,) = seen(moved([[1.0, 0.0], [0.0, 1.0]], away=0.1, kind="float32"))
    assert mentions(line, "step 0", found=("0.1 m", "float32", "1.2e-08 m"))
    assert seen(moved([[1.0, 0.0], [0.0, 1.0]], away=0.01, kind="float32")) == []
    assert seen(moved([[1.0, 0.0], [0.0, 1.0]], away=100.0)) == []


@pytest.mark.parametrize(
    ("balance", "spent", "symmetric", "told"),
    [(0.09, 1.0, True, 0), (-0.11, 1.0, True, 1), (-0.4, 1.0, False, 0), (0.0, -1.0, False, 1), (9.0, -1.0, True, 2)],
)
def test_energy_that_does_not_add_up(balance: float, spent: float, symmetric: bool, told: int) -> None:
    with saying() as lines:
        closing(plate(square_grid(9, 8)), balance, spent, symmetric)
    assert len(lines) == told


@pytest.mark.parametrize(("created", "told"), [(0.19, 0), (0.21, 1), (-0.5, 0)])
def test_bonds_that_take_too_little_are_said(created: float, told: int) -> None:
    """Of 1 J/m that is booked; of more, the error of the balance is small beside what was put in."""
    for put_in, count in ((5.0, told), (500.0, 0)):
        with saying() as lines:
            warn_of_missing_dissipation(plate(square_grid(9, 8)), created, put_in, 1.0)
        assert len(lines) == count


def test_bonds_are_not_blamed_for_energy_that_contact_or_a_zone_may_have_made() -> None:
    for changes in ({"contact": Contact()}, {"run": Run(adapt="hybrid")}, {}):
        model = plate(square_grid(9, 8))
        model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, **changes))
        with saying() as lines:
            warn_of_missing_dissipation(model, 0.3, 5.0, 1.0)
        assert len(lines) == (not changes)


@pytest.mark.parametrize(("changed", "symmetric", "told"), [(False, True, 1), (True, True, 0), (False, False, 0)])
def test_a_run_says_that_its_bonds_took_too_little(changed: bool, symmetric: bool, told: int) -> None:
    """Where the balance is that of the bonds alone: of 1 J/m that is booked, motion has lost 0.7."""
    accounts, scheme = object.__new__(EnergyAccounts), SimpleNamespace(symmetric=symmetric, name="conservative")
    system = SimpleNamespace(model=plate(square_grid(9, 8)), scheme=scheme, initial_energy=0.0)
    nothing = dict.fromkeys(("damped", "friction", "refinement"), 0.0)
    last = SimpleNamespace(dissipated=1.0, work=1.0, balance_error=lambda *_: 0.3, **nothing)
    accounts.__dict__.update(_system=system, last=last, _largest_work=0.0, _heat_energy=0.0, _nodes_changed=changed)
    with saying() as lines:
        accounts.warn_at_end()
    assert len([line for line in lines if "took 0.70 of their energy" in line]) == told


@pytest.mark.parametrize(
    ("strain", "told"),  # xx, yy, zz, xy, yz, xz
    [
        ((0.099, -0.0495, -0.0495, 0.0, 0.0, 0.0), False),
        ((0.101, -0.0505, -0.0505, 0.0, 0.0, 0.0), True),
        ((0.0, 0.0, 0.0, 0.085, 0.0, 0.0), False),
        ((0.0, 0.0, 0.0, 0.088, 0.0, 0.0), True),
    ],
)
def test_the_equivalent_plastic_strain_is_warned_of_above_a_tenth(strain: tuple[float, ...], told: bool) -> None:
    """In tension it is the strain itself, in shear 2 / sqrt(3) of that of the tensor."""
    solid = SimpleNamespace(history=np.array([6 * [0.0] + [0.0], [*strain, 0.0]]))
    system = SimpleNamespace(
        model=plate(square_grid(2, 1)), operator=SimpleNamespace(columns=SimpleNamespace(solid=solid))
    )
    with saying() as lines:
        assert warn_if_plastic_strain_is_large(system, 3) == told  # type: ignore[arg-type]
    assert len(lines) == told


def test_a_node_that_passes_another_is_seen_on_lattices_with_and_without_gaps() -> None:
    """In rows of a lattice, coarse on the right, and in no order, which the tree of nodes is for."""
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(13), np.arange(9)))
    kept = (column <= 6) | ((column % 2 == 0) & (row % 2 == 0))
    place = np.column_stack([column, row])[kept]
    mixed = np.random.default_rng(1).permutation(len(place))
    for order in (np.arange(len(place)), mixed):
        grid = dataclasses.replace(square_grid(len(place), 1), position=1e-3 * place[order], areas=None)
        model, (target, source) = plate(grid), np.indices(2 * (len(place),)).reshape(2, -1)[::-1]
        for x, y in ((3, 3), (6, 4), (10, 4), (12, 8)):
            u = np.zeros((len(place), 2))
            u[(place[order] == (x, y)).all(axis=1), 0] = -2.5e-3
            watch = InversionAndPrecisionChecks(model, partial(lambda ends, first, last: ends, (source, target)))
            with saying() as lines:
                look_at(watch, u, Broken(*np.zeros((3, 0), dtype=np.int64)), 1)
            assert len(lines) == 1, (x, y)
