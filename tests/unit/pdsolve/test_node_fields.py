"""Constants of the material by node: the same bonds, steps and files as regions of the same values."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import msgspec
import numpy as np
import pytest
from node_clouds import cubic_grid
from plates import GLASS, plate, square_grid

from pdmesh import Heat, Material, Scene, box, build
from pdmesh.model.document import Displacement, Lattice, Region, Run
from pdmesh.model.node_arrays import Grid
from pdmesh.model.node_fields import FieldColumn
from pdmesh.model.node_grid import whole_lattice
from pdsolve.adaptivity.hybrid.adaptivity_choice import choose_adaptivity
from pdsolve.measures.fragments import node_masses
from pdsolve.model import GridError, Model, ModelError, ModelNote, model_of
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.schemes import SCHEMES

CASES: dict[str, dict[str, Any]] = {
    "bond": {},
    "cohesive": {"law": "cohesive", "f_t": 20e6},
    "ordinary": {"model": "ordinary", "nu": 0.2},
    "unbreakable": {"model": "ordinary", "nu": 0.2, "failure": "none"},
    "correspondence": {"model": "correspondence", "nu": 0.2, "failure": "stress", "strength": 20e6},
    "micropolar": {"model": "micropolar", "nu": 0.2},
}
OWN = {"cohesive": {"f_t": 12e6}, "unbreakable": {"nu": 0.3}, "correspondence": {"nu": 0.3, "strength": 12e6}}


def with_columns(grid: Grid, *columns: FieldColumn) -> Grid:
    return dataclasses.replace(grid, fields=columns)


def two_ways(case: str, grid: Grid, **settings: Any) -> tuple[Model, Model]:
    """A model whose right half has other constants, by a region and by fields."""
    left = msgspec.structs.replace(GLASS, **CASES[case])
    own = {"E": 20e9, "rho": 1800.0, "G0": 150.0} | OWN.get(case, {})
    right = grid.position[:, 0] > np.median(grid.position[:, 0])
    region = Region(material=msgspec.structs.replace(left, **own), nodes=tuple(grid.ids[right].tolist()))
    columns = [FieldColumn(name, np.where(right, value, np.nan), "test") for name, value in own.items()]  # type: ignore[arg-type]
    by_region = plate(grid, 3, material=left, regions=(region,), **settings)
    return by_region, plate(with_columns(grid, *columns), 3, material=left, **settings)


@pytest.mark.parametrize(
    ("mode", "case"),
    [
        ("thesis", "bond"),
        *(
            pytest.param("conservative", case, marks=() if case in ("bond", "cohesive") else pytest.mark.slow)
            for case in CASES
        ),
    ],
)
def test_bonds_are_those_of_regions(mode: str, case: str) -> None:
    expected, by_field = (SCHEMES[mode].fill(model).whole().bonds for model in two_ways(case, square_grid(9, 7)))
    for name, column in expected._asdict().items():
        assert np.array_equal(getattr(by_field, name), column), name
    assert (len(np.unique(by_field.limit)) > 1) == (case != "unbreakable")


def test_a_window_has_the_values_of_its_nodes() -> None:
    by_region, by_field = two_ways("bond", square_grid(9, 7))
    lattice = whole_lattice(Lattice((0.0, 0.0), 1e-3, 9, 7), cracks=np.empty((0, 4)), fields=by_field.grid.fields)
    for model in (by_field, dataclasses.replace(by_field, grid=lattice)):
        window = model.window(20, 47)
        assert window.rho.tolist() == by_region.rho[20:47].tolist()
        assert model.grid.part(np.array([3, 43])).fields[0].values[1] == 20e9


def test_the_file_has_the_values_and_their_source() -> None:
    _, model = two_ways("bond", square_grid(9, 7))
    text = model.to_json()
    record = json.loads(text)["fields"][0]
    assert (record["quantity"], record["source"], len(record["values"])) == ("E", "test", 63)
    assert record["values"][0] is None
    read = model_of(text, "plate.json")
    for column, expected in zip(read.grid.fields, model.grid.fields, strict=True):
        assert np.array_equal(column.values, expected.values, equal_nan=True)
    assert model_of(read.to_json(), "again").to_json() == read.to_json()
    assert '"fields"' not in plate(square_grid(9, 7)).to_json().partition('"run"')[0]


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"values": [1e9]}, r"\$\.fields\[0\]\.values has 1 numbers; give 63"),
        ({"values": [1e9] * 62 + [-1.0]}, r"\$\.fields\[0\]\.values\[62\] is -1; use 1e-30"),
        ({"values": [1e9] * 62 + [1e300]}, r"\$\.fields\[0\]\.values\[62\] is 1e\+300; use"),
        ({"quantity": "rho"}, r"\$\.fields\[1\]\.quantity: rho is there twice"),
        ({"quantity": "size"}, r"\$\.fields\[0\]\.quantity"),
        ({"quantity": "f_t"}, r"\$\.fields\[0\] is of f_t, which cannot differ by node with \$\.material; give it law"),
        ({"quantity": "nu", "values": [0.2] * 63}, r"of nu, which cannot .* give it model 'ordinary'"),
    ],
)
def test_a_wrong_field_says_where(change: dict[str, object], place: str) -> None:
    _, model = two_ways("bond", square_grid(9, 7))
    document = json.loads(model.to_json())
    document.pop("digest")
    document["fields"][0] |= change
    with pytest.raises((GridError, ModelError), match=place):
        model_of(json.dumps(document), "plate.json")


def test_fields_are_refused_where_nodes_come_and_go() -> None:
    _, model = two_ways("bond", square_grid(9, 7))
    for adapt in ("hybrid", "split", "collocation"):
        run = msgspec.structs.replace(model.settings.run, adapt=adapt, steps=1)
        moving = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
        with pytest.raises(ModelError, match=r"\$\.fields is E; use regions"):
            prepare(moving, Options())
    run = msgspec.structs.replace(model.settings.run, adapt="auto")
    auto = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with pytest.warns(ModelNote, match=r"hybrid does not support it, \$\.fields is E"):
        assert choose_adaptivity(auto, Options()).settings.run.adapt == "none"


def test_a_cohesive_node_needs_a_horizon_that_resolves_it() -> None:
    grid = square_grid(9, 7)
    strong = np.full(63, np.nan)
    strong[30] = 300e6
    material = msgspec.structs.replace(GLASS, law="cohesive", f_t=20e6)
    model = plate(with_columns(grid, FieldColumn("f_t", strong)), 3, material=material, run=Run(steps=1))
    with pytest.raises(ModelError, match=r"\$\.fields: E, G0 and f_t of .*31"):
        prepare(model, Options())


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES, "space", "single", "static"])
def test_steps_are_those_of_regions(case: str) -> None:
    """To the bit, with the operator that each way gets; in space, tiles against lists, to round-off."""
    grid, options, settings, name = square_grid(21, 13), Options(threads=1), {}, case if case in CASES else "bond"
    settings["conditions"] = tuple(
        Displacement(box=(x - 1e-4, -1.0, x + 1e-4, 1.0), x=u, profile=((0.0, 0.0), (2e-6, 1.0)))
        for x, u in ((0.0, -1e-5), (0.020, 1e-5))
    )
    if case == "space":
        grid = cubic_grid(8)
        ends = ((0.0, -1e-5), (float(grid.position[:, 0].max()), 1e-5))
        settings["conditions"] = tuple(
            Displacement(box=(x - 1e-4, -1.0, -1.0, x + 1e-4, 1.0, 1.0), x=u) for x, u in ends
        )
    if case == "single":
        options = Options(threads=1, precision="float32")
    if case == "static":
        settings |= {"run": Run(solver="static")}
        settings["conditions"] = tuple(
            msgspec.structs.replace(condition, y=0.0, profile=()) for condition in settings["conditions"]
        )
    states = []
    for model in two_ways(name, grid, **settings):
        problem = prepare(model, options)
        problem.advance(1, 2 if case == "static" else 81)
        states.append(problem)
    by_region, by_field = states
    assert by_field.system.time_step == by_region.system.time_step
    broken = [len(problem.system.operator.broken().step) for problem in states]
    assert broken[0] == broken[1]
    for field in ("value", "rate", "dissipated"):
        expected, found = (np.asarray(getattr(problem.state, field), dtype=float) for problem in states)
        assert np.abs(expected).max() > 0 or field != "value"
        if case == "space":
            assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max(initial=1e-300)
        else:
            assert np.array_equal(found, expected), field


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["alpha", "E"])
def test_a_hot_plate_swells_by_fields_as_by_regions(quantity: str) -> None:
    glass = Material(E=70e9, rho=2500.0, G0=1e6, micromodulus="constant", alpha=9e-6, T0=300.0)
    other = {"alpha": 18e-6, "E": 35e9}[quantity]
    scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, glass, medium=Heat(k=1.0, c=800.0), run=Run(steps=20, every=20))
    built = build(scene.initial_temperature(box(0, 0, 0.02, 0.01), 350.0).fix("left"))
    right = built.grid.position[:, 0] > 0.01
    own = msgspec.structs.replace(glass, **{quantity: other})
    region = Region(material=own, nodes=tuple(built.grid.ids[right].tolist()))
    column = FieldColumn(quantity, np.where(right, other, np.nan), "test")  # type: ignore[arg-type]
    by_region = Model(built.grid, msgspec.structs.replace(built.settings, regions=(region,)))
    moved = []
    for model in (by_region, Model(with_columns(built.grid, column), built.settings)):
        with simulate(model, None, Options(threads=1)) as results:
            moved.append(results.field("ux", 20))
    assert np.abs(moved[0]).max() > 0
    assert np.array_equal(*moved)


@pytest.mark.slow
def test_masses_of_fragments_have_densities_by_node() -> None:
    grid = cubic_grid(6)
    column = FieldColumn("rho", 2235.0 * (1 + np.arange(216) / 216), "test")
    body = plate(
        with_columns(grid, column), 2, material=msgspec.structs.replace(GLASS, plane="space"), run=Run(steps=1)
    )
    with simulate(body, None, Options(threads=1)) as results:
        assert node_masses(results, 0) == pytest.approx(column.values * results.nodes(0).area, rel=1e-12)
