"""A scene written in Python: a file that defines ``scene``, run with its constants set from outside.

The parameters are the numbers and words assigned to plain names at the top level; a comment behind one, ``# m:
between nodes``, says its unit and meaning. Gmsh is not needed.
"""

from __future__ import annotations

import ast
import contextlib
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from pdmesh.parameters import Parameter, unknown
from pdmesh.scene import Scene
from pdmesh.shapes import SceneError


def read_script(path: Path, assignments: Sequence[tuple[str, str]] = ()) -> Scene:
    """The scene that the Python file at `path` defines, with some of its constants replaced by name.

    The file is a program and is run as one. Raises SceneError naming the file and the line.
    """
    text, tree = _parsed(path)
    values = {parameter.name: parameter.value for parameter in _assigned(path, _parameters(text, tree), assignments)}
    scene = _run(path, _Constants(values).visit(tree))
    if not isinstance(scene, Scene):
        found = "none" if scene is None else f"a {type(scene).__name__}"
        raise SceneError(f"{path}: scene: found {found}, expected a file that defines scene = Scene(...)")
    return replace(scene, source=path.name, drawing=text, parameters=tuple(values.items()))


def script_parameters(path: Path, assignments: Sequence[tuple[str, str]] = ()) -> list[Parameter]:
    """The parameters of the Python file at `path`, which is not run. Raises SceneError."""
    return _assigned(path, _parameters(*_parsed(path)), assignments)


def _assigned(path: Path, found: list[Parameter], assignments: Sequence[tuple[str, str]]) -> list[Parameter]:
    values = {parameter.name: parameter for parameter in found}
    for name, word in assignments:
        if name not in values:
            raise SceneError(f"{path}: {unknown(name, values)}")
        values[name] = replace(values[name], value=_converted(name, word, values[name].value, path))
    return list(values.values())


def _parsed(path: Path) -> tuple[str, ast.Module]:
    try:
        text = path.read_text(encoding="utf-8")
        return text, ast.parse(text, str(path))
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except SyntaxError as error:
        raise SceneError(f"{path}: line {error.lineno}: {error.msg}, expected Python") from None
    except ValueError as error:
        raise SceneError(f"{path}: {error}, expected Python") from None


def _run(path: Path, tree: ast.Module) -> object:
    names: dict[str, object] = {"__name__": "scene", "__file__": str(path)}
    try:
        with contextlib.redirect_stdout(sys.stderr):  # stdout is for the result
            exec(compile(tree, str(path), "exec"), names)
    except (Exception, SystemExit) as error:
        line, trace = 0, error.__traceback__
        while trace is not None:
            line = trace.tb_lineno if trace.tb_frame.f_code.co_filename == str(path) else line
            trace = trace.tb_next
        reason = str(error) if isinstance(error, SceneError) else f"{type(error).__name__}: {error}"
        raise SceneError(f"{path}: line {line}: {reason}") from None
    return names.get("scene")


def _constant(statement: ast.stmt) -> tuple[str, ast.expr, float | str] | None:
    """Name, value's node and value of a statement ``NAME = number or word``."""
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            pass
        case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
            pass
        case _:
            return None
    try:
        found = ast.literal_eval(value)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return None
    plain = isinstance(found, int | float | str) and not isinstance(found, bool)
    return (name, value, found) if plain and name != "scene" else None


def _parameters(text: str, tree: ast.Module) -> list[Parameter]:
    lines = text.splitlines()
    found = []
    for statement in tree.body:
        constant = _constant(statement)
        if constant:
            name, node, value = constant
            behind = lines[(node.end_lineno or 1) - 1].encode()[node.end_col_offset or 0 :].decode().strip()
            unit, colon, meaning = behind.removeprefix("#").partition(":") if behind.startswith("#") else ("", "", "")
            if not colon:
                unit, meaning = "", unit
            found.append(Parameter(name, value, unit.strip(), meaning.strip()))
    return found


def _converted(name: str, word: str, default: float | str, path: Path) -> float | str:
    if isinstance(default, str):
        return word
    whole = isinstance(default, int)
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not math.isfinite(value) or (whole and value != round(value)):
        raise SceneError(
            f"{path}: parameter '{name}': found '{word}', expected a {'whole' if whole else 'finite'} number"
        )
    return round(value) if whole else value


class _Constants(ast.NodeTransformer):
    """Replaces the values of a module's constants."""

    def __init__(self, values: Mapping[str, float | str]) -> None:
        self._values = values

    def visit_Module(self, node: ast.Module) -> ast.Module:
        for statement in node.body:
            constant = _constant(statement)
            if constant and isinstance(statement, ast.Assign | ast.AnnAssign):
                name, value, _ = constant
                statement.value = ast.copy_location(ast.Constant(self._values[name]), value)
        return node
