"""What bonds spend: of every law of bonds alone a crack costs G0, and what is spent is work less what is held."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.cohesive_softening import AREA
from pdmesh.model.document import Horizon, Material, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws import LAWS, law_of, limits
from pdsolve.laws.calls import added_force, bind, broken_energy, force_over_stiffness, total_dissipated_energy
from pdsolve.laws.law import Law, Sizes
from pdsolve.laws.pair import no_bonds
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.schemes import average_horizon
from pdsolve.schemes.separation_energy import cost, patch
from pdsolve.state import State

CRITICAL, STIFFNESS = 1e-3, 2.0
RULE = np.array(np.polynomial.legendre.leggauss(12)).T.tolist()
EVERY: dict[str, dict[str, object]] = {
    f"{law}-{kr:g}": {"law": law, "kr": kr}
    for law in LAWS
    if law != "cohesive"
    for kr in ((1.0,) if law == "brittle" else (2.0, 5.0))
} | {f"cohesive-{shape}": {"law": "cohesive", "shape": shape} for shape in AREA}
every = pytest.mark.parametrize("law", EVERY)
LENGTH = 30.0  # spacings, the characteristic length of cohesive bonds
shapes = pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])


def of(law: str, G0: float) -> Material:
    given: dict[str, object] = {"E": 1.0, "rho": 1.0, "G0": G0} | EVERY[law]
    if "shape" in given:
        given["f_t"] = float(np.sqrt(G0 / LENGTH))
    return Material(**given)  # type: ignore[arg-type]


@pytest.mark.quick_cases(2)
@every
@shapes
@pytest.mark.parametrize("dimension", [2, 3])
def test_what_a_bond_spends_is_work_less_what_it_holds(law: str, precision: str, dimension: int) -> None:
    """One bond of unit length pulled until it is gone; over all a brittle one of the critical stretch spends, or what
    is below a cohesive one's curve."""
    material, one = of(law, 1e-6), np.ones(1)
    found = limits(material, Sizes(CRITICAL * one, one, 3 * one, 3.0))
    xi = np.zeros((2, dimension))
    xi[:, 0] = 1, -1
    each = np.ones(2)
    bonds = Bonds(
        np.array([0, 1, 2]), np.array([1, 0], np.int32), xi, STIFFNESS * each, *(c * each for c in found), each
    )
    model = plate(square_grid(2, 1), material=material)
    operator = BondList(law_of(model), model, bonds, True, precision)
    state = State(*np.zeros((3, 2, dimension), dtype=precision), *np.zeros((3, 2)))
    peak, limit = (float(np.dtype(precision).type(column[0])) for column in found)
    tight = 4 * float(np.finfo(precision).eps) / CRITICAL  # round-off of the length of a bond so little stretched
    work, step, places = 0.0, 0, sorted({0.0, peak, *(peak + (limit - peak) * part for part in (2 / 9, 1 / 4)), limit})

    def pulls(stretch: float) -> float:
        nonlocal step
        state.value[1, 0], step = stretch, step + 1
        out = np.zeros_like(state.value)
        operator.accumulate_force(state, out, step, 0.0)
        return float(out[0, 0])

    for low, high in itertools.pairwise(places):
        half = (high - low) / 2
        work += half * sum(weight * pulls(low + half * (1 + at)) for at, weight in RULE)
        if high < limit:
            pulls(high)
            held, spent = operator.energies(state)
            assert held.sum() + spent.sum() == pytest.approx(work, rel=tight)
    assert not len(operator.broken().step)
    pulls(limit * (1 + 4 * np.finfo(precision).eps))
    assert len(operator.broken().step) == 2
    assert operator.energies(state)[0].sum() == 0
    assert state.dissipated.sum() == pytest.approx(work, rel=tight)
    below = peak**2 / 2 + peak * (limit - peak) * AREA[material.shape]
    expected = below if material.law == "cohesive" else CRITICAL**2 / 2
    assert work == pytest.approx(STIFFNESS * expected, rel=tight)


STIFFER = """
from pdsolve.laws.pair_laws import brittle
from pdsolve.laws.law import Pair
from pdsolve.laws.pair import PairColumns, pair_law


class Stiffer(PairColumns):
    pass


def secant(law, stretch, worst, peak, limit):
    return FACTOR


def bond_strain_energy(law, c, stretch, worst, peak, limit):
    return FACTOR * c * stretch * stretch


LAW = pair_law(Stiffer, Pair(limits=brittle.limits, secant=secant, bond_strain_energy=bond_strain_energy))
"""


def stiffer(folder: Path, times: int) -> Law:
    """A law in a file of its own, whose bonds are as many times as stiff as linear ones."""
    path = folder / f"stiffer_{times}.py"
    path.write_text(STIFFER.replace("FACTOR", f"{times}.0"), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    law: Law = module.LAW
    return law


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_laws_of_the_same_columns_are_two(precision: str, tmp_path: Path) -> None:
    """In one process, whichever ran before."""
    model, pulls = plate(square_grid(4, 4), material=of("brittle-1", 1.0)), []
    bonds = average_horizon.fill(model).whole().bonds
    once, twice = stiffer(tmp_path, 1), stiffer(tmp_path, 2)
    for law in (once, twice, once):
        operator = BondList(law, model, bonds, True, precision)
        state = State(*np.zeros((3, 16, 2), dtype=precision), *np.zeros((3, 16)))
        state.value[:] = 1e-7 * model.grid.position[:, ::-1] / model.grid.position.max()
        out = np.zeros_like(state.value)
        operator.accumulate_force(state, out, 1, 0.0)
        pulls.append((out, operator.energies(state)[0]))
    for one, other, again in zip(*pulls, strict=True):
        assert np.abs(one).max() > 0
        assert np.array_equal(2 * one, other)
        assert np.array_equal(one, again)


def block(material: Material, ratio: float) -> Model:
    """A cubic lattice whose middle column no side reaches, not by the four rounds of corrections either."""
    wide = int(4 * ratio + 1)
    x, z = np.arange(-wide, wide + 1.0), np.arange(-wide, wide) + 0.5
    position = np.stack(np.meshgrid(x, x, z, indexing="ij"), axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    grid = Grid(np.arange(len(position)), position, np.ones(len(position)), nowhere >= 0, nowhere, np.zeros((0, 9)))
    return Model(grid, Settings(material=material, horizon=Horizon(ratio)))


@pytest.mark.quick_cases(1)
@every
@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_crack_costs_G0(law: str, dimension: int) -> None:
    """Halves of a lattice are moved apart: what the bonds of a node in the middle spend, over G0 and its cell."""
    material = of(law, 1e-12)
    model = patch(material, 3.0) if dimension == 2 else block(msgspec.structs.replace(material, plane="space"), 2.0)
    bonds = average_horizon.fill(model).whole().bonds
    assert cost(law_of(model), model, bonds) / material.G0 == pytest.approx(1, abs=0.01)


@every
def test_what_a_bond_pulls_once_more_makes_the_work_of_its_step_the_area_below_its_curve(law: str) -> None:
    """From `before` to `stretch`, in units of the critical stretch; Verlet takes the mean of both forces itself.

    Beyond its limit one step ago, a bond pulls no more.
    """
    material, one = of(law, 1e-6), np.ones(1)
    bond_law = law_of(plate(square_grid(2, 1), material=material))
    bind(bond_law)
    columns = no_bonds(bond_law)
    peak, limit = (float(column[0]) for column in limits(material, Sizes(CRITICAL * one, one, 3 * one, 3.0)))
    soft, kinks = (limit - peak) / 8, [peak + (limit - peak) * part for part in (2 / 9, 1 / 4)]

    def force(stretch: float, worst: float) -> float:
        """Over stiffness."""
        worst = max(worst, stretch) if max(worst, stretch) > peak else 0.0
        return float(force_over_stiffness(columns, stretch, worst, peak, limit)) if worst <= limit else 0.0

    for before, worst, stretch in (
        (-peak / 2, 0.0, 3 * limit),
        (0.3 * peak, 0.0, 1.01 * limit),
        (0.3 * peak, 0.0, peak + 3 * soft),
        (peak + soft, peak + soft, peak + 3 * soft),
        (peak / 2, peak + 5 * soft, peak + 6 * soft),
        (peak / 2, peak + 5 * soft, 2 * limit),
    ):
        if not soft and (worst or stretch <= limit):
            continue
        places = sorted({before, *(at for at in (0.0, worst, peak, *kinks, limit) if before < at < stretch), stretch})
        area = 0.0
        for low, high in itertools.pairwise(places):
            half = (high - low) / 2
            area += half * sum(weight * force(low + half * (1 + at), worst) for at, weight in RULE)
        taken = (force(before, worst) + force(stretch, worst)) / 2
        taken += added_force(columns, stretch, before, worst, peak, limit)
        assert taken * (stretch - before) == pytest.approx(area, rel=1e-9, abs=0)
        if stretch > limit:
            whole = total_dissipated_energy(columns, STIFFNESS, peak, limit)
            assert broken_energy(columns, STIFFNESS, stretch, before, peak, limit) == whole
    assert added_force(columns, 3 * limit, 2 * limit, 0.0, peak, limit) == 0
    assert added_force(columns, 1.2 * peak, 1.2 * peak, 0.0, peak, limit) == 0
