"""Suggestions for an unknown keyword or method in a Python scene."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.spelling import meant

UNKNOWN = re.compile(r"[Uu]nexpected keyword argument '(\w+)'")


def known(error: BaseException, tree: ast.Module, names: Mapping[str, Any]) -> str:
    """The end of an error message: known keywords of the failed call, or the scene method most like the one called.

    `names` are the program's names when it failed. Empty for all other errors.
    """
    if isinstance(error, AttributeError) and isinstance(error.obj, Scene | Body):
        methods = [name for name in dir(error.obj) if not name.startswith("_")]
        return f"; did you mean '{meant(error.name or '', methods, cutoff=0.0)}'?"
    said = UNKNOWN.search(str(error)) if isinstance(error, TypeError) else None
    if said is None:
        return ""
    for node in ast.walk(tree):  # each call that passes the unknown word
        if not isinstance(node, ast.Call) or said[1] not in {keyword.arg for keyword in node.keywords}:
            continue
        for called in _meant(node.func, names):
            try:
                words = [name for name in inspect.signature(called).parameters if name != "self"]
            except (TypeError, ValueError):  # not everything says what it takes
                continue
            if said[1] not in words:
                near = meant(said[1], words)
                return f"; use one of {', '.join(words)}" + (f" (did you mean '{near}'?)" if near else "")
    return ""


def _meant(function: ast.expr, names: Mapping[str, Any]) -> Iterator[Any]:
    """Objects that the called expression may be: the program's object of that name, or a scene method."""
    if isinstance(function, ast.Name):
        yield names.get(function.id)
    if isinstance(function, ast.Attribute):
        if isinstance(function.value, ast.Name):
            yield getattr(names.get(function.value.id), function.attr, None)
        yield from (getattr(kind, function.attr) for kind in (Scene, Body) if hasattr(kind, function.attr))
