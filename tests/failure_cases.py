"""The page of failures: which cases there are, and how the page is put together."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from pdsolve.model import ModelWarning

FOLDER = Path(__file__).parent / "stability"
INTRODUCTION = """\
# Known limitations

Each limitation (failure) of a method has its cause, the message that notices it, and its cure.

Written by `make failures` from the tests in `tests/stability`: each case below is a test that reproduces the failure
and the cure. Every number was measured, and every message printed, while the tests ran.
"thesis" and "conservative" are the modes of
`pdsolve` (see [the programs](../getting_started/overview.md)). A warning is one line on stderr; an error is one line
and an exit code of 2, or 3 where a run had to be stopped; `model` in a message stands for the name of the model's
file.
"""


class Said(NamedTuple):
    """What a program has said."""

    code: int
    out: list[str]  # lines on stdout
    err: list[str]  # on stderr


def theme_of(docstring: str) -> str:
    """What a test or a file of tests is about: the first line of its docstring."""
    return docstring.strip().splitlines()[0].rstrip(".")


def reason_of(docstring: str) -> str:
    """Why a case fails: its docstring after the first line, on one line."""
    return " ".join(docstring.strip().partition("\n")[2].split())


def cases() -> list[tuple[str, str]]:
    """All (theme, heading) in the sources, in order."""
    return [(theme, theme_of(docstring)) for theme, docstring in described()]


def described() -> list[tuple[str, str]]:
    """All (theme, docstring) in the sources, in order: every test that takes the fixture `failure`."""
    found = []
    for source in sorted(FOLDER.glob("test_*.py")):
        tree = ast.parse(source.read_text(encoding="utf-8"))
        for item in tree.body:
            if isinstance(item, ast.FunctionDef) and "failure" in [argument.arg for argument in item.args.args]:
                found.append((theme_of(ast.get_docstring(tree) or ""), ast.get_docstring(item) or ""))
    return found


def page(told: dict[tuple[str, str], str]) -> str:
    """The page of all cases, in the order of the sources."""
    parts, last = [INTRODUCTION], ""
    for theme, heading in cases():
        if theme != last:
            parts.append(f"## {theme}\n")
            last = theme
        parts.append(told[theme, heading] + "\n")
    return "\n".join(parts)


@contextmanager
def saying() -> Iterator[list[str]]:
    """The warnings of a model or a run, as their texts, after it."""
    lines: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("error")
        warnings.simplefilter("always", ModelWarning)
        yield lines
    lines += [str(warning.message) for warning in caught]
