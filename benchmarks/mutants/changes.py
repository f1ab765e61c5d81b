"""What may be changed in a file of the packages so that it is wrong: one operator, constant, sign or statement."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from typing import NamedTuple

COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
}
ARRANGED = (
    "pdpost/figures/",
    "pdpost/exports/page",
    "pdmesh/reports/preview",
    "pdmesh/reports/style",
)  # numbers: looks alone


class Change(NamedTuple):
    """A piece of a file's text, and what it becomes."""

    start: int  # of the piece, in characters
    end: int
    becomes: str
    name: str  # of the functions and classes it is in, dotted; empty outside of all
    line: int  # from 1

    def applied(self, text: str) -> str:
        return text[: self.start] + self.becomes + text[self.end :]


def changes(file: str, text: str) -> list[Change]:
    """All that may be changed in a file, in its order."""
    offsets = [0]
    for line in text.splitlines(keepends=True):
        offsets.append(offsets[-1] + len(line))
    lines = text.splitlines()

    def place(row: int, column: int) -> int:  # a column counts bytes
        return offsets[row - 1] + len(lines[row - 1].encode()[:column].decode())

    numbers = not file.startswith(ARRANGED)
    found = []
    for node, name in _walked(ast.parse(text), ""):
        for other in _changed(node, numbers):
            start, end = place(node.lineno, node.col_offset), place(node.end_lineno, node.end_col_offset)
            written = ast.unparse(other)
            becomes = written if isinstance(other, ast.stmt) else f"({written})"
            found.append(Change(start, end, becomes, name, node.lineno))
    return found


def _walked(node: ast.AST, name: str) -> Iterator[tuple[ast.AST, str]]:
    """The nodes that count, with what they are in: neither types, nor messages, nor how a function is compiled."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
        if isinstance(node, ast.Raise):
            yield node, name
        return
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        name = f"{name}.{node.name}".lstrip(".")
    yield node, name
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _walked(child, name)


def _changed(node: ast.AST, numbers: bool) -> Iterator[ast.AST]:
    """What a node may become."""
    other = copy.copy(node)
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARED:
        other.ops = [COMPARED[type(node.ops[0])](), *node.ops[1:]]
        yield other
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in COMPUTED:
        if not any(map(_worded, ast.iter_child_nodes(node))):
            other.op = COMPUTED[type(node.op)]()
            yield other
    elif isinstance(node, ast.BoolOp):
        other.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield other
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant):
        yield from _constants(node, numbers)
    elif isinstance(node, ast.Raise | ast.Continue | ast.Break) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield ast.Pass()


def _worded(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _constants(node: ast.Constant, numbers: bool) -> Iterator[ast.Constant]:
    if isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif numbers and isinstance(node.value, int):
        yield ast.Constant(node.value + 1)
    elif numbers and isinstance(node.value, float):
        yield ast.Constant(node.value * 2 if node.value else 1.0)
