"""Keys of JSON belong to records and fields that there are."""

from __future__ import annotations

import dataclasses
from importlib import import_module
from pathlib import Path

import pytest

import pdpost
from pdpost.measures.fragments import PlateFragment
from pdpost.reading.json_keys import JSON_KEYS, fields_by_json_key

MODULES = sorted(path.stem for path in (Path(pdpost.__file__).parent / "measures").glob("[!_]*.py"))


@pytest.mark.parametrize("name", JSON_KEYS)
def test_every_key_is_of_a_field(name: str) -> None:
    (record,) = {getattr(module, name) for stem in MODULES if hasattr(module := measures(stem), name)}
    fields = getattr(record, "_fields", None) or [field.name for field in dataclasses.fields(record)]
    assert set(JSON_KEYS[name]) <= set(fields)


def measures(stem: str) -> object:
    return import_module(f"pdpost.measures.{stem}")


def test_other_fields_are_their_own_keys() -> None:
    assert fields_by_json_key(PlateFragment(3, 2.0, (0.0, 1.0))) == {"nodes": 3, "area": 2.0, "centre": (0.0, 1.0)}
