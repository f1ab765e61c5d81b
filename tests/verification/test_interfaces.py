"""Cracks along interfaces and cracks that meet them, beside exact values."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from plates import GLASS, shipped

from pdmesh import Material, Run, Scene, Static, box, build
from pdsolve.measures.forces import (
    force_over_gap_opening,
    read_condition_force_histories,
    read_named_gap,
    select_condition_force_histories,
)
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

ONE = Options(threads=1)


def where_it_goes(toughness: float) -> str:
    """Whether a crack that meets a vertical interface of this toughness, over that of the glass, turns or goes on."""
    scene = (
        Scene(box(0, 0, 0.048, 0.048), 1e-3, GLASS, 3.0, Run(duration=50e-6, every=10))
        .crack([(0, 0.024), (0.0235, 0.024)])
        .region(box(0.0245, 0, 0.048, 0.048), GLASS, "right")
        .interface(("right", "rest"), G0=GLASS.G0 * toughness)
        .move("top", velocity=(None, 0.5), rows=3)
        .move("bottom", velocity=(None, -0.5), rows=3)
    )
    built = build(scene)
    x, y = built.grid.position.T
    off = np.abs(y - y.mean())
    behind, beside = (x > 0.03) & (off < 0.004), (np.abs(x - 0.0245) < 1.6e-3) & (off > 0.006) & (off < 0.015)
    with simulate(Model(built.grid, built.settings), None, ONE) as results:
        for step in results.frames()[0]:
            damage = results.field("damage", int(step))
            if (damage[behind] > 0.3).sum() >= 4:
                return "goes on"
            if (damage[beside] > 0.2).sum() >= 4:
                return "turns"
    return "stays"


@pytest.mark.slow
def test_a_crack_turns_into_an_interface_weaker_than_a_quarter() -> None:
    """M.-Y. He, J. W. Hutchinson, Int. J. Solids Struct. 25 (1989) 1053-1067: below 0.26 of the toughness behind it."""
    assert [where_it_goes(toughness) for toughness in (0.1, 0.2, 0.3, 0.4)] == ["turns", "turns", "goes on", "goes on"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*passed its peak:pdsolve.model.ModelWarning")
def test_a_double_cantilever_beam_has_the_toughness_of_its_interface() -> None:
    """G = P^2 a^2 / E I with the length a of arms that have its compliance; 2.3 % low, as the faces of cracks that
    grow are not corrected, by bonds of 8 to an arm's height."""
    h, E, toughness = 3e-3, 70e9, 100.0
    spacing = h / 8
    metal = Material(E=E, rho=2700, G0=3000, law="cohesive", f_t=160e6)
    run = Run(solver="static", static=Static(load_steps=32, control="loads", opening=1.2e-3))
    scene = (
        Scene(box(0, -h, 0.064, h), spacing, metal, 3.0, run)
        .crack([(-spacing, 0), (0.03, 0)])
        .region(box(0, 0, 0.064, h), metal, "upper")
        .interface(("upper", "rest"), G0=toughness, f_t=40e6)
        .load(shapely.Point(0, h), force=(0, 6e3), name="upper")
        .load(shapely.Point(0, -h), force=(0, -6e3), name="lower")
        .fix("right", x=0, y=0)
        .gap("loads", (0, h), (0, -h))
    )
    built = build(scene)
    with simulate(Model(built.grid, built.settings), None, ONE) as results:
        forces = select_condition_force_histories(read_condition_force_histories(results), ["upper"])[0]
        curve = force_over_gap_opening(read_named_gap(results, "loads"), forces, 1)
    P, opening, bending = np.abs(curve.force[1:]), curve.opening[1:], E * h**3 / 12
    a = np.cbrt(1.5 * bending * opening / P)
    G = P**2 * a**2 / bending
    assert G[a > 0.0395].mean() == pytest.approx(toughness, rel=0.03)
    assert a[-1] == pytest.approx(0.0478, rel=0.02)


def between_regions(name: str, **assignments: str) -> float:
    """The share of a scene's broken bonds that join two regions."""
    built = shipped(name, tuple(assignments.items()))
    model = Model(built.grid, built.settings)
    with simulate(model, None, ONE) as results:
        source, target = (model.grid.rows_of(ids) for ids in results.breaks()[1:3])
        number = model.material_of
        return float((number[source] != number[target]).mean())


@pytest.mark.slow
def test_grains_part_along_their_boundaries() -> None:
    """Nearly all broken bonds join two grains where boundaries are weak; where they are as tough, few do."""
    assert between_regions("polycrystal.py") > 0.97
    assert between_regions("polycrystal.py", weak="0.9") < 0.85


@pytest.mark.slow
def test_a_weak_fibre_is_debonded() -> None:
    assert between_regions("fibre_in_matrix.py") > 0.6
    assert between_regions("fibre_in_matrix.py", weak="3.0") < 0.3
