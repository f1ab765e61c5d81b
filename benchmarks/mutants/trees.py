"""Copies of the checkout in which one thing is wrong at a time, and tests that are run there."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutants import kept as kept_kernels
from benchmarks.mutants import order
from benchmarks.mutants.kept import VARIABLE

ROOT = Path(__file__).parent.parent.parent
LEFT_OUT = (".git", ".venv", "__pycache__", ".*_cache", ".hypothesis", "*.sqlite", "*.sqlite-*")
MADE = {"demo", "site", "build", "dist"}  # by `make`, beside the sources
IN_KERNELS = ("pdsolve/", "pdmesh/model/")  # kernels are made of files in here ...
LAWS = "pdsolve/laws/"  # ... and of functions of these that nothing marks
COMPILED = re.compile(r"njit|overload|register_jitable|vectorize")
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?\.py(?:::\w+(?:\[.*?\](?= - |$))?)?)", re.MULTILINE)
RUNNING = re.compile(r"^(tests/\S+\.py::.*?) ?$", re.MULTILINE)
NO_TESTS, TIMED_OUT = 5, -1


class Ran(NamedTuple):
    """What became of tests."""

    code: int  # pytest's own, or TIMED_OUT
    said: str
    seconds: float

    @property
    def failed(self) -> str | None:
        """The first test, or file of tests, that failed."""
        found = FAILED.search(self.said)
        return found[1] if found else None

    @property
    def running(self) -> str | None:
        """The test that was running when the time was up."""
        found = RUNNING.findall(self.said)
        return found[-1] if found else None


def copied(folder: Path) -> Path:
    """A copy of the checkout in a folder that is not there yet."""
    left_out = shutil.ignore_patterns(*LEFT_OUT)
    shutil.copytree(ROOT, folder, ignore=lambda of, names: left_out(of, names) | (MADE if Path(of) == ROOT else set()))
    return folder


def run(
    tree: Path,
    tests: Sequence[str],
    limit: float,
    *,
    slow: bool = False,
    kept: bool = False,
    first: Sequence[str] = (),
    left_out: Iterable[str] = (),
    collect: bool = False,
) -> Ran:
    """Run these tests of a tree until one fails, for so many seconds at most; slow ones if that is said, or if
    they are among the first.

    Kernels compiled before, in any tree beside this one, are used if they are `kept`. Some come first, some are left
    out; with `collect` nothing is run, but only imported.
    """
    words = [sys.executable, "-m", "pytest", "-v", "-x", "-p", "no:cacheprovider", "--tb=no", *tests]
    by_name = any("::" in test for test in tests)  # chosen one by one, whatever their tier
    words += ["-m", "not endurance"]
    words += ["-p", kept_kernels.__name__] if kept else []
    words += ["-p", order.__name__] + (["--collect-only"] if collect else [])
    kernels, shared, named = (tree.with_name(name) for name in (f"{tree.name} kernels", "kernels", f"{tree.name}.json"))
    named.write_text(json.dumps([list(first), sorted(left_out), slow or by_name]), encoding="utf-8")
    for folder, is_by_state in ((kernels, True), (shared, False)):
        if not folder.exists():
            folder.mkdir(mode=0o700)
            _begin(folder, is_by_state)
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "PYTHONUNBUFFERED": "1"}
    environment |= {"NUMBA_CACHE_DIR": str(kernels), VARIABLE: str(shared), order.VARIABLE: str(named)}
    began, said = time.perf_counter(), tree / "said"
    with said.open("wb") as out:
        child = subprocess.Popen(
            words, cwd=tree, stdout=out, stderr=out, stdin=subprocess.DEVNULL, env=environment, start_new_session=True
        )
        try:
            code = child.wait(limit)
        except subprocess.TimeoutExpired:
            code = TIMED_OUT
        finally:
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()
    return Ran(code, said.read_text(errors="replace"), time.perf_counter() - began)


def _begin(folder: Path, is_by_state: bool) -> None:
    """Begin a folder with the kernels that this checkout compiled, as `jit_cache` names their places or as `kept`."""
    from pdsolve.codegen import jit_cache, kernel_sources  # slow

    for file in kernel_sources.with_kernels():
        own = jit_cache.folder_of(file)
        place = Path(own.parent.name) / own.name if is_by_state else Path(file).relative_to(ROOT).with_suffix("")
        with suppress(OSError, shutil.Error):  # another process clears it meanwhile
            shutil.copytree(own, folder / place)


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
    marked = "\n".join(ast.unparse(one) for one in every if COMPILED.search(ast.unparse(one)))
    return all(
        isinstance(one, ast.FunctionDef)
        and not COMPILED.search(ast.unparse(one))
        and not re.search(rf"\b(?<!def ){one.name}\b(?!\()", marked)  # nor what an overload returns
        for one in _different(every, ast.parse(after).body)
    )


def _different(before: Sequence[ast.stmt], after: Sequence[ast.stmt]) -> Iterator[ast.stmt | None]:
    """Statements that differ; of classes, those in them."""
    for one, other in zip_longest(before, after):
        if isinstance(one, ast.ClassDef) and isinstance(other, ast.ClassDef) and one.name == other.name:
            yield from _different(one.body, other.body)
        elif one is None or other is None or ast.dump(one) != ast.dump(other):
            yield one
