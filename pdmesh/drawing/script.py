"""A scene written in Python: a file that defines ``scene`` and is run with its constants set from outside.

The parameters are the numbers and words assigned to plain names at the top level. A comment behind one, ``# m: between
nodes``, gives its unit and meaning. Gmsh is not needed.

The file is a program. It runs in a process of its own (this module as a script), so that a crash ends only that
process; its output goes to stderr. It runs only with `trust`, whoever names it.
"""

from __future__ import annotations

import ast
import json
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from pdmesh.drawing.keyword_suggestions import known
from pdmesh.drawing.parameters import Parameter, unknown
from pdmesh.drawing.sandbox.walls import how_it_ended
from pdmesh.drawing.scratch import scratch
from pdmesh.files import read_bytes
from pdmesh.quantities import KINDS, number_in
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError, UntrustedError, errors_at
from pdmesh.trust import environment


def read_script(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> Scene | Body:
    """The plate or the body that the Python file at `path` defines, with some of its constants replaced by name.

    The file is a program and is run as one. Raises UntrustedError without `trust`, SceneError naming the file and the
    line.
    """
    text, tree = _parsed(path, trust)
    values = {parameter.name: parameter.value for parameter in _assigned(path, _parameters(text, tree), assignments)}
    with scratch() as folder:
        result, job = folder / "scene", folder / "job"
        job.write_text(json.dumps({"path": str(path), "values": values, "modules": sys.path}), encoding="utf-8")
        command = [sys.executable, "-P", "-m", "pdmesh.drawing.script", str(job), str(result)]
        ended = subprocess.run(command, check=False, env=environment()).returncode
        if not result.exists():
            raise SceneError(f"{path}: the program {how_it_ended(ended)}; it must define scene")
        message_or_parts = pickle.loads(result.read_bytes())  # of a program that could do anything in any case
    if isinstance(message_or_parts, str):
        raise SceneError(f"{path}: {message_or_parts}")
    kind, parts = message_or_parts
    more: dict[str, Any] = {"source": path.name, "drawing": text, "parameters": tuple(values.items())}
    scene: Scene | Body
    with errors_at(path):
        if kind == Body.__name__:
            from pdmesh.drawing.building import meshed

            scene = meshed(Body(**parts | more))
        else:
            scene = replace(Scene(**parts), **more)
    named: list[Any] = [*scene.zones, *scene.cracks]
    named += [part.region for part in scene.regions] + [condition.action for condition in scene.conditions]
    for word in [*(part.name for part in named), *(word for pair in scene.parameters for word in pair)]:
        try:
            str(word).encode("utf-8")
        except UnicodeEncodeError:  # a lone surrogate, which no file can hold
            raise SceneError(f"{path} has {str(word)[:40]!a}, half of a character; use whole ones") from None
    return scene


def script_parameters(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> list[Parameter]:
    """Parameters of the Python file at `path`, which is parsed but not run. Raises UntrustedError, SceneError."""
    return _assigned(path, _parameters(*_parsed(path, trust)), assignments)


def _assigned(path: Path, parameters: list[Parameter], assignments: Sequence[tuple[str, str]]) -> list[Parameter]:
    values = {parameter.name: parameter for parameter in parameters}
    for name, word in assignments:
        if name not in values:
            raise SceneError(f"{path}: {unknown(name, values)}")
        parameter = values[name]
        if isinstance(parameter.value, str):
            values[name] = replace(parameter, value=word)
            continue
        is_integer, use = isinstance(parameter.value, int), "a finite number"
        try:
            value = number_in(word, parameter.unit)
        except ValueError as error:
            value, use = float("nan"), str(error)
        if not math.isfinite(value) or (is_integer and value != round(value)):
            use = "a whole number" if is_integer else use
            raise SceneError(f"{path}: parameter '{name}' is '{word}'; use {use}")
        values[name] = replace(parameter, value=round(value) if is_integer else value)
    return list(values.values())


def _parsed(path: Path, trust: bool) -> tuple[str, ast.Module]:
    """Text and syntax tree of a program. Raises UntrustedError without `trust`."""
    try:
        content = read_bytes(path)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise SceneError(f"{path}: cannot be read: {error}") from None
    if not trust:
        raise UntrustedError(
            f"{path} is a Python program, which is not run unasked; use --trust to run it, or use a drawing"
        )
    try:
        text = content.decode("utf-8")
        return text, ast.parse(text, str(path))
    except SyntaxError as error:
        raise SceneError(f"{path}: line {error.lineno}: {error.msg}; correct the Python code") from None
    except ValueError as error:
        raise SceneError(f"{path}: {error}; correct the Python code") from None
    except (RecursionError, MemoryError):
        raise SceneError(f"{path}: an expression is too long or nested too deep for Python; split it") from None


# ---- the child process


def _run(path: Path, values: Mapping[str, float | str]) -> bytes:
    """The scene's parts, or an error message, as bytes."""
    names: dict[str, object] = {"__name__": "scene", "__file__": str(path)}
    try:
        tree = _Constants(values).visit(_parsed(path, trust=True)[1])
    except BaseException as error:
        return pickle.dumps(_reason(error, path))
    try:
        exec(compile(tree, str(path), "exec"), names)
        scene = names.get("scene")
        if isinstance(scene, Scene | Body):  # values of place are handed over as tables: of files, and of functions
            from pdmesh.drawing.building import tabulated  # here, as it draws on what reads drawings
            from pdmesh.scene.missing_values import with_files

            scene = tabulated(with_files(scene, path.parent))
    except BaseException as error:
        return pickle.dumps(_reason(error, path) + known(error, tree, names))
    if not isinstance(scene, Scene | Body):
        wrong = "scene is missing" if scene is None else f"scene is of type '{type(scene).__name__}'"
        return pickle.dumps(f"{wrong}; define scene = Scene(...), or Body(...)")
    kind = Scene if isinstance(scene, Scene) else Body
    try:
        return pickle.dumps((kind.__name__, {field.name: getattr(scene, field.name) for field in fields(kind)}))
    except Exception as error:
        return pickle.dumps(f"scene: an object cannot be handed over ({error}); use shapes and numbers")


def _reason(error: BaseException, path: Path) -> str:
    """Message of an error, with the last line of the file in its traceback."""
    line, trace = 0, error.__traceback__
    while trace is not None:
        line = trace.tb_lineno if trace.tb_frame.f_code.co_filename == str(path) else line
        trace = trace.tb_next
    return f"line {line}: {error if isinstance(error, SceneError) else f'{type(error).__name__}: {error}'}".rstrip(": ")


# ---- constants


def _constants(statement: ast.stmt) -> list[tuple[str, ast.expr, float | str]]:
    """Names, nodes of values and values of ``NAME = number or word``, or of ``NAME, ... = number or word, ...``."""
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            pairs = [(name, value)]
        case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
            pairs = [(name, value)]
        case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)) if len(names) == len(values):
            pairs = [(each.id, value) for each, value in zip(names, values, strict=True) if isinstance(each, ast.Name)]
        case _:
            return []
    return [
        (name, value, literal) for name, value in pairs if (literal := _literal(value)) is not None and name != "scene"
    ]


def _literal(node: ast.expr) -> float | str | None:
    """The number or word that an expression is; None for any other."""
    try:
        literal = ast.literal_eval(node)
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return None
    return literal if isinstance(literal, int | float | str) and not isinstance(literal, bool) else None


def _parameters(text: str, tree: ast.Module) -> list[Parameter]:
    lines = text.splitlines()
    parameters = []
    for statement in tree.body:
        constants = _constants(statement)
        comment = lines[(statement.end_lineno or 1) - 1].encode()[statement.end_col_offset or 0 :].decode().strip()
        unit, colon, meaning = comment.removeprefix("#").partition(":") if comment.startswith("#") else ("", "", "")
        units = [part.strip() for part in unit.split(", ")]
        if not colon and not all(any(part in known for known in (*KINDS.values(), "-")) for part in units):
            units, meaning = [""], unit
        if len(units) != len(constants):
            units = [", ".join(units)] * len(constants)
        parameters += [
            Parameter(name, value, unit_of_value, meaning.strip())
            for (name, _, value), unit_of_value in zip(constants, units, strict=True)
        ]
    return parameters


class _Constants(ast.NodeTransformer):
    """Replaces the values of a module's constants."""

    def __init__(self, values: Mapping[str, float | str]) -> None:
        self._values = values

    def visit_Module(self, node: ast.Module) -> ast.Module:
        for statement in node.body:
            new = {
                id(value): ast.copy_location(ast.Constant(self._values[name]), value)
                for name, value, _ in _constants(statement)
            }
            if new and isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
                if isinstance(statement.value, ast.Tuple) and id(statement.value) not in new:
                    statement.value.elts = [new.get(id(value), value) for value in statement.value.elts]
                else:
                    statement.value = new[id(statement.value)]
        return node


if __name__ == "__main__":
    job, output = sys.argv[1:]
    wanted = json.loads(Path(job).read_text(encoding="utf-8"))
    os.dup2(2, 1)  # stdout is for the result
    sys.path[:] = wanted["modules"]
    scene_bytes = _run(Path(wanted["path"]), wanted["values"])
    Path(output).write_bytes(scene_bytes)
