"""Descriptions of media, and of all else that a document holds, do not change."""

from __future__ import annotations

import inspect

import msgspec
import pytest

from pdmesh.model import document, mechanical_conditions, medium
from pdmesh.model.medium import Medium, Solid


@pytest.mark.parametrize("module", [document, mechanical_conditions, medium], ids=lambda module: module.__name__)
def test_descriptions_are_frozen(module: object) -> None:
    found = [one for _, one in inspect.getmembers(module, inspect.isclass) if issubclass(one, msgspec.Struct)]
    assert len(found) > 2
    assert [one.__name__ for one in found if not one.__struct_config__.frozen] == []


def test_a_solid_of_a_medium_is_frozen_and_named_by_its_kind() -> None:
    solid = msgspec.convert({"kind": "solid", "box": [0.0, 0.0, 1.0, 1.0]}, Solid)
    assert msgspec.to_builtins(solid)["kind"] == "solid"
    with pytest.raises(AttributeError):
        solid.box = None
    assert Medium.__struct_config__.frozen
