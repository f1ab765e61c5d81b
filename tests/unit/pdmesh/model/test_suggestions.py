"""Errors in what is read name what may stand there."""

from __future__ import annotations

import re

import msgspec
import pytest
from messages import mentions, naming

from pdmesh.model.document import GridFile, Settings
from pdmesh.model.suggestions import explained


@pytest.mark.parametrize(
    ("text", "ending"),
    [
        ('{"run": {"adapt": "hybird"}}', naming("$.run.adapt", "'hybird'", expected=("'hybrid'", "'split'"))),
        ('{"run": {"fields": ["ux", "heat"]}}', naming("$.run.fields[1]", "'heat'", expected=("'ax'", "'damage'"))),
        (
            '{"material": {"E": 1, "rho": 1, "G0": 1, "plane": "x"}}',
            naming("$.material.plane", "'x'", expected=("'strain'", "'stress'")),
        ),
        ('{"run": {"hybrid": {"wake": "fine"}}}', naming("run.hybrid.wake", "version 1.0.0")),
        ('{"run": {"stepz": 3}}', naming("$.run.stepz", expected="`run.steps`")),
        ('{"rum": 3}', naming("$.rum", expected="`run`")),
        ('{"E": 3}', naming("$.E", expected="`material.E`")),
        ('{"material": {"young": 3}}', naming("$.material.young", expected="`material.E`")),
        ('{"material": {"density": 3}}', naming("$.material.density", expected="`material.rho`")),
        ('{"run": {"dt": 3}}', naming("$.run.dt", expected="`run.time_step`")),
        ('{"run": {"solver": "quasi-static"}}', naming("$.run.solver", "'quasi-static'", expected="mean 'static'")),
        (
            '{"conditions": [{"kind": "load", "bodyforce": 3, "box": [0, 0, 1, 1]}]}',
            naming("$.conditions[0].bodyforce", expected="`conditions[0].body_force`"),
        ),
        ('{"conditions": [{"kind": "lod"}]}', naming("$.conditions[0].kind", "'lod'", expected="'load'")),
        ('{"material": {"rho": 3}}', naming("$.material.E", "missing", expected="above 0")),
        ('{"run": 3}', naming("$.run", found="3", expected="table")),
        ('{"run": {"probes": [[0, 0], [1, "a"]]}}', naming("$.run.probes[1][1]", found="'a'", expected="a number")),
        ('{"run": {"damping": -2.5}}', naming("$.run.damping", found="-2.5", expected="from 0")),
        ('{"horizon": {"ratio": 65}}', naming("$.horizon.ratio", found="65", expected="from 1 to 64")),
        ('{"run": {"steps": 1e999}}', naming("$.run.steps", found="1.8e308", expected="whole number")),
        ('{"run": {', naming("JSON", "whole file")),
        ('{run}', naming("JSON", "byte 1")),
    ],
)  # fmt: skip
def test_a_value_that_cannot_be_is_named_with_what_can(text: str, ending: str) -> None:
    with pytest.raises(msgspec.DecodeError) as error:
        msgspec.json.decode(text, type=Settings)
    said = explained(error.value, Settings, lambda: msgspec.json.decode(text))
    assert re.search(ending, said)
    assert "Expected" not in said
    assert "Object" not in said


def test_a_value_of_no_certain_place() -> None:
    text = '{"notch": [], "nodes": [], "parameters": {"a": 1, "b": null}}'
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=GridFile)
    said = explained(error.value, GridFile, lambda: msgspec.json.decode(text))
    assert said == "a value in $.parameters is of another type; use a number or a word"


def test_a_word_deep_in_a_grid_file() -> None:
    text = (
        '{"notch": [], "nodes": [{"id": 1, "border": "yes", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 1]}]}'
    )
    with pytest.raises(msgspec.ValidationError) as error:
        msgspec.json.decode(text, type=GridFile)
    assert mentions(explained(error.value, GridFile, dict), "$.nodes[0].border", expected=("'true'", "'false'"))


def test_the_words_of_a_pattern_are_listed() -> None:
    text = '{"run": {"device": "gpu"}}'
    with pytest.raises(msgspec.DecodeError) as error:
        msgspec.json.decode(text, type=Settings)
    said = explained(error.value, Settings, lambda: msgspec.json.decode(text))
    assert said == "$.run.device is 'gpu'; use cpu, opencl or opencl:N"
