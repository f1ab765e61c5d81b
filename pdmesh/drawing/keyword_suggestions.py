"""What may stand where a scene in Python gives a word that a call does not know."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.spelling import nearest

UNKNOWN = re.compile(r"[Uu]nexpected keyword argument '(\w+)'")


def known(error: BaseException, tree: ast.Module, names: Mapping[str, Any]) -> str:
    """What to say behind an error of a program: the words of the call that got one which it does not know, or the
    method of a scene that is most like the one asked for.

    `names` are what the program had when it ended. Empty for all other errors.
    """
    if isinstance(error, AttributeError) and isinstance(error.obj, Scene | Body):
        methods = [name for name in dir(error.obj) if not name.startswith("_")]
        return f", expected one such as '{nearest(error.name or '', methods)}'"
    said = UNKNOWN.search(str(error)) if isinstance(error, TypeError) else None
    for words in _called_with(said[1], tree, names) if said else ():
        return f", expected one of {', '.join(words)}"
    return ""


def _called_with(word: str, tree: ast.Module, names: Mapping[str, Any]) -> Iterator[list[str]]:
    """The words that are known to calls in a program that give one which they do not know."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or word not in {given.arg for given in node.keywords}:
            continue
        for called in _meant(node.func, names):
            try:
                words = [name for name in inspect.signature(called).parameters if name != "self"]
            except (TypeError, ValueError):  # not everything says what it takes
                continue
            if word not in words:
                yield words


def _meant(function: ast.expr, names: Mapping[str, Any]) -> Iterator[Any]:
    """What a program may have called: what it knows by that name, or a method of a scene."""
    if isinstance(function, ast.Name):
        yield names.get(function.id)
    if isinstance(function, ast.Attribute):
        if isinstance(function.value, ast.Name):
            yield getattr(names.get(function.value.id), function.attr, None)
        yield from (getattr(kind, function.attr) for kind in (Scene, Body) if hasattr(kind, function.attr))
