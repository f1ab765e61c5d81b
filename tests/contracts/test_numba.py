"""What the packages use of numba's inside is there: where a new version moves it, the file and the line are named."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import pdsolve

ROOT = Path(pdsolve.__file__).parent
INSIDE = ("numba.core", "numba.extending", "llvmlite")
METHODS = {  # of classes that numba calls or that are overridden
    "numba.core.caching.IndexDataCacheFile": ("load", "save", "_load_index", "_load_data", "_save_index"),
    "numba.core.caching.FunctionCache": ("load_overload", "save_overload"),
    "numba.core.caching._SourceFileBackedLocatorMixin": ("from_function", "get_source_stamp", "get_disambiguator"),
}


def used() -> Iterator[tuple[str, str, str]]:
    """Where (file:line) which name is imported from which module of numba's inside."""
    for path in sorted(ROOT.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not any(module in text for module in INSIDE):
            continue  # most files: to parse them all takes seconds of each start of the tests
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(INSIDE):
                place = f"{path.relative_to(ROOT.parent)}:{node.lineno}"
                yield from ((place, node.module, alias.name) for alias in node.names)


@pytest.mark.parametrize(("place", "module", "name"), sorted(set(used())))
def test_what_is_imported_of_numba_is_there(place: str, module: str, name: str) -> None:
    found = getattr(import_module(module), name, None) or find_spec(f"{module}.{name}")
    assert found is not None, f"{place}: found no {module}.{name}"


@pytest.mark.parametrize("name", METHODS)
def test_what_is_overridden_of_numba_is_there(name: str) -> None:
    module, _, kind = name.rpartition(".")
    found = getattr(import_module(module), kind)
    assert [method for method in METHODS[name] if not callable(getattr(found, method, None))] == []


@pytest.mark.slow
def test_one_room_knows_the_inside() -> None:
    """Elsewhere only what numba documents is used: functions that stand for others in compiled code. The bond of a
    lattice is written in code of the processor."""
    inside = "pdsolve/codegen/", "pdsolve/lattice/bond.py"
    elsewhere = {(place, module, name) for place, module, name in used() if not place.startswith(inside)}
    assert {name for _, _, name in elsewhere} <= {"overload", "register_jitable"}, elsewhere
