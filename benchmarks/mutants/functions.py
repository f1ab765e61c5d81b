"""The functions of a file and the statements in them, so that what was recorded of a file is found in a later one."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

Defined = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class Function(NamedTuple):
    """A function of a file, or a method."""

    name: str  # dotted, with the classes and functions it is in
    digest: str  # of its text, wherever it is
    statements: dict[int, int]  # its own lines, from 1, and the numbers of the statements they belong to
    said: dict[str, set[int]]  # the names in it, and the numbers of the statements they are in
    also: frozenset[str]  # names it is called by besides its own: what it overloads


@cache
def functions(text: str) -> dict[str, Function]:
    """The functions of a text of Python by their names."""
    lines = text.splitlines()
    return {one.name: one for one in _functions(ast.parse(text), "", lines)}


@cache
def assigned(text: str, line: int) -> frozenset[str]:
    """What a statement outside of all functions and classes that is on a line gives values to."""
    for node in ast.parse(text).body:
        if node.lineno <= line <= (node.end_lineno or node.lineno):
            return frozenset(
                one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)
            )
    return frozenset()


def _functions(node: ast.AST, within: str, lines: list[str]) -> Iterator[Function]:
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, Defined):
            yield from _functions(child, within, lines)
            continue
        name = f"{within}.{child.name}".lstrip(".")
        if not isinstance(child, ast.ClassDef):
            text = "\n".join(line.strip() for line in lines[child.lineno - 1 : child.end_lineno])
            statements: dict[int, int] = {}
            said: dict[str, set[int]] = {}
            for number, one in enumerate(_own(child.body)):
                end = one.lineno if isinstance(one, Defined) else one.end_lineno or one.lineno
                statements |= dict.fromkeys(range(one.lineno, end + 1), number)
                for word in _words(one):
                    said.setdefault(word, set()).add(number)
            for inner in ast.walk(child):
                if inner is not child and isinstance(inner, Defined):
                    for line in range(inner.lineno + 1, (inner.end_lineno or inner.lineno) + 1):
                        statements.pop(line, None)
            also = frozenset(word for one in child.decorator_list for word in _words(one))
            yield Function(name, hashlib.sha256(text.encode()).hexdigest()[:8], statements, said, also)
        yield from _functions(child, name, lines)


def _own(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements and those in them, not those of functions and classes in them."""
    for one in body:
        yield one
        if isinstance(one, Defined):
            continue
        for field in ("body", "orelse", "finalbody"):
            yield from _own(getattr(one, field, []))
        for handler in (*getattr(one, "handlers", ()), *getattr(one, "cases", ())):
            yield from _own(handler.body)


def _words(node: ast.AST) -> Iterator[str]:
    """The names in a statement; of one that holds others, in its head alone."""
    for field, value in ast.iter_fields(node):
        if isinstance(node, ast.stmt) and field in ("body", "orelse", "finalbody", "handlers", "cases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.Name):
                yield child.id
            elif isinstance(child, ast.Attribute):
                yield child.attr
            if isinstance(child, ast.AST):
                yield from _words(child)
