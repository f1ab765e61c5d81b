"""No function trusts a file unless it is told to, and nothing but the command line's option tells it so."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

import pdmesh
import pdpost
import pdsolve
from pdmesh.drawing import script

PACKAGES = (pdmesh, pdsolve, pdpost)
CHILD = "_run"  # what the process of a scene does, which was trusted by who started it


def modules() -> Iterator[ModuleType]:
    """All modules of the packages."""
    for package in PACKAGES:
        yield package
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith("__main__"):
                yield importlib.import_module(found.name)


def callables(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """What a module defines that can be called: functions, classes, methods; each with its name."""
    for name, one in vars(module).items():
        if not callable(one) or getattr(one, "__module__", None) != module.__name__:
            continue
        yield f"{module.__name__}.{name}", one
        if inspect.isclass(one):
            for method, value in vars(one).items():
                if inspect.isfunction(value):
                    yield f"{module.__name__}.{name}.{method}", value


def defaults(module: ModuleType) -> Iterator[tuple[str, object]]:
    """The default of each parameter `trust` in a module; `inspect.Parameter.empty` where there is none."""
    for name, one in callables(module):
        try:
            parameters = inspect.signature(one).parameters
        except (TypeError, ValueError):  # of a library's own kind
            continue
        if "trust" in parameters:
            yield name, parameters["trust"].default


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_nothing_is_trusted_by_default() -> None:
    found = {name: default for module in modules() for name, default in defaults(module)}
    known = {
        "pdmesh.drawing.file_reading.build_file",
        "pdmesh.drawing.script.read_script",
        "pdsolve.study.dispatch.Crew",
    }
    assert known <= found.keys()
    assert {name for name, default in found.items() if default not in (False, inspect.Parameter.empty)} == set()


@pytest.mark.slow
def test_nothing_in_the_packages_is_told_to_trust() -> None:
    """A call with `trust=True` would be a door of its own; the one there is, is behind the other."""
    found = set()
    for package in PACKAGES:
        for folder in package.__path__:
            for path in sorted(script.Path(folder).rglob("*.py")):
                tree = ast.parse(path.read_text(encoding="utf-8"))
                for function in ast.walk(tree):
                    if isinstance(function, ast.FunctionDef):
                        found |= {(path.name, function.name) for call in ast.walk(function) if trusting(call)}
    assert found == {("script.py", CHILD)}


def trusting(node: ast.AST) -> bool:
    """Whether it is a call that says trust=True."""
    said = node.keywords if isinstance(node, ast.Call) else []
    return any(
        one.arg == "trust" and isinstance(one.value, ast.Constant) and one.value.value is not False for one in said
    )
