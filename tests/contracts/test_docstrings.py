"""A docstring says what the thing is to a reader who sees it alone, as an editor shows it on hover."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from plates import ROOT

REFERRING = ("The same", "As ", "Likewise", "That ", "Those ", "Its ", "Of ")  # to a docstring that is elsewhere


def referring(source: str) -> Iterator[str]:
    """Line and docstring of each definition whose docstring begins by referring to another one."""
    for item in ast.walk(ast.parse(source)):
        if isinstance(item, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            words = ast.get_docstring(item) or ""
            if words.startswith(REFERRING):
                yield f"{item.lineno}: {item.name}: {words.splitlines()[0]}"


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("package", ["pdmesh", "pdsolve", "pdpost"])
def test_no_docstring_refers_to_another(package: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for line in referring(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize("words", ["The same of a node.", "As in `Operator`.", "That of a tip, m."])
def test_one_that_does_is_found(words: str) -> None:
    assert list(referring(f'def held():\n    """{words}"""\n')) == [f"1: held: {words}"]
    assert not list(referring('def held():\n    """The energy of a node, J."""\n'))
