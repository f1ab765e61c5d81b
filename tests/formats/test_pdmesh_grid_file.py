"""The grid file: what is written is read back, what is wrong is refused in one line, whatever it is."""

from __future__ import annotations

import contextlib
import json
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pdmesh import files
from pdmesh.grid import Document, GridError, document_of, encode, grid_of, read_document, read_file, schema, write_file
from pdmesh.lattice import build_grid
from pdmesh.report import info
from pdmesh.scene import Circle, Material, Scene, box, ramp


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


TEXT = encode(document())
PLAIN: dict[str, Any] = json.loads(TEXT)


def test_there_and_back() -> None:
    again = read_document(TEXT, "plate.json")
    assert again == document()
    assert encode(again) == TEXT
    grid, before = grid_of(again, "plate.json"), build_grid(scene())[0]
    for field in ("ids", "position", "delta", "border", "hole_id", "cracks", "areas"):
        assert np.array_equal(getattr(grid, field), getattr(before, field)), field
    assert all(map(np.array_equal, grid.outline + grid.holes, before.outline + before.holes))


def test_the_thesis_keys_are_as_in_the_thesis() -> None:
    assert PLAIN["notch"][0] == [0, 0.0035, 0, 0.003, 0.0035, 0]
    assert PLAIN["nodes"][0] == {
        "id": 1, "border": "true", "position": [0, 0, 0], "hole_id": -1, "delta": [1e-3, 1e-3, 1]
    }  # fmt: skip


def test_schema_names_every_key() -> None:
    found = schema()
    assert found["$schema"].startswith("https://json-schema.org/")
    assert set(found["$defs"]["Document"]["properties"]) == set(PLAIN)
    kinds = {"load", "displacement", "velocity", "acceleration", "initial velocity"}
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


def changed(**changes: Any) -> bytes:
    return json.dumps(PLAIN | changes).encode()


def node(**changes: Any) -> bytes:
    return changed(nodes=[PLAIN["nodes"][0] | changes, *PLAIN["nodes"][1:]])


def without(key: str) -> bytes:
    return json.dumps({name: value for name, value in PLAIN.items() if name != key}).encode()


BAD = {
    "nothing": (b"", "truncated"),
    "cut short": (TEXT[:1000], "truncated"),
    "something behind": (TEXT + b"x", "trailing"),
    "not JSON": (b"<html>", "malformed|invalid"),
    "not text": (b"\xff\xfe{}", "malformed|invalid|utf-8"),
    "a list": (b"[]", "Expected `object`, got `array`"),
    "deep": (b'{"notch": ' + b"[" * 100_000, "Expected|recursion|depth|truncated"),
    "no nodes key": (without("nodes"), "missing required field `nodes`"),
    "no notch key": (without("notch"), "missing required field `notch`"),
    "no nodes": (changed(nodes=[]), r"\$.nodes: found none"),
    "unknown key": (changed(nods=1), "unknown field `nods`"),
    "another version": (changed(version=99), r"\$.version: found 99, expected 1"),
    "NaN": (TEXT.replace(b'"position":[0.0', b'"position":[NaN', 1), "malformed|invalid"),
    "too large a number": (TEXT.replace(b'"position":[0.0', b'"position":[1e999', 1), "out of range"),
    "null": (node(position=None), r"got `null` - at `\$.nodes\[0\].position`"),
    "two coordinates": (node(position=[0, 0]), r"length 3 - at `\$.nodes\[0\].position`"),
    "a word": (node(position=["a", 0, 0]), r"got `str` - at `\$.nodes\[0\].position\[0\]`"),
    "border as a truth": (node(border=True), r"got `bool` - at `\$.nodes\[0\].border`"),
    "border of another word": (node(border="yes"), "Invalid enum value 'yes'"),
    "id a fraction": (node(id=1.5), r"Expected `int`, got `float` - at `\$.nodes\[0\].id`"),
    "id beyond 64 bits": (node(id=10**30), r"\$.nodes\[0\].id|out of range|Expected"),
    "id twice": (node(id=2), r"\$.nodes: id 2 found 2 times, expected once"),
    "no spacing": (node(delta=[0, 0, 1]), r"\$.nodes\[0\].delta: found \[0.0, 0.0, 1.0\], expected positive"),
    "uneven spacing": (node(delta=[1e-3, 2e-3, 1]), "expected delta x equal to delta y"),
    "another plane": (node(position=[0, 0, 1]), "expected the same z for all nodes"),
    "areas missing": (changed(areas=[1.0]), r"\$.areas: found 1, expected"),
    "area of nothing": (changed(areas=[0.0] * len(PLAIN["nodes"])), r"> 0.0 - at `\$.areas\[0\]`"),
    "unknown law": (changed(material=PLAIN["material"] | {"law": "elastic"}), "Invalid enum value 'elastic'"),
    "negative E": (changed(material=PLAIN["material"] | {"E": -1}), r"at `\$.material.E`"),
    "unknown condition": (changed(conditions=[{"kind": "heat"}]), r"'heat' - at `\$.conditions\[0\].kind`"),
    "horizon of nothing": (changed(horizon={"ratio": 0}), r"at `\$.horizon.ratio`"),
    "crack of five numbers": (changed(notch=[[0, 0, 0, 1, 1]]), r"at `\$.notch\[0\]`"),
    "outline of two points": (changed(outline=[[[0, 0], [1, 1]]]), r"\$.outline\[0\]: found 2 points"),
    "crossing outline": (changed(outline=[[[0, 0], [1, 1], [1, 0], [0, 1]]]), r"\$.outline\[0\]: found Self-inter"),
    "condition on no node": (changed(conditions=[{"kind": "load", "rows": 1}]), r"\$.conditions\[0\]: found"),
    "far away": (node(position=[1e300, 0, 0]), r"\$.nodes\[0\].position: found .* expected metres"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_wrong_files(name: str, tmp_path: Path) -> None:
    data, message = BAD[name]
    path = tmp_path / "bad.json"
    path.write_bytes(data)
    with pytest.raises(GridError, match=f"(?i){message}") as caught:
        info(read_file(path), str(path))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.json", tmp_path):
        with pytest.raises(GridError, match="cannot be read"):
            read_file(path)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.binary(max_size=60))
def test_any_bytes(data: bytes) -> None:
    with contextlib.suppress(GridError):
        grid_of(read_document(data, "any.json"), "any.json")


SMALL = {name: value for name, value in PLAIN.items() if name not in ("areas", "regions")} | {
    "nodes": PLAIN["nodes"][:4],
    "conditions": [{"kind": "load", "nodes": [1, 2], "traction": [0, 1.0], "rows": 1, "profile": [[0, 0], [1, 1]]}],
}
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=6,
)


@settings(max_examples=400, deadline=None, derandomize=True)
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
