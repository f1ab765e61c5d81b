"""Copies of the checkout in which one thing is wrong at a time, and tests that are run there."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import zip_longest
from pathlib import Path

from mutants import stored_kernels
from mutants.stored_kernels import VARIABLE

ROOT = Path(__file__).parent.parent.parent
LEFT_OUT = (".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "*.sqlite", "*.sqlite-*")
MADE = {"demo", "site", "build", "dist"}  # by `make`, beside the sources
IN_KERNELS = ("pdsolve/", "pdmesh/model/")  # kernels are made of files in here ...
LAWS = "pdsolve/laws/"  # ... and of functions of these that nothing marks
COMPILED = re.compile(r"njit|overload|register_jitable|vectorize")


def copied(folder: Path) -> Path:
    """A copy of the checkout in a folder that is not there yet."""
    left_out = shutil.ignore_patterns(*LEFT_OUT)
    shutil.copytree(ROOT, folder, ignore=lambda of, names: left_out(of, names) | (MADE if Path(of) == ROOT else set()))
    return folder


def first_failure(tree: Path, tests: Sequence[str], *, with_kernels: bool) -> str:
    """The first of these tests of a tree that fails, as pytest names it, with kernels compiled before if that is said.

    It is empty where all pass; each test has its own limit of time.

    Raises
    ------
    RuntimeError
        Where the tests could not be run; the message has the end of what pytest wrote.
    """
    words = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", "--tb=no", "-m", "not endurance", *tests]
    words += ["-p", stored_kernels.__name__] if with_kernels else []
    kernels, shared = (tree.with_name(name) for name in (f"{tree.name} kernels", "kernels"))
    for folder, is_by_state in ((kernels, True), (shared, False)):
        if not folder.exists():
            folder.mkdir(mode=0o700)
            _begin(folder, is_by_state)
    environment = {**os.environ, "PYTHONPATH": f"{tree}{os.pathsep}{tree / 'tests'}", "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"NUMBA_CACHE_DIR": str(kernels), VARIABLE: str(shared)}
    done = subprocess.run(words, cwd=tree, env=environment, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(
            f"{' '.join(tests)}: these tests could not be run\n{done.stdout[-4000:]}{done.stderr[-400:]}"
        )
    return "\n".join(line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR")))


def _begin(folder: Path, is_by_state: bool) -> None:
    """Begin a folder with the kernels that this checkout compiled, named as in `jit_cache` or `stored_kernels`."""
    from pdsolve.codegen import jit_cache, kernel_sources  # slow

    for file in kernel_sources.with_kernels():
        compiled = jit_cache.folder_of(file)
        by_state, by_file = Path(compiled.parent.name) / compiled.name, Path(file).relative_to(ROOT).with_suffix("")
        with suppress(OSError, shutil.Error):  # another process clears it meanwhile
            shutil.copytree(compiled, folder / (by_state if is_by_state else by_file))


@contextmanager
def broken(tree: Path, file: str, text: str) -> Iterator[bool]:
    """A tree with another text in a file; whether what was compiled may be used: no kernel is another."""
    path = tree / file
    before, stamp = path.read_text(encoding="utf-8"), path.stat().st_mtime_ns
    path.write_text(text, encoding="utf-8")
    try:
        yield same_kernels(file, before, text)
    finally:
        path.write_text(before, encoding="utf-8")
        os.utime(path, ns=(stamp, stamp))


def same_kernels(file: str, before: str, after: str) -> bool:
    """Whether a file with these texts makes the same kernels: what differs is in functions that none is made of."""
    if not file.startswith(IN_KERNELS):
        return True
    if file.startswith(LAWS):
        return False
    every = ast.parse(before).body
    marked = "\n".join(ast.unparse(statement) for statement in every if COMPILED.search(ast.unparse(statement)))
    return all(
        isinstance(statement, ast.FunctionDef)
        and not COMPILED.search(ast.unparse(statement))
        and not re.search(rf"\b(?<!def ){statement.name}\b(?!\()", marked)  # nor what an overload returns
        for statement in _different(every, ast.parse(after).body)
    )


def _different(before: Sequence[ast.stmt], after: Sequence[ast.stmt]) -> Iterator[ast.stmt | None]:
    """Statements that differ; of classes, those in them."""
    for old, new in zip_longest(before, after):
        if isinstance(old, ast.ClassDef) and isinstance(new, ast.ClassDef) and old.name == new.name:
            yield from _different(old.body, new.body)
        elif old is None or new is None or ast.dump(old) != ast.dump(new):
            yield old
