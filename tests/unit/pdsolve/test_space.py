"""Bodies in space, solved."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh import Body, Box, Material
from pdmesh.drawing.building import meshed
from pdmesh.grid.building import build
from pdmesh.model.amounts import pair_count
from pdmesh.model.document import Lattice, Run, Settings
from pdmesh.model.lattice_calibration import lattice_ratios
from pdmesh.model.node_grid import whole_lattice
from pdsolve.model import Model, ModelError
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate

RUBBER = Material(E=1e6, rho=1000.0, G0=1e9, micromodulus="constant")
ONE = Options(threads=1)
PRECISIONS = ("float64", "float32")


def bar(run: Run, spacing: float = 0.1) -> Model:
    """A bar of 1 x 0.4 x 0.3 m, fixed at its left, pulled along x and z at its right."""
    body = Body(Box((0, 0, 0), (1, 0.4, 0.3)), spacing, RUBBER, run=run).fix("left").load("right", (1e3, 0, 10))
    found = build(meshed(body))
    return Model(found.grid, found.settings)


@pytest.mark.slow
def test_results_of_a_body_carry_z(tmp_path: Path) -> None:
    model = bar(Run(steps=20, every=10, probes=((1.0, 0.2, 0.15),)))
    path = tmp_path / "bar.sqlite"
    simulate(model, path, ONE).close()
    with Results.open(path) as results:
        results.verify()
        assert results.dimension == 3
        assert np.array_equal(results.nodes().position, model.grid.position)
        assert results.stored(20) == ["ux", "uy", "uz", "vx", "vy", "vz", "ax", "ay", "az", "energy", "damage"]
        uz, probe, history = results.field("uz", 20), results.probes()[-1], results.history()[-1]
        held, loaded = results.reactions()[-2:] if results.reactions()[-1]["condition"] else results.reactions()[-1:]
        assert uz.max() > 0
        assert probe["uz"] == pytest.approx(uz[int(probe["node"]) - 1], rel=1e-6)
        assert history["momentum_z"] > 0
        assert loaded["force_x"] == pytest.approx(1e3 * 0.12)
        assert loaded["force_z"] == pytest.approx(10 * 0.12)
        assert abs(held["force_z"]) > 0
        families = results.families()
        assert pair_count(len(families.neighbour)) == results.summary()["bonds"]
    connection = sqlite3.connect(path)
    (row,) = connection.execute("SELECT x, y, z, uz FROM node_state WHERE step = 20 AND node = 120")
    connection.close()
    assert row == (*model.grid.position[119], pytest.approx(float(uz[119]), rel=1e-12))


@pytest.mark.slow
def test_a_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    model = bar(Run(steps=20, every=5))
    whole, parted = tmp_path / "whole.sqlite", tmp_path / "parted.sqlite"
    simulate(model, whole, ONE).close()
    simulate(model, parted, ONE, watch=lambda now: now.step >= 10).close()
    resume(parted, 1).close()
    with Results.open(whole) as first, Results.open(parted) as second:
        for name in first.stored(20):
            assert np.array_equal(first.field(name, 20), second.field(name, 20))


def pulled(model: str, nu: float, method: str, thick: int = 4) -> tuple[float, float]:
    """Strain of the middle of a bar so many nodes thick at rest, over stress / E, and its Poisson's ratio."""
    material = msgspec.structs.replace(RUBBER, model=model, nu=nu, failure="stretch" if model == "bond" else "none")
    run = msgspec.convert({"solver": "static", "static": {"method": method}}, Run)
    side, long = 0.1 * thick, 0.5 * thick
    body = Body(Box((0, 0, 0), (long, side, side)), 0.1, material, run=run).fix("left").load("right", (1e3, 0, 0))
    found = build(meshed(body))
    results = simulate(Model(found.grid, found.settings), None, ONE)
    x, step = found.grid.position, int(results.frames()[0][-1])
    middle = np.abs(x[:, 0] - long / 2) < long / 4
    along, across = (
        np.polyfit(x[middle, axis], results.field(name, step)[middle], 1)[0] for axis, name in ((0, "ux"), (1, "uy"))
    )
    assert results.reactions()[-1]["force_x"] == pytest.approx(1e3 * side**2)
    return along / 1e-3, -across / along


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "nu", "strain", "ratio"),
    [
        ("bond", 0.25, 0.9836, 0.2556),  # all nodes are at an edge or next to one; inside, 0.9809 of the lattice
        ("ordinary", 0.3, 1.0443, 0.3107),  # likewise; inside, 1
        ("correspondence", 0.3, 1.0, 0.3),  # measured 1.00002, 0.30003
    ],
)
def test_a_bar_at_rest(model: str, nu: float, strain: float, ratio: float) -> None:
    found = pulled(model, nu, "relaxation")
    assert found == (pytest.approx(strain, abs=1e-3), pytest.approx(ratio, abs=1e-3))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "spacing", "off"),
    [("bond", 0.05, 0.0), ("correspondence", 0.05, 0.0), ("bond", 0.1, 0.0), ("bond", 0.1, 1e-3)],
)
def test_what_is_said_of_a_run_is_what_it_does(model: str, spacing: float, off: float) -> None:
    """In tiles, in a list, in blocks as rows are too short for tiles, and in a list as nodes are on no lattice."""
    from pdsolve.estimate import estimate_run

    found = bar(Run(steps=20), spacing)
    moved = found.grid.position + off * np.random.default_rng(0).random(found.grid.position.shape)
    found = Model(replace(found.grid, position=moved), found.settings)
    material = msgspec.structs.replace(RUBBER, model=model, nu=0.25, failure="stretch" if model == "bond" else "none")
    found = Model(found.grid, msgspec.structs.replace(found.settings, material=material))
    said, system = estimate_run(found, ONE), prepare(found, ONE).system
    assert (said.bonds, said.time_step, said.stable_time_step) == (
        system.directed_bond_count,
        system.time_step,
        system.stable_time_step,
    )
    assert said.uses_block_kernels == (model == "bond" and off == 0) == (system.operator.name == "blocks")


@pytest.mark.slow
def test_a_bar_twice_as_thick_is_as_stiff_as_its_lattice() -> None:
    ratios = lattice_ratios(3.0, "constant", "space", True)
    c11, c12 = (1.2 * ratios.c11, 0.4 * ratios.c12)
    E = (c11 - c12) * (c11 + 2 * c12) / (c11 + c12) * 3 / (ratios.c11 + ratios.c12 + ratios.c66)  # as calibrated
    strain, ratio = pulled("bond", 0.25, "newton", thick=8)
    assert 1 / (strain * E) == pytest.approx(1, abs=0.005)  # measured 0.9960; of a bar four nodes thick 0.9972
    assert ratio == pytest.approx(c12 / (c11 + c12), abs=0.012)  # measured 0.2383, of the lattice 0.2464


@pytest.mark.slow
def test_both_ways_to_rest_meet() -> None:
    assert pulled("bond", 0.25, "newton") == pytest.approx(
        pulled("bond", 0.25, "relaxation"), rel=1e-6
    )  # measured 3e-8


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"material": {"E": 1.0, "rho": 1.0, "G0": 1.0, "plane": "strain"}},
            naming(found="'strain'", expected="space"),
        ),
        ({"conditions": [{"kind": "load", "box": [0, 0, 1, 1], "body_force": [1, 0, 0]}]}, "4 numbers"),
        ({"conditions": [{"kind": "load", "nodes": [1], "body_force": [1, 0]}]}, "2 numbers"),
        ({"run": {"probes": [[0, 0]]}}, naming("2 numbers", expected="3")),
    ],
)
def test_what_is_of_plates_is_refused(change: dict[str, object], said: str) -> None:
    model = bar(Run())
    settings = msgspec.convert(msgspec.to_builtins(model.settings, builtin_types=()) | change, type(model.settings))
    with pytest.raises(ModelError, match=said):
        prepare(Model(model.grid, settings), ONE)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        ({"area_rule": "eq19"}, ONE, "'eq19'"),
        ({"run": {"adapt": "split"}}, ONE, naming(found="'split'", expected=("none", "hybrid", "body"))),
        ({"run": {"adapt": "hybrid"}}, ONE, naming("$.nodes", found="tiles", expected=("lattice", "hybrid"))),
        ({}, Options("thesis", threads=1), naming(found=("space", "thesis"))),
    ],
)
def test_what_only_plates_can_have_is_refused(change: dict[str, object], options: Options, said: str) -> None:
    model = bar(Run())
    settings = msgspec.convert(msgspec.to_builtins(model.settings, builtin_types=()) | change, type(model.settings))
    with pytest.raises(ModelError, match=said):
        simulate(Model(model.grid, settings), None, options)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("law", ["brittle", "bilinear"])
def test_a_body_whose_nodes_are_on_no_lattice_is_listed(law: str) -> None:
    model = bar(Run())
    grid = replace(model.grid, position=model.grid.position + np.random.default_rng(0).random((120, 3)) / 1000)
    material = msgspec.structs.replace(RUBBER, law=law, kr=2.0 if law == "bilinear" else 1.0)
    moved = Model(grid, msgspec.structs.replace(model.settings, material=material))
    assert prepare(moved, ONE).system.operator.name == "listed"
    with pytest.raises(ModelError, match=naming("kernel", found="blocks", expected=("listed", "lattice"))):
        prepare(moved, ONE._replace(kernel="blocks"))


@pytest.mark.slow
def test_a_lattice_is_planned_with_less_than_listed_nodes() -> None:
    """A million nodes take 731 MB in float64 and 590 in float32; the process takes 181 MB of them without any."""
    from pdsolve.estimate import estimate_run

    grid = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 20, 20, 20), cracks=np.zeros((0, 9)))
    held = Model(grid, Settings(material=RUBBER, run=Run(steps=1)))
    listed = Model(replace(grid, lattice=None), held.settings)
    found = [estimate_run(model, ONE._replace(precision=kind)) for model in (held, listed) for kind in PRECISIONS]
    each = [(plan.memory - 181e6) / len(grid) for plan in found]
    assert each[:2] == pytest.approx([(731e6 - 181e6) / 1e6, (590e6 - 181e6) / 1e6], rel=0.1)
    assert min(each[2:]) > 3 * each[0]
