"""The tests that are most likely to notice what is wrong in a function: who names it, who imports its file."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

PACKAGES = ("pdmesh", "pdsolve", "pdpost")
FILES = 5  # of tests, for one mutant
BY_COST = ("unit", "laws", "geometries", "contracts", "cli", "formats", "sandbox", "site", "verification", "stability")
SLOW = "pytestmark = pytest.mark.slow"


class Read(NamedTuple):
    """What a file of Python says."""

    words: frozenset[str]  # names in it
    imports: frozenset[str]  # modules and their names, dotted


@cache
def read(path: Path) -> Read:
    """The words and imports of a file."""
    text = path.read_text(encoding="utf-8")
    imports = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            imports |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return Read(frozenset(re.findall(r"[A-Za-z_]\w+", text)), frozenset(imports))


@cache
def product(root: Path) -> dict[str, Path]:
    """The files of the packages by their dotted names."""
    found = {}
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tests(root: Path) -> list[Path]:
    """The files of quick tests."""
    found = sorted((root / "tests").rglob("test_*.py"))
    return [path for path in found if SLOW not in path.read_text(encoding="utf-8")]


def likely(root: Path, file: str, name: str) -> list[str]:
    """Files of tests for a function or a class of a file, its name dotted, the likeliest first."""
    parts = PurePosixPath(file).with_suffix("").parts
    module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
    stem = parts[-1] if parts[-1] != "__init__" else parts[-2]
    named = _users(root, module, name)

    def score(path: Path) -> float:
        said = read(path)
        worth = 4.0 * (module in said.imports) + sum(named[word] for word in said.words & named.keys())
        same = 5.0 * (path.stem.removeprefix("test_") == stem) + 1.5 * (stem in path.stem)
        folders = set(path.relative_to(root).parts[:-1])
        return worth + same + 0.5 * len(folders & set(parts[:-1])) - 1e-5 * path.stat().st_size

    return [path.relative_to(root).as_posix() for path in sorted(tests(root), key=score, reverse=True)[:FILES]]


def cheapest_first(tests: list[str]) -> list[str]:
    """Files of tests in the order of what their folders mostly cost."""
    return sorted(tests, key=lambda test: BY_COST.index(PurePosixPath(test).parts[1]))


def _users(root: Path, module: str, name: str) -> dict[str, float]:
    """What a name of a module is worth in a test: its own, and those of functions that use it, at several removes."""
    worth: dict[str, float] = {}
    names, modules = set(name.split(".")) if name else set(_functions(product(root)[module])), {module}
    for value in (4.0, 2.0, 1.0, 0.5):
        for word in names:
            if len(word) > 3:
                worth.setdefault(word, value / np.log2(1 + _files(root, word)))
        users = {other for other, path in product(root).items() if modules & read(path).imports} | modules
        names = set().union(*(_speak(product(root)[other], frozenset(names)) for other in users)) - worth.keys()
        modules = users
    return worth


@cache
def _files(root: Path, word: str) -> int:
    """Of tests, that have a word; one at least."""
    return max(sum(word in read(path).words for path in tests(root)), 1)


@cache
def _functions(path: Path) -> dict[str, frozenset[str]]:
    """The functions and classes of a file, and the names in them."""
    found = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found[node.name] = frozenset(getattr(one, "id", getattr(one, "attr", "")) for one in ast.walk(node))
    return found


def _speak(path: Path, names: frozenset[str]) -> set[str]:
    """Functions and classes of a file that use one of these names."""
    return {own for own, words in _functions(path).items() if names & words}
