"""Conditions in time: what is held stays held, what is pushed is pushed by its profile, and the books balance."""

from __future__ import annotations

import itertools

import msgspec
import numpy as np
import pytest
from messages import naming
from plates import GLASS, plate, square_grid
from system_checks import bonds_of

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Absorb, Acceleration, AnyCondition, Displacement, InitialVelocity, Load, Run, Velocity
from pdsolve.conditions import ABSORBED, apply_loads, damping, drive, put_loads, unbreakable
from pdsolve.estimate import estimate_run as planned
from pdsolve.model import ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

DT = 2e-8
LEFT, RIGHT = (0.0, 0.0, 0.0, 5e-3), (9e-3, 0.0, 9e-3, 5e-3)
RAMP = ((0.0, 0.0), (40 * DT, 1.0), (60 * DT, 1.0), (80 * DT, -0.5))


def driven(*conditions: AnyCondition, time_step: float = DT) -> PreparedRun:
    """A strip of 10 x 6 nodes with these conditions."""
    return prepare(plate(square_grid(10, 6), conditions=conditions, run=Run(time_step=time_step)), Options())


def left(problem: PreparedRun) -> np.ndarray:
    """The rows of the left column."""
    return np.flatnonzero(problem.system.model.grid.position[:, 0] == 0)


def factor(step: float) -> float:
    """The ramp's factor after so many steps."""
    return float(np.interp(step * DT, *np.array(RAMP).T))


def test_a_held_displacement_follows_its_profile() -> None:
    problem = driven(Displacement(box=LEFT, x=1e-7, profile=RAMP), Displacement(box=RIGHT, x=0.0, y=0.0))
    for step in (1, 20, 41, 70, 80, 120):
        problem = driven(Displacement(box=LEFT, x=1e-7, profile=RAMP), Displacement(box=RIGHT, x=0.0, y=0.0))
        problem.advance(1, step + 1)
        assert problem.state.value[left(problem), 0] == pytest.approx(1e-7 * factor(step), abs=1e-22)
    assert np.abs(problem.state.value[left(problem), 1]).max() > 0  # free along y


def test_a_held_velocity_is_held() -> None:
    problem = driven(Velocity(box=LEFT, x=1.0))
    problem.advance(1, 31)
    assert problem.state.rate[left(problem), 0].tolist() == [1.0] * 6
    assert problem.state.value[left(problem), 0] == pytest.approx(30 * DT, rel=1e-14)


@pytest.mark.parametrize("kernel", ["blocks", "listed"])
def test_a_held_velocity_follows_its_profile(kernel: str) -> None:
    """In each step with the factor in its middle, so that the way is the integral of the profile, exactly."""
    model = plate(square_grid(10, 6), conditions=(Velocity(box=LEFT, x=2.0, profile=RAMP),), run=Run(time_step=DT))
    problem = prepare(model, Options(kernel=kernel))
    corners = np.array(RAMP)
    for first, last in itertools.pairwise((0, 1, 20, 40, 41, 60, 70, 80, 120)):
        problem.advance(first + 1, last + 1)
        time = np.union1d(corners[corners[:, 0] < last * DT, 0], [0.0, last * DT])
        way = np.trapezoid(np.interp(time, *corners.T), time)
        assert problem.state.value[left(problem), 0] == pytest.approx(2 * way, rel=1e-12, abs=1e-22)  # measured 7e-16
        assert problem.state.rate[left(problem), 0] == pytest.approx(2 * factor(last), rel=1e-12, abs=1e-12)


def test_a_pressure_pushes_against_its_area_vectors() -> None:
    """The force of each node is minus p times its vector, whatever the areas of cells are."""
    vectors = ((1e-3, 0.0), (0.0, -2e-3), (3e-3, 1e-3))
    model = plate(square_grid(10, 6), conditions=(Load(nodes=(7, 3, 5), pressure="1e9 * x", area_vectors=vectors),))
    areas = np.linspace(1e-6, 2e-6, 60)
    force = drive(model, areas, True, np.float64).force * areas[:, None]
    assert force[[6, 2, 4]] == pytest.approx(-1e9 * np.array([[6e-3], [2e-3], [4e-3]]) * np.array(vectors))
    assert not np.delete(force, [6, 2, 4], axis=0).any()


def test_an_initial_velocity_is_not() -> None:
    problem = driven(InitialVelocity(box=LEFT, x=1.0))
    assert problem.state.rate[left(problem), 0].tolist() == [1.0] * 6
    problem.advance(1, 31)
    assert problem.state.rate[left(problem), 0].max() < 0.5
    assert not unbreakable(problem.system.model).any()


def test_a_held_acceleration_is_held() -> None:
    problem = driven(Acceleration(box=LEFT, x=1e6))
    problem.advance(1, 31)
    time = 30 * DT
    assert problem.state.rate[left(problem), 0] == pytest.approx(1e6 * time, rel=1e-12)
    assert problem.state.value[left(problem), 0] == pytest.approx(1e6 * time**2 / 2, rel=1e-12)


def test_momentum_is_the_impulse_of_the_loads() -> None:
    """A free plate pushed by a profile: momentum = area * force * integral of the factor, to second order."""
    problem = driven(Load(box=LEFT, body_force=(1e9, -2e9), profile=RAMP))
    problem.advance(1, 101)
    found = compute_energy_balance_row(*problem, 100)
    time = np.linspace(0, 100 * DT, 20001)
    impulse = np.trapezoid(np.interp(time, *np.array(RAMP).T), time) * problem.system.area[left(problem)].sum()
    assert found.momentum_x == pytest.approx(1e9 * impulse, rel=1e-12)  # measured 2e-16
    assert found.momentum_y == pytest.approx(-2e9 * impulse, rel=1e-12)


@pytest.mark.parametrize(
    "conditions",
    [
        (Load(box=LEFT, body_force=(-1e9, 0.0), profile=RAMP), Displacement(box=RIGHT, x=0.0, y=0.0)),
        (Displacement(box=LEFT, x=-1e-7, profile=RAMP), Displacement(box=RIGHT, x=0.0)),
        (Velocity(box=LEFT, x=-0.2, y=0.1),),
        (Velocity(box=LEFT, x=-0.2, profile=RAMP), Velocity(box=RIGHT, x=0.1)),
        (Acceleration(box=LEFT, x=-1e5), InitialVelocity(box=RIGHT, x=0.1)),
        (InitialVelocity(box=LEFT, x=-0.2), Load(box=RIGHT, body_force=(1e9, 0.0))),
    ],
)
def test_the_books_balance_whatever_is_held(conditions: tuple[AnyCondition, ...]) -> None:
    """The work of loads and holds is all that comes in, to second order in the step; nothing breaks here."""
    missing = []
    for parts in (1, 2):
        problem = driven(*conditions, time_step=DT / parts)
        problem.advance(1, 300 * parts + 1)
        found = compute_energy_balance_row(*problem, 300 * parts)
        assert found.broken == 0
        assert found.strain > 0
        missing.append(abs(found.balance_error(problem.system.initial_energy)))
    assert missing[0] < 2e-3  # measured 5e-6 to 1.04e-3
    assert missing[0] / missing[1] > 3.5  # measured 3.97 to 4.12


def test_two_loads_add_and_the_later_hold_wins() -> None:
    push = Load(box=LEFT, body_force=(1.0, 0.0))
    problem = driven(push, push, Velocity(box=LEFT, y=1.0), Velocity(box=LEFT, y=2.0))
    assert problem.system.drive.force[left(problem), 0].tolist() == [2.0] * 6
    assert len(problem.system.drive.holds.node) == 6
    assert problem.state.rate[left(problem), 1].tolist() == [2.0] * 6


def test_bonds_of_conditioned_nodes_may_break_if_the_model_says_so() -> None:
    firm, frail = (Load(box=LEFT, body_force=(1.0, 0.0), breakable=breakable) for breakable in (False, True))
    assert np.flatnonzero(unbreakable(driven(firm).system.model)).tolist() == left(driven(firm)).tolist()
    assert not unbreakable(driven(frail).system.model).any()
    assert np.isinf(bonds_of(driven(firm)).limit).any()
    assert np.isfinite(bonds_of(driven(frail)).limit).all()


def test_profiles_must_go_forward() -> None:
    from pdsolve.model import ModelError

    with pytest.raises(ModelError, match=naming("$.conditions[0].profile", found="[1.0, 0.0]")):
        driven(Load(box=LEFT, body_force=(1.0, 0.0), profile=((1.0, 0.0), (0.0, 1.0))))
    with pytest.raises(ModelError, match=naming("$.conditions[0]", found=("x", "y"))):
        driven(Velocity(box=LEFT))


def test_a_published_poisson_ratio_that_bonds_do_not_have_warns() -> None:
    import msgspec

    from pdsolve.laws import law_of
    from pdsolve.model import ModelWarning

    with pytest.warns(ModelWarning, match=naming("nu", found=("0.2", "0.3333"))):
        law_of(plate(square_grid(3, 3), material=msgspec.structs.replace(GLASS, nu=0.2)))


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_loads_put_once_are_those_of_every_step(precision: str) -> None:
    """To the last bit, where several loads with profiles meet: a run goes on from a checkpoint with them."""
    loads = (
        Load(box=LEFT, body_force=(1e9 / 3, -2e8 / 7), profile=RAMP),
        Load(box=(0.0, 0.0, 9e-3, 0.0), body_force=(-1e8 / 3, 4e7), profile=((0.0, 1.0), (90 * DT, -2.0))),
        Load(box=LEFT, traction=(3e5 / 11, 0.0)),
    )
    model = plate(square_grid(10, 6), conditions=loads, run=Run(time_step=DT))
    once, each = (prepare(model, Options(precision=precision)).system.drive for _ in range(2))
    for time in (0.0, 13.3 * DT, 50 * DT, 71 * DT, 200 * DT):
        put_loads(once, time)
        apply_loads(each, time)
        assert np.array_equal(once.force, each.force)
    assert np.count_nonzero(once.force) > 20


def test_a_force_is_shared_by_size() -> None:
    """Of nodes of different areas, whatever the mode does with tractions."""
    grid = square_grid(10, 6, 1e-3)
    areas = np.where(grid.position[:, 1] > 2e-3, 3e-6, 1e-6)
    model = plate(grid, conditions=(Load(box=LEFT, force=(30.0, -6.0)),))
    for exact in (True, False):
        found = drive(model, areas, exact, np.float64).force
        assert (areas[:, None] * found).sum(axis=0) == pytest.approx([30, -6])
        assert np.ptp(found[found[:, 0] != 0], axis=0) == pytest.approx(0)


def test_layers_absorb_the_more_the_deeper() -> None:
    """K c / L (d / L), on top of the damping of the run; of two layers that which counts more."""
    grid = square_grid(21, 11, 1e-3)
    right, top = Absorb(box=(14.5e-3, -1.0, 1.0, 1.0)), Absorb(box=(-1.0, 7.5e-3, 1.0, 1.0))
    found = damping(plate(grid, 3, conditions=(right, top), run=Run(damping=5.0))).reshape(11, 21)
    speed = np.sqrt(1.125 * GLASS.E / GLASS.rho)
    along = ABSORBED * speed / 6e-3 * np.arange(1, 7) / 6
    assert found[0, 15:] == pytest.approx(5 + along)
    assert found[8:, 0] == pytest.approx(5 + ABSORBED * speed / 3e-3 * np.arange(1, 4) / 3)
    assert (found[:8, :15] == 5.0).all()
    assert found[8, 20] == pytest.approx(found[0, 20])
    corner = Absorb(nodes=tuple((np.flatnonzero((grid.position > [14.5e-3, 7.5e-3]).any(axis=1)) + 1).tolist()))
    shallow, deep = (
        damping(plate(grid, 3, conditions=(layer,))).reshape(11, 21)
        for layer in (msgspec.structs.replace(corner, depth=3e-3), corner)
    )
    assert shallow[8:, 0] == pytest.approx(ABSORBED * speed / 3e-3 * np.arange(1, 4) / 3)
    assert shallow.max() == pytest.approx(ABSORBED * speed / 3e-3)
    assert deep.max() == deep[10, 20] < shallow.max()
    with pytest.raises(ModelError, match=naming("$.conditions[0]", found="nodes", expected=("layer", "along"))):
        planned(plate(grid, 3, conditions=(Absorb(box=(-1.0, -1.0, 1.0, 1.0)),)))
