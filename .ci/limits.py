"""Limits that keep every file readable in one sitting: python .ci/limits.py [FOLDER ...]

No file above 800 lines, no function above 60, no function that takes more than 8 positional parameters, `self` aside.
Constructors, and kernels that numba compiles, take as many as they need.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

LINES = 800  # of a file
LENGTH = 60  # lines of a function, with its signature and docstring
POSITIONAL = 8  # parameters of a function

FOLDERS = ("pdmesh", "pdsolve", "pdpost", "tests", "benchmarks", ".ci")
COMPILED = ("njit", "cached_njit", "jit", "vectorize", "guvectorize", "overload", "intrinsic")


def broken(path: Path) -> Iterator[str]:
    """What is over a limit in a file, a line each: place, found, expected."""
    text = path.read_text(encoding="utf-8")
    if (lines := len(text.splitlines())) > LINES:
        yield f"{path}: found {lines} lines, expected {LINES} at most"
    for function in ast.walk(ast.parse(text, str(path))):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        where = f"{path}:{function.lineno}: {function.name}"
        length = (function.end_lineno or function.lineno) - function.lineno + 1
        if length > LENGTH:
            yield f"{where}: found {length} lines, expected {LENGTH} at most"
        positional = [one.arg for one in (*function.args.posonlyargs, *function.args.args)]
        count = len(positional) - (positional[:1] in (["self"], ["cls"]))
        free = function.name == "__init__" or any(map(_compiles, function.decorator_list))
        if count > POSITIONAL and not free:
            yield f"{where}: found {count} positional parameters, expected {POSITIONAL} at most"


def _compiles(decorator: ast.expr) -> bool:
    """Whether a decorator is numba's, or ours: njit, numba.njit, njit(parallel=True)."""
    called = decorator.func if isinstance(decorator, ast.Call) else decorator
    return (called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")) in COMPILED


def broken_in(folder: str) -> Iterator[str]:
    """What is wrong in a folder."""
    for path in sorted(Path(folder).rglob("*.py")):
        yield from broken(path)


def main(folders: list[str]) -> int:
    """Say what is over a limit; 1 if anything is."""
    said = [line for folder in folders or FOLDERS for line in broken_in(folder)]
    print("\n".join(said or ["Files and functions are within their limits"]))
    return bool(said)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
