"""The grid file: what is written is read back, what is wrong is refused in one line, whatever it is."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import stat
import warnings
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import naming
from plates import GLASS, square_grid, two_scale_grid

from pdmesh import Body, Circle, Material, Scene, box, files, ramp
from pdmesh.grid import building
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import (
    Acceleration,
    Displacement,
    Document,
    GridError,
    Horizon,
    InitialVelocity,
    Lattice,
    Load,
    Region,
    Run,
    Settings,
    Velocity,
    encode,
    read_document,
    read_file,
    schema,
    write_file,
)
from pdmesh.model.grid_file_nodes import columns_of
from pdmesh.model.node_grid import document_of, grid_of
from pdmesh.reports.report import info
from pdmesh.scene.solids import brick
from pdsolve.model import read_model

BARE: dict[str, Any] = {
    "notch": [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]],
    "nodes": [
        {"id": 1, "border": "true", "position": [0, 0.5, 0], "hole_id": -1, "delta": [1, 1, 1]},
        {"id": 2, "border": "false", "position": [1, 0.5, 0], "hole_id": 0, "delta": [1.0, 1.0, 1.0]},
    ],
}
FULL = Settings(
    material=GLASS,
    horizon=Horizon(4.0),
    regions=(Region(box=(0.0, 0.0, 1.0, 1.0), material=GLASS),),
    conditions=(
        Load(name="top", nodes=(1, 2), traction=(0.0, 1e6), rows=2, length=0.1, profile=((0.0, 0.0), (1e-6, 1.0))),
        Displacement(box=(0.0, 0.0, 1.0, 1.0), x=0.0),
        Velocity(nodes=(3,), x=32.0),
        Acceleration(nodes=(3,), y=1.0, breakable=True),
        InitialVelocity(nodes=(3,), y=1.0),
    ),
    run=Run(time_step=1e-9, steps=3, every=1),
    area_rule="cells",
)


def scene() -> Scene:
    """One of everything."""
    return (
        Scene(box(0, 0, 0.01, 0.006), 1e-3, Material(E=1e9, rho=1e3, G0=10.0, law="bilinear", kr=2.0))
        .hole(Circle(0.007, 0.003, 0.001))
        .crack([(0, 0.0035), (0.003, 0.0035), (0.004, 0.0045)])
        .region(box(0, 0, 0.002, 0.006), Material(E=2e9, rho=1e3, G0=10.0))
        .load("top", traction=(0, 1e6), rows=2, profile=ramp(1e-6))
        .load("right", body_force=(1e9, 0))
        .fix("bottom", x=None)
        .move("left", velocity=(1, None))
        .move(box(0.004, 0, 0.006, 0.006), initial_velocity=(1, 0))
    )


def document() -> Document:
    grid, found, _ = build_grid(scene())
    return document_of(grid, found)


FULL_TEXT = encode(document_of(two_scale_grid(), FULL))
TEXT = encode(document())
PLAIN: dict[str, Any] = json.loads(TEXT)


@pytest.mark.parametrize("everything", [False, True])
def test_a_file_comes_back_as_it_was(everything: bool, tmp_path: Path) -> None:
    before, found = build_grid(scene())[:2] if everything else (two_scale_grid(), FULL)
    write_file(document_of(before, found), tmp_path / "grid.json")
    assert [path.name for path in tmp_path.iterdir()] == ["grid.json"]
    again = read_file(tmp_path / "grid.json")
    assert again == document_of(before, found)
    assert encode(again) == (tmp_path / "grid.json").read_bytes() == (TEXT if everything else FULL_TEXT)
    grid = grid_of(again, "grid.json")
    for field in ("ids", "position", "delta", "border", "hole_id", "cracks", "areas"):
        assert np.array_equal(getattr(grid, field), getattr(before, field)), field
    assert len(grid.outline + grid.holes) == len(before.outline + before.holes) == 2 * everything
    assert all(map(np.array_equal, grid.outline + grid.holes, before.outline + before.holes))


def test_the_thesis_file_is_read() -> None:
    grid = grid_of(read_document(json.dumps(BARE), "bare.json"), "bare.json")
    assert grid.ids.tolist() == [1, 2]
    assert grid.border.tolist() == [True, False]
    assert grid.hole_id.tolist() == [-1, 0]
    assert grid.cracks.tolist() == [[0, 0, 1, 0]]


def test_nodes_are_written_exactly_as_the_thesis_writes_them() -> None:
    lines = encode(document_of(square_grid(2, 1), Settings())).decode().splitlines()
    assert '  {"id":2,"border":"false","position":[0.001,0.0,0.0],"hole_id":-1,"delta":[0.001,0.001,1.0]}' in lines
    assert json.loads("\n".join(lines))["notch"] == []
    assert PLAIN["notch"][0] == [0, 0.0035, 0, 0.003, 0.0035, 0]
    assert PLAIN["nodes"][0] == {
        "id": 1, "border": "true", "position": [0, 0, 0], "hole_id": -1, "delta": [1e-3, 1e-3, 1]
    }  # fmt: skip


def test_schema_names_every_key() -> None:
    found = schema()
    assert found["$schema"].startswith("https://json-schema.org/")
    assert set(found["$defs"]["GridFile"]["properties"]) == set(PLAIN) | {
        "physics",
        "medium",
        "media",
        "contact",
        "bodies",
        "fields",
        "interfaces",
    }
    kinds = {
        "load",
        "displacement",
        "velocity",
        "acceleration",
        "initial displacement",
        "initial velocity",
        "absorb",
        "rigid",
        "spring",
        "pin",
    }
    kinds |= {"concentration", "source", "exchange", "initial concentration", "solid"}
    tags = {
        entry["properties"]["kind"]["enum"][0] for entry in found["$defs"].values() if "kind" in entry["properties"]
    }
    assert tags == kinds
    json.dumps(found, allow_nan=False)


def test_written_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "plate.json"
    write_file(document(), path)
    assert path.read_bytes() == TEXT
    assert stat.S_IMODE(path.stat().st_mode) & 0o600 == 0o600

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "replace", fail)
    path.write_text("before")
    with pytest.raises(OSError, match="No space"):
        write_file(document(), path)
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["plate.json"]


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    document = Document(notch=(), nodes=columns_of(()), parameters={"x": object()})  # type: ignore[dict-item]
    (tmp_path / "grid.json").write_text("before")
    with pytest.raises(TypeError):
        write_file(document, tmp_path / "grid.json")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]


def changed(**changes: Any) -> bytes:
    plain = {name: value for name, value in PLAIN.items() if name != "digest"}
    return json.dumps(plain | changes).encode()


def node(**changes: Any) -> bytes:
    return changed(nodes=[PLAIN["nodes"][0] | changes, *PLAIN["nodes"][1:]])


def without_in_node(key: str) -> bytes:
    node = {name: value for name, value in PLAIN["nodes"][0].items() if name != key}
    return changed(nodes=[node, *PLAIN["nodes"][1:]])


def without(key: str) -> bytes:
    return json.dumps({name: value for name, value in PLAIN.items() if name != key}).encode()


BAD = {
    "nothing": (b"", "is empty"),
    "an open brace": (b"{", "too early"),
    "cut short": (TEXT[:1000], "too early"),
    "something behind": (TEXT + b"x", "trailing"),
    "not JSON": (b"<html>", "malformed|invalid|not valid"),
    "not text": (b"\xff\xfe{}", "malformed|invalid|not valid|utf-8"),
    "a byte order mark": ("\ufeff{}".encode(), "malformed|invalid|not valid"),
    "a null": (b"null", r"\$ is None"),
    "a NaN": (b"NaN", "malformed|invalid|not valid"),
    "a list": (b"[]", r"\$ is \[\]"),
    "deep": (b'{"notch": ' + b"[" * 100_000, "recursion|depth|too early|another type"),
    "no nodes key": (without("nodes"), ".nodes is missing"),
    "no notch key": (without("notch"), ".notch is missing"),
    "no nodes": (changed(nodes=[]), r"\$.nodes is empty"),
    "unknown key": (changed(nods=1), ".nods is unknown"),
    "another version": (changed(version=99), r"\$.version.*99"),
    "NaN": (TEXT.replace(b'"position":[0.0', b'"position":[NaN', 1), "malformed|invalid|not valid"),
    "infinity": (TEXT.replace(b'"position":[0.0', b'"position":[Infinity', 1), "malformed|invalid|not valid"),
    "too large a number": (TEXT.replace(b'"position":[0.0', b'"position":[1e999', 1), r"position\[0\].*.* float"),
    "null": (node(position=None), r"\$.nodes\[0\].position is None"),
    "null for a number": (node(position=[None, 0, 0]), r"\$.nodes\[0\].position\[0\] is None"),
    "two coordinates": (node(position=[0, 0]), r"\$.nodes\[0\].position"),
    "a word": (node(position=["a", 0, 0]), r"\$.nodes\[0\].position\[0\] is 'a'"),
    "border as a truth": (node(border=True), r"\$.nodes\[0\].border"),
    "border of another word": (node(border="yes"), r"\$.nodes\[0\].border is 'yes'"),
    "no hole_id": (without_in_node("hole_id"), r"\$.nodes\[0\].hole_id is missing"),
    "id a fraction": (node(id=1.5), r"\$.nodes\[0\].id"),
    "id beyond 64 bits": (node(id=10**30), r"\$.nodes\[0\].id|out of range"),
    "id twice": (node(id=2), r"\$.nodes: id 2 is there 2 times"),
    "no spacing": (node(delta=[0, 0, 1]), r"\$.nodes\[0\].delta.*\[0.0, 0.0, 1.0\]"),
    "uneven spacing": (node(delta=[1e-3, 2e-3, 1]), r"\$.nodes\[0\].delta.*.*"),
    "another plane": (node(position=[0, 0, 1]), r"\$.nodes\[1\].position.*.*"),
    "areas missing": (changed(areas=[1.0]), r"\$.areas.*1"),
    "area of nothing": (changed(areas=[0.0] * len(PLAIN["nodes"])), r"\$.areas\[0\]"),
    "unknown plane": (changed(material=PLAIN["material"] | {"plane": "elastic"}), " is 'elastic'"),
    "law that is no word": (changed(material=PLAIN["material"] | {"law": 3}), r"\$.material.law is 3"),
    "negative E": (changed(material=PLAIN["material"] | {"E": -1}), r"\$.material.E"),
    "unknown condition": (changed(conditions=[{"kind": "heat"}]), r"\$.conditions\[0\].kind is 'heat'"),
    "horizon of nothing": (changed(horizon={"ratio": 0}), r"\$.horizon.ratio"),
    "crack of five numbers": (changed(notch=[[0, 0, 0, 1, 1]]), r"\$.notch\[0\]"),
    "crack of one place": (changed(notch=[[0, 0, 0, 1, 1, 0], [1, 2, 0, 1, 2, 3]]), "both ends are in one place"),
    "outline of two points": (changed(outline=[[[0, 0], [1, 1]]]), r"\$.outline\[0\].*2 points"),
    "crossing outline": (changed(outline=[[[0, 0], [1, 1], [1, 0], [0, 1]]]), r"\$.outline\[0\].*Self-inter"),
    "condition on no node": (changed(conditions=[{"kind": "load", "rows": 1}]), r"\$.conditions\[0\]: "),
    "far away": (node(position=[1e300, 0, 0]), r"\$.nodes\[0\].position.*.*"),
}  # fmt: skip


SEEN_BY_INFO = ("crossing outline", "condition on no node")  # what the grid alone does not show


@pytest.mark.parametrize("name", BAD)
def test_wrong_files(name: str, tmp_path: Path) -> None:
    data, message = BAD[name]
    path = tmp_path / "bad.json"
    path.write_bytes(data)
    with pytest.raises(GridError, match=f"(?i){message}") as caught:
        info(read_file(path), str(path))
    assert str(caught.value).startswith(f"{path}")
    assert "\n" not in str(caught.value)
    if name not in SEEN_BY_INFO:
        with pytest.raises(GridError, match=f"(?i)^grid.json:? .*{message}"):
            grid_of(read_document(data, "grid.json"), "grid.json")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(GridError, match=naming("none.json", "there is no such file")):
        read_file(tmp_path / "none.json")
    with pytest.raises(GridError, match=naming(tmp_path)):
        read_file(tmp_path)


@settings(max_examples=200)
@given(st.binary(max_size=60))
def test_any_bytes(data: bytes) -> None:
    with contextlib.suppress(GridError):
        grid_of(read_document(data, "any.json"), "any.json")


@pytest.mark.slow
@settings(max_examples=300)
@given(st.integers(0, 10**6), st.binary(max_size=4))
def test_a_damaged_file_is_refused_or_read_never_a_traceback(at: int, patch: bytes) -> None:
    at %= len(FULL_TEXT)
    with contextlib.suppress(GridError):
        grid_of(read_document(FULL_TEXT[:at] + patch + FULL_TEXT[at + len(patch) :], "grid.json"), "grid.json")


@settings(max_examples=200)
@given(st.integers(0, 10**6))
def test_a_truncated_file_is_refused(at: int) -> None:
    with pytest.raises(GridError):
        read_document(FULL_TEXT[: at % len(FULL_TEXT.rstrip())], "grid.json")


SMALL = {name: value for name, value in PLAIN.items() if name not in ("areas", "regions")} | {
    "nodes": PLAIN["nodes"][:4],
    "conditions": [{"kind": "load", "nodes": [1, 2], "traction": [0, 1.0], "rows": 1, "profile": [[0, 0], [1, 1]]}],
}
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=6,
)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pdmesh.model.document.GridWarning")
@settings(max_examples=400)
@given(st.data())
def test_any_damage_to_a_file(data: st.DataObject) -> None:
    """One value somewhere in a good file replaced by any other: it is read, or refused with a GridError."""
    whole: Any = json.loads(json.dumps(SMALL))
    here = whole
    while True:
        keys = list(here) if isinstance(here, dict) else range(len(here))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(here[key], dict | list) or not here[key] or data.draw(st.integers(0, 3)) == 0:
            break
        here = here[key]
    here[key] = data.draw(anything)
    with contextlib.suppress(GridError):
        assert info(read_document(json.dumps(whole), "any.json"), "any.json")["nodes"] > 0


def test_a_lattice_stands_for_its_nodes(tmp_path: Path) -> None:
    """A file that holds a lattice has the nodes, cells and edges of one that lists them, and stays as it is."""
    scene = Scene(box(-0.01, 0, 0.03, 0.02), 1e-3, GLASS, 4.0, Run(adapt="hybrid")).crack(
        [(-0.01, 0.0105), (0, 0.0105)]
    )
    listed, _, _ = build_grid(scene)
    held = document_of(dataclasses.replace(listed, lattice=Lattice((-0.01, 0.0), 1e-3, 41, 21)), Settings())
    assert not held.nodes
    path = tmp_path / "lattice.json"
    write_file(held, path)
    grid = grid_of(read_file(path), "lattice")
    for name in ("ids", "position", "delta", "border", "hole_id", "cracks"):
        assert np.array_equal(getattr(grid, name), getattr(listed, name)), name
    assert grid.areas == pytest.approx(listed.areas, rel=1e-12)
    assert document_of(grid, Settings()) == held


@pytest.mark.slow
def test_a_scene_of_many_nodes_holds_a_lattice(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the settings it has where nodes are listed; notched, or to be solved on one lattice, it lists them."""
    scene = Scene(box(0, 0, 0.04, 0.02), 1e-3, GLASS, 4.0, Run(adapt="hybrid")).crack([(0, 0.0105), (0.01, 0.0105)])
    scene = scene.load("top", traction=(0.0, 1e6), rows=2).fix([(0.0, 0.0), (0.01, 0.0)])
    listed = building.build(scene)
    monkeypatch.setattr("pdmesh.grid.implicit_lattice.MANY", 800)
    held = building.build(scene)
    assert held.grid.lattice == Lattice((0.0, 0.0), 1e-3, 41, 21)
    assert held.settings == listed.settings
    assert building.build(scene.adapt("none")).grid.lattice is None
    assert building.build(scene.hole(Circle(0.03, 0.01, 0.003))).grid.lattice is None


def test_a_box_of_many_nodes_holds_a_lattice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same nodes as where they are listed, and the same settings; with a hole or a finer zone they are listed."""
    glass = msgspec.structs.replace(GLASS, micromodulus="constant")
    body = Body(brick((0, 0, 0), (0.01, 0.006, 0.005)), 1e-3, glass, 3.0)
    body = body.load("right", (1e6, 0, 0)).fix("left").crack([[(0.0055, 0, 0), (0.0055, 1, 0), (0.0055, 0, 1)]])
    listed = building.build(body)
    monkeypatch.setattr("pdmesh.grid.bodies.MANY", 300)
    held = building.build(body)
    assert held.grid.lattice == Lattice((0.0005, 0.0005, 0.0005), 1e-3, 10, 6, 5)
    assert held.settings == listed.settings
    held.write(tmp_path / "box.json")
    assert (tmp_path / "box.json").stat().st_size < 10_000
    with warnings.catch_warnings(action="error"):
        grid = read_model(tmp_path / "box.json").grid
    for name in ("ids", "position", "delta", "border", "hole_id", "cracks"):
        assert np.array_equal(getattr(grid, name), getattr(listed.grid, name)), name
    assert grid.areas == pytest.approx(listed.grid.areas, rel=1e-12)
    assert building.build(body.zone(brick((0, 0, 0), (0.002, 0.002, 0.002)), 5e-4)).grid.lattice is None
    short = Body(brick((0, 0, 0), (0.01, 0.006, 0.0052)), 1e-3, glass, 3.0)
    assert building.build(short).grid.lattice is None  # whose outer cells are cut


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": 2}, "$.lattice has 2 numbers of its origin and layers None"),
        (
            {"lattice": {"origin": [0, 0, 0], "spacing": 1, "columns": 3, "rows": 3, "layers": 3}},
            "$.lattice has 3 numbers of its origin and layers 3",
        ),
        ({"nodes": BARE["nodes"]}, "$.lattice cannot be combined with nodes, areas or bodies"),
        ({"lattice": {"origin": [0, 0], "spacing": 1, "columns": 10**6, "rows": 10**6}}, "1000000000000 nodes"),
        ({"lattice": {"origin": [1e10, 0], "spacing": 1, "columns": 3, "rows": 3}}, "$.lattice reaches 1e+10"),
        ({"lattice": {"origin": [0, 0], "spacing": 1, "columns": 1, "rows": 3}}, "$.lattice.columns"),
    ],
)
def test_a_lattice_that_is_none(change: dict[str, Any], said: str) -> None:
    lattice = {"origin": [0, 0], "spacing": 1, "columns": 3, "rows": 3}
    text = json.dumps({"notch": [], "nodes": [], "lattice": lattice} | change)
    with pytest.raises(GridError) as raised:
        grid_of(read_document(text, "plate.json"), "plate.json")
    assert said in str(raised.value)
    assert "plate.json" in str(raised.value)
