"""Strength and fracture energy of zones of two spacings, from the bonds of a plate pulled or parted by hand."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from pdmesh.__main__ import main as pdmesh
from pdmesh.model.document import Displacement, Load, Material, Region, Run, Velocity
from pdmesh.model.lattice_calibration import along_axes
from pdmesh.model.node_grid import Bodies, Grid
from pdmesh.model.zone_strengths import described, lines, remarks, zone_strengths
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.schemes import average_horizon, families


def two_zones(columns: int = 40, rows: int = 16) -> Grid:
    """Nodes 1 mm apart on the left, 2 mm on the right; cells fill the plate."""
    fine = square_grid(columns, rows)
    coarse = square_grid(columns // 2, rows // 2, delta=2e-3, x0=columns * 1e-3 + 0.5e-3, y0=0.5e-3)
    count = len(fine) + len(coarse)
    return dataclasses.replace(
        fine,
        ids=np.arange(1, count + 1),
        position=np.vstack([fine.position, coarse.position]),
        delta=np.concatenate([fine.delta, coarse.delta]),
        border=np.zeros(count, dtype=bool),
        hole_id=np.full(count, -1),
    )


def strengths(material: Material) -> tuple[float, float]:
    """Stress, Pa, of an even pull along x at which first bonds inside the fine and the coarse zone break."""
    model = plate(two_zones(), 3.0, material=material)
    scheme = average_horizon if material.model == "bond" else families
    bonds = scheme.fill(model).whole().bonds
    x, young = model.grid.position[:, 0], along_axes(material, 3.0)
    own = np.repeat(np.arange(len(x)), np.diff(bonds.start))
    n = bonds.xi / np.hypot(*bonds.xi.T)[:, None]
    stretch = n[:, 0] ** 2 - young.poisson * n[:, 1] ** 2  # of a unit strain along x in a long bar
    with np.errstate(divide="ignore"):
        strain = np.where(stretch > 0, bonds.limit / stretch, np.inf)
    fine, coarse = x[own] < 0.03, x[own] > 0.05
    return tuple(float(material.E * young.young * strain[where].min()) for where in (fine, coarse))


def crack_cost(material: Material, x: float) -> float:
    """Energy of a crack along y at x through all rows of the plate, over G0 times its length."""
    model = plate(two_zones(rows=40), 3.0, material=material)
    assembly = average_horizon.fill(model).whole()
    bonds, place = assembly.bonds, model.grid.position
    own = np.repeat(np.arange(len(place)), np.diff(bonds.start))
    across = (place[own, 0] < x) & (place[bonds.neighbour, 0] > x) & (np.abs(place[own, 1] - 0.02) < 0.01)
    energy = bonds.stiffness * np.hypot(*bonds.xi.T) * bonds.limit**2 / 2 * assembly.area[own]
    return float(energy[across].sum() / (material.G0 * 0.02))


@pytest.mark.parametrize(("coarse", "share"), [("own", 0.5**0.5), ("matched", 1.0), ("unbreakable", np.inf)])
def test_strength_of_a_coarse_zone(coarse: str, share: float) -> None:
    material = msgspec.structs.replace(GLASS, coarse=coarse)
    fine, wide = strengths(material)
    assert wide / fine == pytest.approx(share, rel=1e-9)
    zones = zone_strengths(two_zones(), plate(two_zones(), 3.0, material=material).settings, "conservative")
    assert [zone.share for zone in zones] == pytest.approx([1.0, share])
    assert zones[0].strength == pytest.approx(fine, rel=1e-9)
    if np.isfinite(share):
        assert zones[1].strength == pytest.approx(wide, rel=1e-9)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("failure", ["stretch", "energy"])
@pytest.mark.parametrize(("coarse", "share"), [("own", 0.5**0.5), ("matched", 1.0), ("unbreakable", np.inf)])
def test_strength_of_ordinary_bonds(failure: str, coarse: str, share: float) -> None:
    """An energy limit is per square of a cell, so that of one stretch falls with the square of the horizon."""
    material = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2, failure=failure, coarse=coarse)
    bonds = families.fill(plate(two_zones(), 3.0, material=material)).whole().bonds
    places = two_zones().position
    rows = [int(np.argmin(((places - at) ** 2).sum(axis=1))) for at in ((15e-3, 8e-3), (60e-3, 8e-3))]
    fine, wide = (float(bonds.limit[bonds.start[row]]) for row in rows)
    own_scale = 1.0 if failure == "stretch" else 0.25  # of w = E s^2 / horizon^2, per cell squared
    expected = share if failure == "stretch" else share**2
    assert wide / fine == pytest.approx(expected * own_scale, rel=1e-9)


def test_what_a_crack_costs() -> None:
    """G0 in either zone by default; matched bonds make one in the coarse zone twice as dear."""
    own, matched = GLASS, msgspec.structs.replace(GLASS, coarse="matched")
    assert crack_cost(own, 20.5e-3) == pytest.approx(1.0, abs=0.01)
    assert crack_cost(own, 61.5e-3) == pytest.approx(1.0, abs=0.01)
    assert crack_cost(matched, 20.5e-3) == crack_cost(own, 20.5e-3)
    assert crack_cost(matched, 61.5e-3) / crack_cost(own, 61.5e-3) == pytest.approx(2.0, rel=1e-9)


def test_regions_each_have_their_own_coarse_bonds() -> None:
    """Bonds of two materials, of which one does not break when wide."""
    model = two_materials()
    bonds = average_horizon.fill(model).whole().bonds
    own = np.repeat(np.arange(len(model.grid)), np.diff(bonds.start))
    wide = np.maximum(model.grid.delta[own], model.grid.delta[bonds.neighbour]) > 1e-3
    strong = (model.material_of[own] == 1) | (model.material_of[bonds.neighbour] == 1)
    assert (wide & strong).any()
    assert np.array_equal(np.isinf(bonds.limit), wide & strong)
    assert not np.isnan(bonds.peak).any()


def two_materials() -> Model:
    """The two zones, of whose upper half coarse bonds do not break."""
    upper = Region(material=msgspec.structs.replace(GLASS, G0=400.0, coarse="unbreakable"), box=(-1, 8e-3, 1, 1))
    return plate(two_zones(), 3.0, material=GLASS, regions=(upper,))


def with_a_finer_body_beside() -> Grid:
    """The two zones, and beside them a body with nodes 0.5 mm apart."""
    zones, body = two_zones(), square_grid(12, 12, delta=5e-4, x0=0.1)
    count, more = len(zones), len(body)
    return dataclasses.replace(
        zones,
        ids=np.arange(1, count + more + 1),
        position=np.vstack([zones.position, body.position]),
        delta=np.concatenate([zones.delta, body.delta]),
        border=np.zeros(count + more, dtype=bool),
        hole_id=np.full(count + more, -1),
        bodies=Bodies(np.repeat([0, 1], [count, more]), ("plate", "chip")),
    )


@pytest.mark.parametrize("model_of_bonds", [{}, {"model": "ordinary", "nu": 0.2, "failure": "stretch"}])
@pytest.mark.parametrize("coarse", ["matched", "unbreakable"])
def test_a_finer_body_beside_changes_no_strength(coarse: str, model_of_bonds: dict[str, Any]) -> None:
    """The finest zone is that of a bond's own body."""
    material = msgspec.structs.replace(GLASS, coarse=coarse, **model_of_bonds)
    fill = average_horizon.fill if material.model == "bond" else families.fill
    alone = fill(plate(two_zones(), 3.0, material=material)).whole().bonds
    beside = fill(plate(with_a_finer_body_beside(), 3.0, material=material)).whole().bonds
    assert np.array_equal(beside.limit[: len(alone.limit)], alone.limit)
    assert np.isfinite(beside.limit[len(alone.limit) :]).all()


def test_strengths_are_those_of_each_body() -> None:
    """Of its own material, over its own finest zone; a rigid body has none."""
    grid = with_a_finer_body_beside()
    chip = Region(material=msgspec.structs.replace(GLASS, G0=4 * GLASS.G0), box=(0.09, -1, 1, 1))
    settings = plate(grid, 3.0, material=GLASS, regions=(chip,)).settings
    fine, coarse, beside = zone_strengths(grid, settings, "conservative")
    assert [zone.body for zone in (fine, coarse, beside)] == ["plate", "plate", "chip"]
    assert [zone.share for zone in (fine, coarse, beside)] == pytest.approx([1.0, 0.5**0.5, 1.0])
    assert beside.strength / fine.strength == pytest.approx(2 * 2**0.5)
    load = Load(name="pull", box=(77e-3, -1, 0.09, 1), traction=(1e6, 0.0))
    (said,) = remarks(grid, msgspec.structs.replace(settings, conditions=(load,)))
    assert said.startswith("nodes of 0.002 m of body 'plate' have 0.71 of the strength of those of 0.001 m")
    rigid = dataclasses.replace(grid, bodies=grid.bodies._replace(rigid=(1,)))
    assert [zone.body for zone in zone_strengths(rigid, settings, "conservative")] == ["plate", "plate"]


def test_each_body_is_warned_of_with_its_own_weakest_zone() -> None:
    """The chip has a zone of twice its finest spacing, the plate one of four times; each is pulled alone, and both."""
    grid = with_a_finer_body_beside()
    assert grid.bodies is not None
    chip = grid.bodies.number == 1
    delta = grid.delta.copy()
    delta[chip & (grid.position[:, 0] > np.median(grid.position[chip, 0]))] *= 2
    delta[~chip & (grid.delta > 1.5e-3)] = 4e-3
    grid = dataclasses.replace(grid, delta=delta)
    words = {
        "plate": "nodes of 0.004 m of body 'plate' have 0.5 of the strength of those of 0.001 m",
        "chip": f"nodes of {delta[chip].max():g} m of body 'chip' have 0.71 of the strength of those of"
        f" {delta[chip].min():g} m",
    }
    for names in (["plate"], ["chip"], ["plate", "chip"]):
        loads = tuple(
            Load(name=f"pull {name}", nodes=tuple(grid.ids[chip == (name == "chip")].tolist()), traction=(1e6, 0.0))
            for name in names
        )
        said = list(remarks(grid, plate(grid, 3.0, material=GLASS, conditions=loads).settings))
        assert len(said) == len(names)
        for warning, name in zip(said, names, strict=True):
            assert warning.startswith(words[name])
            assert f"and 'pull {name}' acts on" in warning


def test_a_window_knows_the_finest_spacing_of_all() -> None:
    """A rank whose nodes are all coarse has the strength of the whole model's finest zone."""
    model = plate(two_zones(), 3.0, material=msgspec.structs.replace(GLASS, coarse="matched"))
    assert model.window(len(model.grid) - 100, len(model.grid)).finest_horizons == model.finest_horizons == 3e-3


def pulled_apart(coarse: str) -> Model:
    """The plate, torn along x by its ends at rates that break it in some dozens of steps."""
    ends = (
        Velocity(box=(-1, -1, 0.5e-3, 1), x=-20.0),
        Velocity(box=(77e-3, -1, 1, 1), x=20.0),
    )
    material = msgspec.structs.replace(GLASS, G0=2.0, coarse=coarse)
    return plate(two_zones(), 3.0, material=material, conditions=ends, run=Run(steps=150, every=150))


@pytest.mark.parametrize(("coarse", "warned"), [("own", True), ("matched", False), ("unbreakable", False)])
def test_a_run_says_that_bonds_broke_in_a_coarse_zone(coarse: str, warned: bool) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with simulate(pulled_apart(coarse), options=Options(threads=1)) as results:
            broken = len(results.breaks().step)
    said = [str(each.message) for each in caught if "outside the finest zone" in str(each.message)]
    assert broken > 0
    assert len(said) == warned
    if warned:
        assert "where strength is down to 0.71 of that within; the first broke at step" in said[0]


def test_building_warns_of_loads_on_coarse_zones() -> None:
    """Of loads and motions, not of supports, and not where coarse bonds are as strong."""
    right = (77e-3, -1, 1, 1)
    for condition, acts in (
        (Load(name="pull", box=right, traction=(1e6, 0.0)), True),
        (Velocity(name="hit", box=right, x=1.0), True),
        (Displacement(name="wall", box=right, x=0.0), False),
        (Load(name="left", box=(-1, -1, 0.5e-3, 1), traction=(1e6, 0.0)), False),
    ):
        for coarse in ("own", "matched", "unbreakable"):
            material = msgspec.structs.replace(GLASS, coarse=coarse)
            model = plate(two_zones(), 3.0, material=material, conditions=(condition,))
            said = list(remarks(model.grid, model.settings))
            assert len(said) == (acts and coarse == "own")
            assert all(f"'{condition.name}' acts on coarse nodes" in each for each in said)
    beside = two_zones()  # of which the coarse zone is a body of its own
    number = (beside.delta > beside.delta.min()).astype(np.int64)
    beside = dataclasses.replace(beside, bodies=Bodies(number, ("left", "right")))
    model = plate(beside, 3.0, material=GLASS, conditions=(Load(box=right, traction=(1e6, 0.0)),))
    assert not list(remarks(model.grid, model.settings))
    cohesive = msgspec.structs.replace(GLASS, law="cohesive", f_t=3e7)
    model = plate(two_zones(), 3.0, material=cohesive, conditions=(Load(box=right, traction=(1e6, 0.0)),))
    assert not list(remarks(model.grid, model.settings))


@pytest.mark.parametrize(("name", "value"), [("coarse", "matched"), ("calibration", "isotropic")])
def test_the_thesis_mode_has_its_own_bonds(name: str, value: str) -> None:
    model = plate(two_zones(), 3.0, material=msgspec.structs.replace(GLASS, **{name: value}))
    with pytest.raises(ModelError, match=rf"\$.material.{name}.*'{value}'"):
        prepare(model, Options("thesis"))


@pytest.mark.slow
def test_info_and_plan_print_the_strengths(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "zones.py"
    scene.write_text(
        "from pdmesh import *\n"
        "scene = (Scene(box(0, 0, .04, .04), 2e-3, Material(E=65e9, rho=2235, G0=204), 3, Run(steps=1))\n"
        "  .zone(box(0, 0, .01, .01), 1e-3).load('right', traction=(1e6, 0)))\n"
    )
    assert pdmesh(["build", str(scene), "--trust", "-o", str(tmp_path / "zones.json")]) == 0
    assert "acts on coarse nodes" in capsys.readouterr().err
    model = str(tmp_path / "zones.json")
    for command in (["info", model], ["plan", str(scene), "--trust"]):
        assert pdmesh(command) == 0
        printed = capsys.readouterr()
        assert "'right' acts on coarse nodes" in printed.err
        (line,) = [line for line in printed.out.splitlines() if line.startswith("strength: ")]
        assert line.endswith("0.707 of the finest zone's)")
        assert " Pa at 0.001 m (critical stretch " in line
    assert pdmesh(["info", model, "--set", "material.coarse=matched"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "of the finest zone's" not in printed.out
    assert pdmesh(["info", model, "--set", "material.coarse=weak"]) == 2
    assert "$.material.coarse" in capsys.readouterr().err


@pytest.mark.slow
def test_a_plan_of_a_critical_stretch_has_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "stretched.py"
    scene.write_text(
        "from pdmesh import *\n"
        "steel = Material(E=2e11, rho=7850, critical_stretch=.003)\n"
        "scene = Scene(box(0, 0, .04, .04), 2e-3, steel, 3, Run(steps=1)).zone(box(0, 0, .01, .01), 1e-3)\n"
    )
    assert pdmesh(["plan", str(scene), "--trust", "--json"]) == 0
    fine, coarse = json.loads(capsys.readouterr().out)["strengths"]
    assert fine["critical_stretch"] == pytest.approx(0.003)
    assert coarse["critical_stretch"] == pytest.approx(0.003 / 2**0.5)


def test_a_ply_has_a_strength_for_each_direction() -> None:
    """Pulled across its fibres it breaks at a fortieth of the stress along them."""
    ply = Material(
        E=171e9, rho=1580.0, G0=1e3, nu=0.32, model="correspondence", solid="orthotropic", failure="stress",
        E2=9.08e9, G12=5.29e9, angle=90.0, strength=2.326e9, strength_across=62.3e6, shear_strength=92.3e6,
    )  # fmt: skip
    grid = square_grid(8, 8)
    (zone,) = described(zone_strengths(grid, plate(grid, 3.0, material=ply).settings, "conservative"))
    assert (zone["strength"], zone["strength_across"], zone["shear_strength"]) == (2.326e9, 62.3e6, 92.3e6)
    (line,) = lines([zone])
    assert all(number in line for number in ("2.326e+09 Pa", "6.23e+07 Pa", "9.23e+07 Pa"))
