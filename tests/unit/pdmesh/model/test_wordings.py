"""Errors in what is read name what may stand there."""

from __future__ import annotations

import msgspec
import pytest

from pdmesh.model.document import Document, Settings
from pdmesh.model.wordings import explained


@pytest.mark.parametrize(
    ("text", "ending"),
    [
        ('{"run": {"adapt": "hybird"}}', "'hybird' - at `$.run.adapt`, expected "),
        ('{"run": {"fields": ["ux", "heat"]}}', "expected ax, ay, damage, "),
        (
            '{"material": {"E": 1, "rho": 1, "G0": 1, "plane": "x"}}',
            "'x' - at `$.material.plane`, expected space, strain or stress",
        ),
        ('{"run": {"stepz": 3}}', "unknown field `stepz` - at `$.run`, expected one such as `steps`"),
        ('{"rum": 3}', "unknown field `rum`, expected one such as `run`"),
        (
            '{"conditions": [{"kind": "load", "bodyforce": 3, "box": [0, 0, 1, 1]}]}',
            "expected one such as `body_force`",
        ),
        ('{"run": 3}', "Expected `object`, got `int` - at `$.run`, found 3"),
        ('{"run": {"probes": [[0, 0], [1, "a"]]}}', "got `str` - at `$.run.probes[1][1]`, found 'a'"),
        ('{"run": {"damping": -2.5}}', "Expected `float` >= 0.0 - at `$.run.damping`, found -2.5"),
        ('{"run": {"damping": -2.5}', "Expected `float` >= 0.0 - at `$.run.damping`"),
        ('{"run": {', "Input data was truncated"),
    ],
)
def test_an_unknown_word_is_followed_by_those_that_are_known(text: str, ending: str) -> None:
    with pytest.raises(msgspec.DecodeError) as error:
        msgspec.json.decode(text, type=Settings)
    assert ending in explained(error.value, Settings, lambda: msgspec.json.decode(text))


def test_a_value_of_no_certain_place() -> None:
    text = '{"notch": [], "nodes": [], "parameters": {"a": 1, "b": null}}'
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=Document)
    assert explained(error.value, Document, lambda: msgspec.json.decode(text)).endswith("at `$.parameters[...]`")


def test_a_word_deep_in_a_grid_file() -> None:
    text = (
        '{"notch": [], "nodes": [{"id": 1, "border": "yes", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 1]}]}'
    )
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=Document)
    assert explained(error.value, Document, dict).endswith("at `$.nodes[0].border`, expected false or true")
