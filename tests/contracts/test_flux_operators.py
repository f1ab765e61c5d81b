"""Fick's law keeps the protocol of operators, however bonds are stored, with a solid and with what is outside."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from diffusion_models import CORRODING, disc, lattice, model
from scipy.sparse.linalg import eigs

from pdmesh.model.document import Exchange
from pdmesh.model.medium import Medium, MediumRegion
from pdsolve.diffusion.operator import Fick
from pdsolve.diffusion.system import prepare
from pdsolve.model import Model
from pdsolve.state import State


class Case(NamedTuple):
    """A medium in a disc or a ball, and how its bonds are stored; `uneven`: with a crack and a second medium."""

    medium: Medium
    listed: bool
    outside: bool = False
    dimension: int = 2
    uneven: bool = False


UNIT, KINETIC = Medium(D=1.0), msgspec.structs.replace(CORRODING, dissolution="kinetic", k_diss=0.5)
CASES = {
    "lattice": Case(UNIT, False),
    "listed": Case(UNIT, True),
    "without corrections": Case(Medium(D=1.0, surface_correction=False), False),
    "open": Case(UNIT, False, True),
    "dissolving": Case(CORRODING, False, True),
    "kinetic": Case(KINETIC, True, True),
    "uneven": Case(UNIT, False, uneven=True),
    "uneven, listed": Case(UNIT, True, uneven=True),
    "space": Case(UNIT, False, dimension=3),
    "space, listed": Case(UNIT, True, dimension=3),
    "space, uneven": Case(UNIT, False, dimension=3, uneven=True),
    "space, uneven, listed": Case(UNIT, True, dimension=3, uneven=True),
}
SMOOTH = [name for name in CASES if name != "kinetic"]


CRACKS = {2: [[-9.0, 0.1, 0.5, 0.2]], 3: [[-9.0, -9.0, 0.1, 9.0, -9.0, 0.1, 0.0, 0.5, 0.2]]}


def fresh(name: str) -> tuple[Fick, State]:
    """The operator of a case, and a state of it in which nodes have anything from none to the solid's content."""
    medium, listed, outside, dimension, uneven = CASES[name]
    conditions = (Exchange(box=(-2, -2, 0, 0), coefficient=0.5, length=2.0),) if outside else ()
    cloud = lattice(0.25, 3.0 if dimension == 2 else 1.75, dimension)
    base: Model = disc(0.25, 400, medium) if medium.C_sat else model(cloud, 0.25, medium)
    far = (0.9, *[-9.0] * (dimension - 1), *[9.0] * dimension)
    media = (MediumRegion(box=far, D=0.3),) if uneven else ()
    settings = msgspec.structs.replace(base.settings, conditions=(*base.settings.conditions, *conditions), media=media)
    grid = replace(base.grid, cracks=np.array(CRACKS[dimension])) if uneven else base.grid
    system, state = prepare(Model(grid, settings), 1, listed)
    assert (system.operator.name == "listed") == listed
    state.value[:, 0] = np.random.default_rng(7).uniform(0.01, 1.0, len(state.value))
    return system.operator, state


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", CASES)
def test_rates_are_added_and_only_what_is_outside_is_booked(name: str) -> None:
    operator, state = fresh(name)
    before = State(*(one.copy() for one in state))
    out, twice = np.full((len(state.value), 1), 7.0), np.zeros((len(state.value), 1))
    operator.accumulate_force(state, out, 0, 0.25)
    operator.accumulate_force(before._replace(work=np.zeros(len(twice))), twice, 0, 0.0)
    assert out - 7.0 == pytest.approx(twice, abs=1e-13 * np.abs(twice).max())
    given = -operator.outside * operator.potential(state.value[:, 0])
    assert bool(given.any()) == CASES[name].outside
    assert state.work == pytest.approx(0.25 * given)
    for field in ("value", "rate", "dissipated", "damped"):
        assert np.array_equal(getattr(state, field), getattr(before, field))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", SMOOTH)
def test_rates_follow_from_the_potential_and_the_tangent_is_their_slope(name: str) -> None:
    """Between the kinks of the potential rates are linear: the difference of two is the tangent's, measured 4e-13."""
    operator, state = fresh(name)
    content = state.value[:, 0]
    found, other, by_potential = np.zeros((3, len(state.value), 1))
    operator.accumulate_force(state, found, 0, 0.0)
    operator.rates(operator.potential(content), by_potential[:, 0])
    assert np.array_equal(found, by_potential)
    way = 1e-3 * np.random.default_rng(8).uniform(-1, 1, len(content))
    way[operator.follows(content + way) != operator.follows(content)] = 0.0
    operator.accumulate_force(state._replace(value=state.value + way[:, None]), other, 0, 0.0)
    slope = -(operator.tangent(state) @ way)
    assert (other - found)[:, 0] == pytest.approx(slope, abs=1e-11 * np.abs(slope).max())


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", SMOOTH)
def test_the_bound_is_above_all_eigenvalues(name: str) -> None:
    operator, state = fresh(name)
    liquid = state._replace(value=np.zeros_like(state.value))
    fastest = float(abs(eigs(operator.tangent(liquid), 1, return_eigenvectors=False)[0]))
    bound = float(operator.stiffness_bound().max())
    assert fastest <= bound * (1 + 1e-9)
    assert bound < 2.5 * fastest  # measured 1.8


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", CASES)
def test_bonds_are_those_that_are_counted_both_ways(name: str) -> None:
    operator, _ = fresh(name)
    source, target = operator.bonds()
    assert np.array_equal(np.bincount(source, minlength=len(operator.count)), operator.count)
    assert (np.diff(source * len(operator.count) + target) > 0).all()
    assert set(zip(source, target, strict=True)) == set(zip(target, source, strict=True))
    some = [column[(source >= 5) & (source < 9)] for column in (source, target)]
    for found, expected in zip(operator.bonds(5, 9), some, strict=True):
        assert np.array_equal(found, expected)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", CASES)
def test_what_is_kept_goes_on_alike(name: str) -> None:
    """To the same bits; a kinetic solid that has once been liquid stays so."""
    operator, state = fresh(name)
    once, again, other = np.zeros((3, len(state.value), 1))
    operator.accumulate_force(state, once, 0, 0.0)
    state.value[:] += 1.0
    twin, _ = fresh(name)
    twin.restore(operator.checkpoint_arrays(), operator.broken())
    operator.accumulate_force(state, again, 0, 0.0)
    twin.accumulate_force(state, other, 0, 0.0)
    assert np.array_equal(again, other)
