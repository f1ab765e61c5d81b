"""Bonds of a law of one's own at rest: in load steps, and along a path where they soften."""

from __future__ import annotations

import dataclasses
from typing import Literal

import msgspec
import numpy as np
import pytest
from curved_law import LAW as CURVED
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Run, Static
from pdsolve.laws import LAWS, law_of
from pdsolve.laws.law import Limits, Pair, Sizes, Softening
from pdsolve.laws.pair import PairColumns, pair_law
from pdsolve.laws.pair_laws import bilinear
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.run.simulation import Options, simulate
from pdsolve.schemes import SCHEMES

ONE = Options(threads=1, kernel="listed")
RAMP = ((0.0, 0.0), (1.0, 1.0))
GLASS = Material(E=65e9, rho=2235, G0=204)


class Saturating(PairColumns):
    """Columns of bonds whose force grows less and less up to their limit, as on the page of laws of one's own."""


def limits(material: Material, bonds: Sizes) -> Limits:
    limit = bonds.critical * np.sqrt((np.sqrt(1 + material.kr**2) + 1) / 2)
    return Limits(limit / material.kr, limit)


def secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    share = stretch / peak
    return 1 / np.sqrt(1 + share * share)


def bond_strain_energy(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    share = stretch / peak
    return 2 * c * stretch * stretch / (np.sqrt(1 + share * share) + 1)


SATURATING = pair_law(Saturating, Pair(limits=limits, secant=secant, bond_strain_energy=bond_strain_energy))


def own_bilinear_secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return peak * (limit - worst) / ((limit - peak) * worst)


OWN_BILINEAR = pair_law(  # with the columns of the built-in law, whose kernels are compiled
    bilinear.BilinearColumns,
    Pair(
        limits=bilinear.limits,
        secant=own_bilinear_secant,
        softening=Softening(
            bilinear.dissipated_energy, bilinear.total_dissipated_energy, lambda law, worst, p, s0: -p / (s0 - p)
        ),
    ),
)


def notched_plate(law: str, kr: float, stretch: float) -> Model:
    """20 x 10 nodes with a crack from their left edge, pulled apart."""
    grid = square_grid(20, 10, 1e-3, x0=5e-4, y0=-4.5e-3)
    grid.cracks.resize((1, 4), refcheck=False)
    grid.cracks[0] = -1e-3, 0, 6e-3, 0
    y = grid.position[:, 1]
    ends = [tuple((np.flatnonzero(side * y > 4e-3) + 1).tolist()) for side in (-1, 1)]
    conditions = (
        Displacement(nodes=ends[0], x=0.0, y=0.0),
        Displacement(nodes=ends[1], x=0.0, y=stretch * 9e-3, profile=RAMP),
    )
    run = Run(solver="static", static=Static(load_steps=10))
    return plate(grid, material=Material(E=65e9, rho=2235, G0=204, law=law, kr=kr), conditions=conditions, run=run)


@pytest.mark.slow
def test_an_own_law_softens_as_the_built_in_one_of_its_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(LAWS, "mine", OWN_BILINEAR)
    paths = []
    for law in ("bilinear", "mine"):
        with simulate(notched_plate(law, 3.0, 4e-3), None, ONE) as results:
            paths.append(np.array([[s["factor"], s["pull"], s["spent"]] for s in results.summary()["path_steps"]]))
    assert len(paths[0]) > 5
    assert paths[0][-1, 2] > 0
    assert np.allclose(paths[1], paths[0], rtol=1e-9, atol=0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*in one row:pdsolve.model.ModelWarning")
def test_a_bar_of_an_own_law_stretches_as_its_formula_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its end is loaded up to 0.9 of what its bonds can bear: k s / sqrt(1 + (s / s_p)^2) = b, s = b / k / sqrt(1 -
    (b / (k s_p))^2)."""
    monkeypatch.setitem(LAWS, "mine", SATURATING)
    material = Material(E=65e9, rho=2235, G0=204, law="mine", kr=4)
    held = tuple(Displacement(nodes=n, breakable=True, **at) for n, at in (((1,), {"x": 0.0}), ((1, 2, 3), {"y": 0.0})))
    run = Run(solver="static", static=Static(tolerance=1e-12))

    def bar(force_density: float) -> Model:
        load = Load(nodes=(3,), body_force=(force_density, 0.0), breakable=True)
        return plate(square_grid(3, 1), 1.5, material=material, conditions=(*held, load), run=run)

    bonds = SCHEMES["conservative"].fill(bar(1.0)).whole().bonds
    last = int(np.flatnonzero(bonds.source == 2)[0])
    k, peak = float(bonds.stiffness[last]), float(bonds.peak[last])
    for share in (0.3, 0.6, 0.9):
        with simulate(bar(share * k * peak), None, ONE) as results:
            u = results.field("ux", 1)
            assert results.summary()["broken_bonds"] == 0
        assert (u[2] - u[1]) / 1e-3 == pytest.approx(
            share * peak / np.sqrt(1 - share**2), rel=3e-7
        )  # written as float32


@pytest.mark.slow
def test_bonds_of_an_own_law_break_at_their_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work is what bonds store, what they had when they broke and what the body then releases: computed one by one."""
    monkeypatch.setitem(LAWS, "mine", SATURATING)
    with (
        pytest.warns(ModelWarning, match="jumped"),
        simulate(notched_plate("mine", 2.0, 3e-3), None, ONE) as results,
    ):
        history, said = results.history(), results.summary()
    assert said["broken_bonds"] > 20
    missing = history["strain"] + history["dissipated"] + history["damped"] - history["work"]
    assert np.abs(missing).max() < 1e-4 * history["work"].max()


def test_a_secant_that_depends_on_the_limit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def to_the_limit(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
        return 1 - stretch / limit / 2

    pair = Pair(limits=limits, secant=to_the_limit, bond_strain_energy=bond_strain_energy)
    monkeypatch.setitem(LAWS, "mine", pair_law(Saturating, pair))
    model = notched_plate("mine", 2.0, 1e-3)
    assert law_of(model).pair is pair
    with pytest.raises(ModelError, match="secant depends on the limit"), simulate(model, None, ONE):
        pass


def test_a_law_that_is_curved_before_it_softens_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Softening paths take bonds as straight up to their peak."""
    monkeypatch.setitem(LAWS, "mine", CURVED)
    with (
        pytest.raises(ModelError, match="curved below its peak"),
        simulate(notched_plate("mine", 2.0, 1e-3), None, ONE),
    ):
        pass


@pytest.mark.parametrize(("static", "after"), [(Static(control="arc"), "path"), (Static(load_steps=2), "motion")])
def test_a_law_that_does_not_soften_has_no_path(
    static: Static, after: Literal["path", "motion"], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(LAWS, "mine", SATURATING)
    model = notched_plate("mine", 2.0, 1e-3)
    run = msgspec.structs.replace(model.settings.run, static=static, after=after, duration=1e-6)
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with pytest.raises(ModelError, match=r"\$\.run\."), simulate(model, None, ONE):
        pass
