"""Errors in what is read name what may stand there."""

from __future__ import annotations

import re

import msgspec
import pytest
from messages import naming

from pdmesh.model.document import GridFile, Settings
from pdmesh.model.suggestions import explained


@pytest.mark.parametrize(
    ("text", "ending"),
    [
        ('{"run": {"adapt": "hybird"}}', naming("'hybird'", "`$.run.adapt`")),
        ('{"run": {"fields": ["ux", "heat"]}}', naming(expected=("ax", "damage"))),
        (
            '{"material": {"E": 1, "rho": 1, "G0": 1, "plane": "x"}}',
            naming("'x'", "`$.material.plane`", expected=("strain", "stress")),
        ),
        ('{"run": {"stepz": 3}}', naming("`stepz`", "`$.run`", expected="`steps`")),
        ('{"run": {"hybrid": {"wake": "fine"}}}', naming("run.hybrid.wake", "version 1.0.0")),
        ('{"rum": 3}', naming("`rum`", expected="`run`")),
        (
            '{"conditions": [{"kind": "load", "bodyforce": 3, "box": [0, 0, 1, 1]}]}',
            naming(expected="`body_force`"),
        ),
        ('{"run": 3}', naming("`object`", "`int`", "`$.run`", found="3")),
        ('{"run": {"probes": [[0, 0], [1, "a"]]}}', naming("`str`", "`$.run.probes[1][1]`", found="'a'")),
        ('{"run": {"damping": -2.5}}', naming("`float`", ">=", "0.0", "`$.run.damping`", found="-2.5")),
        ('{"run": {"damping": -2.5}', re.escape("Expected `float` >= 0.0 - at `$.run.damping`")),
        ('{"run": {', re.escape("Input data was truncated")),
    ],
)
def test_an_unknown_word_is_followed_by_those_that_are_known(text: str, ending: str) -> None:
    with pytest.raises(msgspec.DecodeError) as error:
        msgspec.json.decode(text, type=Settings)
    assert re.search(ending, explained(error.value, Settings, lambda: msgspec.json.decode(text)))


def test_a_value_of_no_certain_place() -> None:
    text = '{"notch": [], "nodes": [], "parameters": {"a": 1, "b": null}}'
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=GridFile)
    assert explained(error.value, GridFile, lambda: msgspec.json.decode(text)).endswith("at `$.parameters[...]`")


def test_a_word_deep_in_a_grid_file() -> None:
    text = (
        '{"notch": [], "nodes": [{"id": 1, "border": "yes", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 1]}]}'
    )
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=GridFile)
    assert explained(error.value, GridFile, dict).endswith("at `$.nodes[0].border`, expected false or true")
