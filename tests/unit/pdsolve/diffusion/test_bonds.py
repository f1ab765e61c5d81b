"""Conductances and steps of lattices, beside numbers of independent codes; walls, media, sums."""

from __future__ import annotations

import dataclasses
from functools import partial

import msgspec
import numpy as np
import pytest
from diffusion_models import lattice, model, row
from dissolving_screws import screw

from pdmesh.model.document import MediumRegion
from pdmesh.model.medium import Medium
from pdmesh.model.neighbours import Pairs, chosen
from pdsolve.diffusion.families import DiffusionFamilies, lattice_diffusivity
from pdsolve.diffusion.operator import Fick
from pdsolve.diffusion.system import prepare
from pdsolve.lattice.flux_operator import FluxesInList, links_between
from pdsolve.laws.bond_arrays import Now
from pdsolve.laws.fluxes import Dissolution
from pdsolve.operators.bond_list_loops import first_pass_rows_of_sums
from pdsolve.operators.together import Together


@pytest.mark.parametrize(
    ("ratio", "dimension", "found"),
    [(3, 2, (1.057, 1.020, 0.969)), (4, 2, (1.033, 1.013, 0.983)), (3, 3, (1.104, 1.062, 1.024))],
)
def test_lattices_have_another_diffusivity_than_what_they_stand_for(
    ratio: float, dimension: int, found: tuple[float, ...]
) -> None:
    """Independent numbers, for q = 0, 1, 2; off by 5e-4 at most, which is their rounding."""
    for power, value in enumerate(found):
        assert lattice_diffusivity(ratio, dimension, power) == pytest.approx(value, abs=6e-4)


def test_a_row_of_inverse_squares_lacks_its_own_cell() -> None:
    """1 - 1 / (2 m) of the continuum, and all of it at q = 1."""
    assert lattice_diffusivity(3, 1, 2) == pytest.approx(1 - 1 / 6, rel=1e-12)
    assert lattice_diffusivity(3, 1, 1) == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(("power", "step"), [(0, 1.161), (1, 0.950), (2, 0.750)])
def test_the_step_that_is_surely_stable(power: int, step: float) -> None:
    """In spacing^2 / D, of a lattice that is not calibrated: independent numbers to three digits."""
    position = lattice(1.0, 9.0, 2)
    medium = Medium(D=1.0, power=power, surface_correction=False)  # type: ignore[arg-type]
    system, _ = prepare(model(position, 1.0, medium), 1)
    assert system.bound / lattice_diffusivity(3, 2, power) == pytest.approx(step, rel=1e-3)


def test_a_field_that_is_square_has_an_even_rate() -> None:
    """Of x^2 + 3 y^2 that is 2 (1 + 3) D, deep inside and by what a lattice has along its axes: 1e-12."""
    position = lattice(0.5, 8.0, 2)
    system, state = prepare(model(position, 0.5, Medium(D=2.0)), 1)
    x, y = position.T
    out = np.zeros(len(position))
    system.operator.rates(x**2 + 3 * y**2, out)
    inside = np.hypot(x, y) < 4
    assert out[inside] == pytest.approx(16.0, rel=1e-12)
    assert -system.operator.tangent(state) @ (x**2 + 3 * y**2) == pytest.approx(out, abs=1e-10)


def test_what_one_node_gives_another_takes() -> None:
    """Of nodes off any lattice, with cells of any size: the sum of what comes is 0 to round-off, 1e-13 of its parts."""
    dice = np.random.default_rng(2)
    position = lattice(1.0, 7.0, 2)
    position = position + dice.uniform(-0.2, 0.2, position.shape)
    base = model(position, 1.0, Medium(D=1.0))
    areas = dice.uniform(0.5, 1.5, len(position))
    system, _ = prepare(dataclasses.replace(base, grid=dataclasses.replace(base.grid, areas=areas)), 1)
    assert len(np.unique(system.operator.total)) > 100
    out = np.zeros(len(position))
    system.operator.rates(dice.uniform(0, 1, len(position)), out)
    assert abs((areas * out).sum()) < 1e-13 * np.abs(areas * out).sum()


def test_a_crack_blocks() -> None:
    """No bond crosses it: of two halves each keeps what it has, to 1e-13, while within one it evens out."""
    position = lattice(1.0, 7.0, 2)
    base = model(position, 1.0, Medium(D=1.0))
    cracks = np.array([[-9.0, 0.0, 9.0, 0.0]])
    system, state = prepare(dataclasses.replace(base, grid=dataclasses.replace(base.grid, cracks=cracks)), 1)
    upper = position[:, 1] > 0
    assert (system.blocked[np.abs(position[:, 1]) < 1] > 0).all()
    state.value[:, 0][:] = np.where(upper, 2.0 + (position[:, 0] > 0), 1.0)
    before = state.value[:, 0][upper].sum()
    system.stepper.advance(state, 1, 200)
    assert state.value[:, 0][~upper] == pytest.approx(1.0, rel=1e-13)
    assert state.value[:, 0][upper].sum() == pytest.approx(before, rel=1e-13)
    assert np.ptp(state.value[:, 0][upper]) < 0.3


@pytest.mark.slow
def test_collocation_passes_what_is_linear() -> None:
    """Across the seam of both lattices, deep inside: no rate, 1e-12 of what leaves a node; 123 nodes and 178 bonds."""
    base = screw(0.5, 80, True)
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.2, surface_correction=False)  # held nodes have what is linear, too
    base = dataclasses.replace(base, settings=msgspec.structs.replace(base.settings, medium=medium))
    system, _ = prepare(base, 1)
    operator, position = system.operator.exchange, system.model.grid.position
    C, out = 7 + position @ [1.0, -2.0, 3.0], np.zeros(len(position))
    operator.rates(C, out)
    inside = np.linalg.norm(position, axis=1) < 4.5
    assert np.abs(out[inside]).max() < 1e-11 * operator.total.max() * np.abs(C).max()
    is_coarse = system.model.grid.delta == 1.0
    assert set(operator.count[system.free & is_coarse].tolist()) == {122}
    assert len(operator._stencils.volume) > is_coarse.sum()  # type: ignore[union-attr]  # fictitious ones included
    assert len(operator._bonds.volume) > (~is_coarse).sum()  # type: ignore[union-attr]


def test_two_media_in_a_row_share_the_fall() -> None:
    """At rest the flux is the same in both: the slopes are as 4 to 1, and the flux that of two resistances in a row.

    To 2e-4 at 100 nodes of the bar (to 1.6 % where layers hold at their nodes); where they meet concentrations differ
    by 0.09 of what they do from node to node (by 0.61 with the mean of both diffusivities).
    """
    from pdmesh.model.document import Concentration, Run

    spacing, cells = 0.01, 100
    position = row(cells + 3, spacing, before=3)
    ends = Concentration(box=(-1, -1, 0, 1), value=1.0), Concentration(box=(1, -1, 2, 1), value=0.0)
    run = Run(solver="implicit", time_step=100.0, steps=5)
    parts = (MediumRegion(box=(0.5, -1, 2, 1), D=4.0),)
    system, state = prepare(model(position, spacing, Medium(D=1.0), conditions=ends, run=run, media=parts), 1)
    system.stepper.advance(state, 1, 6)
    x, C = position[:, 0], state.value[:, 0]
    lines = [np.polyfit(x[some], C[some], 1) for some in ((x > 0.1) & (x < 0.4), (x > 0.6) & (x < 0.9))]
    slope = lines[0][0]
    assert slope / lines[1][0] == pytest.approx(4.0, rel=1e-6)
    assert slope == pytest.approx(-1 / (0.5 + 0.5 / 4), rel=0.02)
    assert abs(np.polyval(lines[0] - lines[1], 0.5)) < 0.15 * abs(slope) * spacing


def test_bonds_in_two_operators_are_those_of_one() -> None:
    """Rates, tangent and bound of a cloud whose bonds are parted by the sum of their rows; measured 2e-16 of them."""
    position = lattice(1.0, 7.0, 2)
    base = model(position, 1.0, Medium(D=2.0, surface_correction=False))
    system, state = prepare(base, 1, listed=True)
    i, j = system.operator.bonds()
    pairs = Pairs(i, j, np.linalg.norm(position[j] - position[i], axis=1))
    families, parts = DiffusionFamilies(base), []
    for odd in (0, 1):
        own = chosen(pairs, (i + j) % 2 == odd)
        links = links_between(own.source, own.target, len(position))
        exchange = FluxesInList(links, families.conductance(own), system.operator.volume, 1)
        parts.append(Fick(exchange, partial(DiffusionFamilies, base), system.operator.medium))
    both = Together(*parts)
    state.value[:, 0] = np.random.default_rng(4).uniform(0, 1, len(position))
    out, other = np.zeros((2, len(position), 1))
    both.accumulate_force(state, out, 1, 0.1)
    system.operator.accumulate_force(state, other, 1, 0.1)
    assert out == pytest.approx(other, abs=1e-14 * np.abs(other).max())
    assert both.stiffness_bound() == pytest.approx(system.operator.stiffness_bound(), rel=1e-14)
    assert abs(both.tangent(state) - system.operator.tangent(state)).max() < 1e-14 * system.operator.total.max()


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("dimension", "reach", "thin"), [(2, 9.0, 9.0), (1, 40.0, 40.0), (3, 5.0, 5.0), (3, 6.0, 2.0)])
def test_slots_are_the_list(dimension: int, reach: float, thin: float) -> None:
    """Rates, totals, counts and contrast of a row, and of lattices with a hole, nodes in any order, cells of any size:
    1e-13. One that is thin along x has its tiles along another axis. Holes and edges need no bits."""
    dice = np.random.default_rng(5)
    position = lattice(1.0, reach, dimension) if dimension > 1 else row(int(reach), 1.0)
    position = position[np.abs(position[:, 0]) < thin]
    position = position[np.linalg.norm(position - 2.0, axis=1) > 1.6]
    position = dice.permutation(position)
    base = model(position, 1.0, Medium(D=1.0))
    sizes = dice.uniform(0.5, 1.0, len(position))
    base = dataclasses.replace(base, grid=dataclasses.replace(base.grid, areas=sizes))
    (system, state), (other_system, _) = (prepare(base, 2, listed=one) for one in (False, True))
    slots, listed = system.operator, other_system.operator
    assert (slots.name, listed.name) == ("lattice", "listed")
    along_x = np.array_equal(np.argsort(slots.exchange.sites.site), np.lexsort(position.T))  # type: ignore[attr-defined]
    assert along_x == (thin == reach)
    assert not slots.exchange.tiles.general.any()  # type: ignore[attr-defined]
    assert (slots.count == listed.count).all()
    assert slots.total == pytest.approx(listed.total, rel=1e-13)
    C = dice.uniform(0, 1, len(position))
    out, other = np.zeros(len(C)), np.zeros(len(C))
    slots.rates(C, out)
    listed.rates(C, other)
    assert out == pytest.approx(other, abs=1e-13 * np.abs(other).max())
    assert slots.exchange.contrast(C) == pytest.approx(listed.exchange.contrast(C), rel=1e-12)
    assert np.abs(slots.tangent(state) @ C + out).max() < 1e-12


CRACKS = {2: [[-9.0, 0.2, 2.0, 0.9]], 3: [[-9.0, -9.0, 0.2, 9.0, -9.0, 0.2, 0.0, 2.0, 0.7]]}


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("dimension", "reach"), [(2, 12.0), (3, 7.0)])
def test_slots_with_a_crack_and_two_media_are_the_list(dimension: int, reach: float) -> None:
    """Rates, counts, blocked bonds, contrast and tangent; measured 5e-15 of the largest."""
    position = lattice(1.0, reach, dimension)
    region = MediumRegion(box=(4.0, *[-99.0] * (dimension - 1), *[99.0] * dimension), D=0.2)
    base = model(position, 1.0, Medium(D=1.0), media=(region,))
    base = dataclasses.replace(base, grid=dataclasses.replace(base.grid, cracks=np.array(CRACKS[dimension])))
    (system, state), (other_system, _) = (prepare(base, 2, listed=one) for one in (False, True))
    slots, listed = system.operator, other_system.operator
    assert (slots.name, listed.name) == ("lattice", "listed")
    assert (slots.count == listed.count).all()
    assert system.blocked.sum() > 0
    assert (system.blocked == other_system.blocked).all()
    C, out, other = np.random.default_rng(5).uniform(0, 1, len(position)), *np.zeros((2, len(position)))
    slots.rates(C, out)
    listed.rates(C, other)
    assert out == pytest.approx(other, abs=1e-13 * np.abs(other).max())
    assert slots.total == pytest.approx(listed.total, rel=1e-13)
    assert slots.exchange.contrast(C) == pytest.approx(listed.exchange.contrast(C), rel=1e-12)
    assert np.abs(slots.tangent(state) @ C + out).max() < 1e-12


def test_a_bond_dissolves_into_liquid_below_saturation() -> None:
    """Rates of a row of five nodes by hand, compiled and not: solid, liquid below C_sat, liquid above it, two solid."""
    links = links_between(np.array([0, 1, 1, 2, 2, 3, 3, 4]), np.array([1, 0, 2, 1, 3, 2, 4, 3]), 5)
    law = Dissolution(np.full(8, 3.0), 0.2, 5.0)
    volume, concentration, solid = (
        np.array([1.0, 2.0, 1.0, 1.0, 2.0]),
        np.array([1.0, 0.1, 0.3, 1.0, 0.8]),
        np.array([1, 0, 0, 1, 1]),
    )
    expected = [3 * 5 * 2 * -0.9, 3 * 5 * 1 * 0.9 + 3 * 1 * 0.2, 3 * 2 * -0.2, 0.0, 0.0]
    for loop in (first_pass_rows_of_sums, first_pass_rows_of_sums.py_func):
        sums = np.empty((5, 2))
        loop(links, law, Now((volume, concentration, solid), volume, 0, 0.0), sums, np.arange(5), 0, 5)
        assert sums[:, 0] == pytest.approx(expected, rel=1e-14)
