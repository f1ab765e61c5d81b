"""Keys of JSON belong to records and fields that there are."""

from __future__ import annotations

import dataclasses
from importlib import import_module
from pathlib import Path

import pytest

from pdsolve import measures
from pdsolve.measures.fragments import PlateFragment
from pdsolve.measures.json_keys import JSON_KEYS, fields_by_json_key

STEMS = sorted(path.stem for path in Path(measures.__file__).parent.glob("[!_]*.py"))
MODULES = [import_module(f"pdsolve.measures.{stem}") for stem in STEMS]


@pytest.mark.parametrize("name", JSON_KEYS)
def test_every_key_is_of_a_field(name: str) -> None:
    (record,) = {getattr(module, name) for module in MODULES if hasattr(module, name)}
    fields = getattr(record, "_fields", None) or [field.name for field in dataclasses.fields(record)]
    assert set(JSON_KEYS[name]) <= set(fields)


def test_other_fields_are_their_own_keys() -> None:
    assert fields_by_json_key(PlateFragment(3, 2.0, (0.0, 1.0))) == {"nodes": 3, "area": 2.0, "centre": (0.0, 1.0)}
