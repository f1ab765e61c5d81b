"""Nodes of a grid file, read and written some hundred at a time."""

from __future__ import annotations

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh.model.document import GridError, read_document
from pdmesh.model.grid_file_nodes import BEGIN, BETWEEN, END, NodeColumns, NodeRecord, columns_of, taken_out, written

N = 1500  # nodes of several pieces, both read and written


def columns() -> NodeColumns:
    """Nodes of which some hundreds have all, some nothing in common."""
    draw = np.random.default_rng(4)
    even = np.arange(N) < N // 2
    delta = np.where(even, 1e-4, draw.random(N))[:, None] * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0]
    position = np.column_stack([draw.random(N), 10.0 ** draw.integers(-300, 9, N), np.zeros(N)])
    hole = np.where(even, -1, draw.integers(-1, 3, N))
    return NodeColumns(np.arange(N) * 3 - 7, ~even & (draw.random(N) < 0.5), position, hole, delta)


def text(lines: bytes) -> bytes:
    """A file whose nodes are these lines."""
    return b'{\n"notch": [],\n' + BEGIN + lines + END + b"\n}"


def test_columns_come_back_in_the_words_of_their_records() -> None:
    lines = b"".join(written(columns()))
    records = msgspec.json.decode(b"[%b]" % lines, type=list[NodeRecord])
    assert len(lines) > 65_536
    assert lines == BETWEEN.join(map(msgspec.json.encode, records))
    assert columns_of(records) == columns()
    found = taken_out(text(lines))
    assert found is not None
    assert found[1] == columns()
    assert json.loads(found[0]) == {"notch": [], "nodes": []}
    assert read_document(text(lines), "x").nodes == columns()


@pytest.mark.parametrize("name", ["id", "border", "position", "hole_id", "delta"])
def test_columns_that_differ_are_not_equal(name: str) -> None:
    values = getattr(columns(), name).copy()
    values[-1] = ~values[-1] if name == "border" else 5
    assert replace(columns(), **{name: values}) != columns()


@pytest.mark.parametrize(("old", "new", "found"), [(b'"hole_id":2', b'"hole_id":"2"', "hole_id"), (b"}", b"", "JSON")])
def test_a_wrong_record_is_named_by_its_place(old: bytes, new: bytes, found: str) -> None:
    lines = b"".join(written(columns())).split(BETWEEN)
    at = next(at for at in range(1400, N) if old in lines[at])
    lines[at] = lines[at].replace(old, new)
    assert taken_out(text(BETWEEN.join(lines))) is None
    with pytest.raises(GridError, match=naming(f"$.nodes[{at}].hole_id" if found == "hole_id" else found)):
        read_document(text(BETWEEN.join(lines)), "x")


def test_text_in_other_lines_is_read_too() -> None:
    first = {"id": 1, "border": "true", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 1]}
    whole = json.dumps(
        {"notch": [], "nodes": [first], "conditions": [{"kind": "load", "nodes": [1], "traction": [0, 1]}]}
    )
    assert taken_out(whole.encode()) is None
    assert len(read_document(whole, "x").nodes) == 1
    indented = json.dumps(json.loads(whole), indent=2)
    assert read_document(indented, "x") == read_document(whole, "x")


def test_no_nodes_are_no_lines() -> None:
    none = columns_of(())
    assert (len(none), none.position.shape, b"".join(written(none))) == (0, (0, 3), b"")
    assert len(read_document(text(b""), "x").nodes) == 0
