"""Steps and books of few nodes, whose numbers are known by hand: exchange, held nodes, sources, surfaces of solids."""

from __future__ import annotations

import numpy as np
import pytest
from diffusion_models import ids, lattice, model, row

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Run, Solid, Source
from pdmesh.model.medium import Medium
from pdsolve.conditions import factors_at
from pdsolve.diffusion.masses import Masses, masses
from pdsolve.diffusion.system import prepare

UNIT, PHASES = Medium(D=1.0), Medium(D=1.0, C_solid=1.0, C_sat=0.2)
EVERY, ALL = (-1.0, -1.0, 99.0, 99.0), ((0.0, 0.0), (4.0, 1.0))
BEGUN = InitialConcentration(box=EVERY, value=1.0)


@pytest.mark.parametrize(
    ("solver", "theta", "left"),
    [("explicit", 1.0, 1 - 0.05), ("implicit", 1.0, 1 / 1.05), ("implicit", 0.5, 0.975 / 1.025)],
)
def test_what_all_nodes_exchange_dies_out_alike(solver: str, theta: float, left: float) -> None:
    """0.5 m/s through 2 m of 10 m^2 takes 0.1 of it a second: two steps of 0.5 s, to round-off; the books know it."""
    out = Exchange(box=EVERY, coefficient=0.5, length=2.0)
    run = Run(solver=solver, theta=theta, time_step=0.5, steps=2)  # type: ignore[arg-type]
    system, state = prepare(model(row(10, 1.0), 1.0, UNIT, conditions=(BEGUN, out), run=run), 1)
    assert system.operator.outside == pytest.approx(0.1, rel=1e-12)
    system.stepper.advance(state, 1, 3)
    assert state.value[:, 0] == pytest.approx(left**2, rel=1e-12)
    assert float((system.operator.volume * state.work).sum()) == pytest.approx(10 * (left**2 - 1), rel=1e-12)


def test_the_bound_counts_what_is_exchanged() -> None:
    """All that leaves a node, along bonds and outward, but that of nodes that are held."""
    out = Exchange(nodes=(5,), coefficient=70.0, length=1.0), Exchange(nodes=(1,), coefficient=900.0, length=1.0)
    held = Concentration(nodes=(1,), value=0.0)
    system, _ = prepare(model(row(10, 1.0), 1.0, UNIT, conditions=(*out, held)), 1)
    assert system.bound == pytest.approx(1 / (70.0 + system.operator.total[4]), rel=1e-12)
    assert (system.operator.total[1:] < 40).all()


@pytest.mark.parametrize("solver", ["explicit", "implicit"])
def test_held_nodes_exchange_nothing_and_are_supplied_nothing(solver: str) -> None:
    """What is asked of them beside is not in the books, which balance to 1e-12."""
    asked = (
        Exchange(nodes=(1, 2, 3), coefficient=2.0, value=5.0, length=1.0),
        Source(nodes=(2, 3, 4), rate=3.0),
        Concentration(nodes=(1, 2), value=1.0, profile=ALL),
    )
    run = Run(solver=solver, time_step=0.1, steps=40)  # type: ignore[arg-type]
    system, state = prepare(model(row(12, 1.0), 1.0, UNIT, conditions=asked, run=run), 1)
    start = masses(system, state, 0, None)
    system.stepper.advance(state, 1, 41)
    now = masses(system, state, 40, start.solid)
    assert (system.operator.outside[:2] == 0).all()
    assert state.value[:, 0][:2] == pytest.approx(1.0, rel=1e-12)
    assert abs(now.balance(start)) < 1e-12
    assert now.supplied > 1
    assert now.time == pytest.approx(4.0)


@pytest.mark.parametrize("solver", ["explicit", "implicit"])
def test_a_solid_exchanges_what_is_saturated(solver: str) -> None:
    """0.5 m/s through 2 m of 10 m^2, by C_sat of 0.2 and not by the content of 1: 0.02 mol/m^3 in a second."""
    conditions = Solid(box=EVERY), Exchange(box=EVERY, coefficient=0.5, length=2.0)
    run = Run(solver=solver, time_step=0.5, steps=2)  # type: ignore[arg-type]
    system, state = prepare(model(row(10, 1.0), 1.0, PHASES, conditions=conditions, run=run), 1)
    start = masses(system, state, 0, None)
    system.stepper.advance(state, 1, 3)
    now = masses(system, state, 2, start.solid)
    assert state.value[:, 0] == pytest.approx(1 - 0.02, rel=1e-12)
    assert abs(now.balance(start)) < 1e-12  # measured 0; -8e-3 where the content itself leaves


@pytest.mark.parametrize("solver", ["explicit", "implicit"])
def test_a_source_follows_its_profile(solver: str) -> None:
    """Of 4 s from nothing to 1: two steps of 0.5 s begin at 0 and 0.5 s, or end at 0.5 and 1 s."""
    source = Source(box=EVERY, rate=2.0, profile=ALL)
    run = Run(solver=solver, time_step=0.5, steps=2)  # type: ignore[arg-type]
    system, state = prepare(model(row(5, 1.0), 1.0, UNIT, conditions=(source,), run=run), 1)
    system.stepper.advance(state, 1, 3)
    rates = [2.0 * at / 4 for at in ((0.0, 0.5) if solver == "explicit" else (0.5, 1.0))]
    assert state.value[:, 0] == pytest.approx(0.5 * sum(rates), rel=1e-12)
    assert float((system.operator.volume * state.work).sum()) == pytest.approx(5 * 0.5 * sum(rates), rel=1e-12)


def test_held_values_follow_their_profile() -> None:
    """At the end of a step they are what the profile has then, explicit and implicit."""
    held = Concentration(nodes=(1, 2), value=8.0, profile=ALL)
    for solver in ("explicit", "implicit"):
        run = Run(solver=solver, time_step=0.25, steps=4)  # type: ignore[arg-type]
        system, state = prepare(model(row(9, 1.0), 1.0, UNIT, conditions=(held,), run=run), 1)
        system.stepper.advance(state, 1, 5)
        assert state.value[:, 0][:2] == pytest.approx(2.0, rel=1e-12)
    profiles = system.drive.profiles
    assert [factors_at(profiles, time).tolist() for time in (-1.0, 1.0, 9.0)] == [[0.0], [0.25], [1.0]]


@pytest.mark.parametrize(
    ("inside", "through", "supplied", "found"),
    [(2.0, 0.5, 0.25, 0.125), (2.0, 4.0, -8.0, 1.5), (0.0, -16.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.0)],
)
def test_the_balance_is_relative_to_the_largest(inside: float, through: float, supplied: float, found: float) -> None:
    """What is there too much over what there was, was supplied or went through, whichever is most."""
    start = Masses(0, 0.0, inside, 0.0, 0.0, 0.0, 0.0, 0.0)
    now = start._replace(through=through, supplied=supplied)
    assert now.balance(start) == pytest.approx(found, rel=1e-15)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("dimension", "reach", "found"), [(2, 9.0, 0.958), (3, 7.0, 0.879)])
def test_the_surface_of_a_solid(dimension: int, reach: float, found: float) -> None:
    """Of a disc of radius 4.5 spacings and a ball of 3.5, by listed bonds and slots: less than theirs, as bonds that
    are as long as a horizon cut across what is so round; 0.994 and 0.948 at 9 and 6.5."""
    position = lattice(1.0, reach, dimension)
    radius = 0.5 * reach
    inside = np.linalg.norm(position, axis=1) < radius
    for listed in (True, False):
        solid = (Solid(nodes=ids(inside)),)
        system, state = prepare(model(position, 1.0, PHASES, conditions=solid), 1, listed=listed)
        start = masses(system, state, 0, None)
        assert start.solid == inside.sum()
        assert start.inside == inside.sum()
        whole = 2 * np.pi * radius if dimension == 2 else 4 * np.pi * radius**2
        assert start.surface == pytest.approx(found * whole, rel=0.005)


def test_phases_of_a_content() -> None:
    """By enthalpy the potential stops at C_sat, and the solid's share goes from there to C_solid."""
    content = np.array([0.1, 0.2, 0.6, 1.0, 1.2])
    system, state = prepare(model(row(5, 1.0), 1.0, PHASES), 1)
    assert system.operator.potential(content) == pytest.approx([0.1, 0.2, 0.2, 0.2, 0.2])
    share = system.operator.share(state._replace(value=content[:, None]))
    assert share == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


@pytest.mark.parametrize(("k_diss", "capped", "C"), [(0.5, True, 0.1), (0.25, True, 0.2), (0.25, False, 0.2)])
def test_bonds_of_a_kinetic_dissolution(k_diss: float, capped: bool, C: float) -> None:
    """Two nodes, solid and liquid: k_diss times what the bond would give, nothing into liquid at C_sat if capped."""
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.2, dissolution="kinetic", k_diss=k_diss, capped=capped)
    conditions = Solid(nodes=(1,)), InitialConcentration(nodes=(2,), value=C)
    system, state = prepare(model(row(2, 1.0), 1.0, medium, conditions=conditions, run=Run(time_step=1e-3)), 1)
    g = float(system.operator.total[0])
    system.stepper.advance(state, 1, 2)
    given = 0.0 if capped and C == 0.2 else 1e-3 * k_diss * g * (1.0 - C)
    assert state.value[:, 0] == pytest.approx([1.0 - given, C + given], rel=1e-12)
    assert system.operator.share(state).tolist() == [1, 0]


def test_a_kinetic_solid_is_liquid_at_C_sat() -> None:
    """A node that has fallen to just C_sat is solid no more; one above is."""
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.25, dissolution="kinetic")
    run, solid = Run(time_step=1e-3), (Solid(nodes=(1, 2)),)
    system, state = prepare(model(row(2, 1.0), 1.0, medium, conditions=solid, run=run), 1)
    state.value[:, 0][:] = 0.25, 0.5
    system.stepper.advance(state, 1, 2)
    assert system.operator.share(state).tolist() == [0, 1]


@pytest.mark.parametrize("solver", ["explicit", "implicit"])
def test_nodes_on_a_held_edge_are_inside(solver: str) -> None:
    """A steady content from 8 to 0 over a bar whose end nodes are held: its area, with the cells of both ends.

    What raises the held nodes to 8 in the first 4 s has come in through them, so that the books balance.
    """
    ends = Concentration(nodes=(1,), value=8.0, profile=ALL), Concentration(nodes=(10,), value=0.0)
    run = Run(solver=solver, time_step=0.2, steps=900)  # type: ignore[arg-type]
    system, state = prepare(model(row(10, 1.0), 1.0, UNIT, conditions=ends, run=run), 1)
    start = masses(system, state, 0, None)
    for first, last in ((1, 11), (11, 901)):
        system.stepper.advance(state, first, last)
        now = masses(system, state, last - 1, start.solid)
        assert abs(now.balance(start)) < 1e-12
    assert now.inside == pytest.approx(10 * 8.0 / 2, rel=1e-6)  # 32 without the node that holds 8
