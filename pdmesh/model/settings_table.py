"""All settings of a model as a table: name, unit, default, values and meaning, read from the structs that declare them.

The meaning is the comment beside a field; one that begins with a unit, such as ``# s; None: ...``, gives the unit too.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import msgspec
import msgspec.inspect as inspection

from pdmesh.messages import listed
from pdmesh.model.document import Settings
from pdmesh.model.material import CHOSEN, DECLARED, Elastic, Material
from pdmesh.model.suggestions import described

PARTS = ("material", "horizon", "run", "contact", "medium", "physics", "area_rule")
UNIT = re.compile(
    r"(Pa m\^0\.5|Pa|1/s|m/cycle|m/s|rad/s|m\^2/s|mol/m\^3|J/m\^2|J/\(m\^3 K\)|kg/m\^3|kg/m|m|s|K)(?=$|[:;,])[:;,]?\s*"
)


class Setting(NamedTuple):
    """A setting of a model."""

    name: str  # dotted, as --set has it
    unit: str  # "" of words and of numbers without one
    default: str  # "required" where there is none, "none" where it may be left out
    values: str
    meaning: str


def settings(parts: tuple[str, ...] = PARTS) -> list[Setting]:
    """The settings below these keys of a model, in the order of their declarations."""
    return [setting for part in parts for setting in _below(Settings, part, part)]


def unit_of(name: str) -> str:
    """The SI unit of a setting with this dotted name; "" if it has none, or there is no such setting."""
    part = name.split(".")[0]
    rows = settings((part,)) if part in PARTS else []
    return next((row.unit for row in rows if row.name == name), "")


def markdown(rows: list[Setting]) -> list[str]:
    """A table in Markdown for each key of a model, in lines."""
    lines: list[str] = []
    for part in dict.fromkeys(row.name.split(".")[0] for row in rows):
        own = [row._replace(name=f"`{row.name}`") for row in rows if row.name.split(".")[0] == part]
        cells = [("setting", "unit", "default", "values", "meaning"), *own]
        wide = [max(len(row[column]) for row in cells) for column in range(3)]
        table = []
        for row in cells:
            padded = [cell.ljust(width) for cell, width in zip(row, wide, strict=False)]
            table.append(f"| {' | '.join([*padded, *(cell.replace('|', '/') for cell in row[len(wide) :])])} |")
        lines += [*([""] if lines else []), f"## {part}", "", table[0], "|---" * 5 + "|", *table[1:]]
    return lines


def _below(struct: type[msgspec.Struct], key: str, name: str) -> Iterator[Setting]:
    """The setting of this key, or those of the struct that it holds."""
    about = inspection.type_info(struct)
    assert isinstance(about, inspection.StructType)
    (field,) = (field for field in about.fields if field.encode_name == key)
    kind = field.type.type if isinstance(field.type, inspection.Metadata) else field.type
    members = kind.types if isinstance(kind, inspection.UnionType) else (kind,)
    inner = next((one for one in members if isinstance(one, inspection.StructType)), None)
    if inner is not None:
        for below in inner.fields:
            yield from _below(inner.cls, below.encode_name, f"{name}.{below.encode_name}")
        return
    comment = _comments(struct).get(key, "")
    unit = DECLARED[key].unit if struct is Material else ""
    if (begins := UNIT.match(comment)) is not None:
        unit, comment = unit or begins[1], comment[begins.end() :]
    values = " or ".join(described(field.type))
    if field.required:
        default = "required"
    else:
        value: Any = field.default if field.default is not msgspec.NODEFAULT else field.default_factory()
        if value is None or value == ():
            default = "none"
        elif isinstance(value, bool):
            default = str(value).lower()
        else:
            default = listed(value).replace(" or ", ", ") if isinstance(value, tuple) else f"{value}"
    yield Setting(name, unit, default, values, comment)


@cache
def _comments(struct: type[msgspec.Struct]) -> dict[str, str]:
    """The comment beside each field of a struct, in its source."""
    comment_by_field = {}
    for each in (Elastic, *CHOSEN) if struct is Material else (struct,):
        source = textwrap.dedent(inspect.getsource(each))
        comments, alone = dict[int, str](), set[int]()
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT and not token.string.startswith("# type:"):
                comments[token.start[0]] = token.string.removeprefix("#").split("  # type:")[0].strip()
                if not token.line[: token.start[1]].strip():
                    alone.add(token.start[0])
        (declared,) = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef))
        for node in declared.body:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                last = node.end_lineno or node.lineno
                lines = [line for line in range(node.lineno, last + 1) if line in comments]
                while lines and last + 1 in alone:
                    last += 1
                    lines.append(last)
                lines = lines or [line for line in (node.lineno - 1,) if line in alone]
                comment_by_field[node.target.id] = " ".join(comments[line] for line in lines)
    return comment_by_field
