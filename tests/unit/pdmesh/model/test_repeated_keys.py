"""Keys that a JSON text has twice are found with their place, in any layout."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pdmesh.__main__ import main as pdmesh
from pdmesh.model.document import GridError, read_document
from pdmesh.model.grid_file_nodes import BEGIN, BETWEEN, END, repeated_key

NODE = '{"id":1,"border":"true","position":[0,0,0],"hole_id":-1,"delta":[1,1,1]}'


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('{"a": 1, "b": {"c": [{"d": 1}, {"d": 1}]}}', None),
        ('{"a": 1, "a": 1}', "$.a"),
        ('{"a": 1, "\\u0061": 1}', "$.a"),
        ('{"b": {"c": [{"d": 1}, {"d": 1, "d": 2}]}}', "$.b.c[1].d"),
        ('{"a": {"x": 1, "x": 2}, "a": 3}', "$.a"),
        ('{"' + "[1,2,3]" * 9 + '": 1, "' + "[1,2,4]" * 9 + '": 1}', None),  # arrays of numbers in names
        ('{"' + f"[{'1,' * 30}1]" + '": 1, "' + f"[{'2,' * 30}2]" + '": 1}', None),
    ],
)
def test_the_place_of_a_repeated_key(text: str, place: str | None) -> None:
    assert repeated_key(text) == place


@pytest.mark.parametrize("extra", ['"id":1,', '"delta":[1,1,1],', '"border":"true",'])
def test_a_repeated_key_of_a_node_in_the_layout_of_pdmesh(extra: str) -> None:
    """Its records are counted, not parsed."""
    other = NODE.replace('"id":1', '"id":2')
    whole = f'{{\n{BEGIN.decode()}{NODE}{BETWEEN.decode()}{other}{END.decode()},\n"notch": []\n}}'
    assert repeated_key(whole) is None
    twice = whole.replace('{"id":2', "{" + extra + '"id":2')
    key = extra.split('"')[1]
    assert repeated_key(twice) == f"$.nodes[1].{key}"


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (('"E": 1.0', '"E": 1.0, "E": 2.0'), "$.material.E"),
        (('"notch": []', '"notch": [], "notch": []'), "$.notch"),
        (('"id": 1', '"id": 1, "id": 1'), "$.nodes[0].id"),
        (('"kind": "load"', '"kind": "load", "name": "a", "name": "b"'), "$.conditions[0].name"),
    ],
)
def test_a_grid_file_with_a_key_twice_is_refused(
    change: tuple[str, str], place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In place of the last one counting in silence."""
    condition = {"kind": "load", "nodes": [1], "body_force": [0, 1]}
    grid = {"notch": [], "nodes": [json.loads(NODE)], "material": {"E": 1.0, "rho": 1.0, "G0": 1.0}}
    text = json.dumps({**grid, "conditions": [condition]})
    read_document(text, "plate.json")
    path = tmp_path / "plate.json"
    path.write_text(text.replace(*change))
    with pytest.raises(GridError):
        read_document(path.read_bytes(), "plate.json")
    assert pdmesh(["info", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"plate.json: {place} is there twice" in said
    assert said.count("\n") == 1


def test_many_keys_are_counted_once() -> None:
    names = [f'"{number}": 0' for number in range(100_000)]
    assert repeated_key("{" + ", ".join([*names, names[-1]]) + "}") == "$.99999"
