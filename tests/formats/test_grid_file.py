"""The JSON of the thesis: written, read back, broken."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plates import GLASS, square_grid, two_scale_grid

from pdmesh.grid import (
    Acceleration,
    Displacement,
    Document,
    GridError,
    Horizon,
    InitialVelocity,
    Load,
    Region,
    Run,
    Settings,
    Velocity,
    document_of,
    encode,
    grid_of,
    read_document,
    read_file,
    write_file,
)

BARE: dict[str, Any] = {
    "notch": [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]],
    "nodes": [
        {"id": 1, "border": "true", "position": [0, 0.5, 0], "hole_id": -1, "delta": [1, 1, 1]},
        {"id": 2, "border": "false", "position": [1, 0.5, 0], "hole_id": 0, "delta": [1.0, 1.0, 1.0]},
    ],
}
FULL = Settings(
    material=GLASS,
    horizon=Horizon(4),
    regions=(Region(box=(0, 0, 1, 1), material=GLASS),),
    conditions=(
        Load(name="top", nodes=(1, 2), traction=(0.0, 1e6), rows=2, length=0.1, profile=((0.0, 0.0), (1e-6, 1.0))),
        Displacement(box=(0, 0, 1, 1), x=0.0),
        Velocity(nodes=(3,), x=32.0),
        Acceleration(nodes=(3,), y=1.0, breakable=True),
        InitialVelocity(nodes=(3,), y=1.0),
    ),
    run=Run(time_step=1e-9, steps=3, every=1),
    area_rule="cells",
)


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


def test_a_file_comes_back_as_it_was(tmp_path: Path) -> None:
    document = document_of(two_scale_grid(), FULL)
    write_file(document, tmp_path / "grid.json")
    again = read_file(tmp_path / "grid.json")
    assert again == document
    grid = grid_of(again, "grid.json")
    assert np.array_equal(grid.position, two_scale_grid().position)
    assert [path.name for path in tmp_path.iterdir()] == ["grid.json"]


def broken(path: list[Any], value: Any) -> str:
    """The bare file with one value replaced, or removed if it is None."""
    data = json.loads(json.dumps(BARE))
    inside = data
    for key in path[:-1]:
        inside = inside[key]
    if value is None:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return json.dumps(data)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["nodes", 1, "border"], "yes", r"Invalid enum value 'yes' - at `\$.nodes\[1\].border`"),
        (["nodes", 1, "border"], True, r"Expected `str`, got `bool` - at `\$.nodes\[1\].border`"),
        (["nodes", 1, "delta"], [0, 0, 1], r"\$.nodes\[1\].delta: found \[0.0, 0.0, 1.0\], expected positive numbers"),
        (["nodes", 1, "delta"], [1, 2, 1], r"\$.nodes\[1\].delta: found .* expected delta x equal to delta y"),
        (["nodes", 1, "position"], [0, 0], r"Expected `array` of length 3 - at `\$.nodes\[1\].position`"),
        (["nodes", 1, "position"], [0, 0, 1], r"\$.nodes\[1\].position: found .* expected the same z for all nodes"),
        (["nodes", 1, "id"], 1, r"\$.nodes: id 1 found 2 times, expected once"),
        (["nodes", 1, "hole_id"], None, r"missing required field `hole_id` - at `\$.nodes\[1\]`"),
        (["nodes"], [], r"\$.nodes: found none, expected at least one"),
        (["notch"], None, "missing required field `notch`"),
        (["nods"], [], "unknown field `nods`"),
        (["version"], 2, r"\$.version: found 2, expected 1"),
        (["areas"], [1.0], r"\$.areas: found 1, expected 2"),
        (["material"], {"E": -1, "rho": 1, "G0": 1}, r"Expected `float` > 0.0 - at `\$.material.E`"),
    ],
)
def test_wrong_values_are_named_with_their_place(path: list[Any], value: Any, message: str) -> None:
    with pytest.raises(GridError, match=message) as error:
        grid_of(read_document(broken(path, value), "grid.json"), "grid.json")
    assert str(error.value).startswith("grid.json: ")


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "NaN", '{"notch": [], "nodes": [NaN]}', "\ufeff{}"])
def test_what_is_not_a_grid_is_refused(text: str) -> None:
    with pytest.raises(GridError, match=r"grid\.json: "):
        read_document(text, "grid.json")


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "null"])
def test_numbers_that_are_none_are_refused(number: str) -> None:
    text = json.dumps(BARE).replace("[1, 0.5, 0]", f"[{number}, 0.5, 0]")
    with pytest.raises(GridError):
        read_document(text, "grid.json")


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10**6), st.binary(max_size=4))
def test_a_damaged_file_is_refused_or_read_never_a_traceback(at: int, patch: bytes) -> None:
    data = encode(document_of(two_scale_grid(), FULL))
    at %= len(data)
    with contextlib.suppress(GridError):
        grid_of(read_document(data[:at] + patch + data[at + len(patch) :], "grid.json"), "grid.json")


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6))
def test_a_truncated_file_is_refused(at: int) -> None:
    data = encode(document_of(two_scale_grid(), FULL)).rstrip()
    with pytest.raises(GridError):
        read_document(data[: at % len(data)], "grid.json")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(GridError, match=r"none\.json: cannot be read: No such file"):
        read_file(tmp_path / "none.json")


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    document = Document(notch=(), nodes=(), parameters={"x": object()})  # type: ignore[dict-item]
    (tmp_path / "grid.json").write_text("before")
    with pytest.raises(TypeError):
        write_file(document, tmp_path / "grid.json")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]
