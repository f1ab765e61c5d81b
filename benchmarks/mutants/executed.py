"""Which tests execute which functions, as recorded: the cheapest few that reach each statement."""

from __future__ import annotations

import json
import lzma
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutants import recording, trees
from benchmarks.mutants.changes import Change
from benchmarks.mutants.functions import Function, assigned, functions
from benchmarks.mutants.likely import cheapest_first, product, read, tests

KEPT = Path(__file__).parent / "executed.json.xz"
EACH = 6  # tests for each statement
MOST = 12  # tests for each change
FEW = 3  # tests: it may write what is compiled, as the first test does that needs it; those of its callers count too
REMOVES = 6  # calls between what is seen and what is compiled
PARAMETERS = re.compile(r"\[.*\]$", re.DOTALL)


class Test(NamedTuple):
    """A test and what it costs."""

    name: str  # as pytest has it
    seconds: float


class Reached(NamedTuple):
    """A test that reaches a function."""

    test: int
    statements: int  # a bit for each that it executes


class Executed(NamedTuple):
    """What was recorded: the tests of each function, those first that execute little."""

    tests: list[Test]
    functions: dict[str, tuple[str, list[Reached]]]  # by "FILE:NAME": the digest of the function, its tests


def bare(test: str) -> str:
    """A test's name without parameters."""
    return PARAMETERS.sub("", test)


# ---- what was recorded


def record() -> int:
    """Run the quick tests in one process and keep what they execute; takes half an hour. Returns pytest's exit code."""
    if sys.version_info < (3, 12):
        raise SystemExit(f"Python {sys.version.split()[0]}: found no sys.monitoring, expected Python 3.12 or newer")
    with tempfile.TemporaryDirectory() as folder:
        tree, lines = trees.copied(Path(folder) / "tree"), Path(folder) / "lines"
        files = cheapest_first([path.relative_to(trees.ROOT).as_posix() for path in tests(trees.ROOT)])
        words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", recording.__name__]
        more = {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", recording.VARIABLE: str(lines)}
        words += ["--tb=no", "-m", "not endurance", *files]
        code = subprocess.run(words, cwd=tree, env=os.environ | more, check=False).returncode
        keep(trees.ROOT, lines)
    return code


def keep(root: Path, lines: Path) -> None:
    """Keep the cheapest tests of each function, of what `recording` wrote of a checkout."""
    written = [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines() if line.endswith("}")]
    by_line, digests = _places(root, {file for one in written for file in one["lines"]})
    reached = []
    for one in written:
        found: dict[str, int] = {}
        for file, numbers in one["lines"].items():
            for name, statement in (by_line[file, line] for line in numbers if (file, line) in by_line):
                found[name] = found.get(name, 0) | 1 << statement
        reached.append(found)
    order = sorted(range(len(written)), key=lambda i: (written[i]["seconds"] + 0.05) * (20 + len(reached[i])))
    known: dict[str, list[Reached]] = {}
    seen: dict[tuple[str, int], set[str]] = {}  # the tests of a statement, whatever their parameters
    for i in order:
        test = bare(written[i]["test"])
        for name, bits in reached[i].items():
            places = [(name, bit) for bit in range(bits.bit_length()) if bits >> bit & 1]
            new = [place for place in places if test not in seen.setdefault(place, set()) and len(seen[place]) < EACH]
            if new:
                known.setdefault(name, []).append(Reached(i, bits))
                for place in new:
                    seen[place].add(test)
    used = sorted({one.test for found in known.values() for one in found})
    names = {old: new for new, old in enumerate(used)}
    text = json.dumps(
        {
            "tests": [(written[i]["test"], round(written[i]["seconds"], 2)) for i in used],
            "functions": {
                name: (digests[name], [(names[one.test], f"{one.statements:x}") for one in known[name]])
                for name in sorted(known)
            },
        },
        separators=(",", ":"),
    )
    KEPT.write_bytes(lzma.compress(text.encode(), preset=9))


def _places(root: Path, files: Iterable[str]) -> tuple[dict[tuple[str, int], tuple[str, int]], dict[str, str]]:
    """The function and the statement of each line of some files, and the functions' digests."""
    by_line, digests = {}, {}
    for file in files:
        for function in functions((root / file).read_text(encoding="utf-8")).values():
            digests[f"{file}:{function.name}"] = function.digest
            for line, number in function.statements.items():
                by_line[file, line] = f"{file}:{function.name}", number
    return by_line, digests


@cache
def executed() -> Executed:
    """What was recorded last; nothing where nothing was."""
    if not KEPT.exists():
        return Executed([], {})
    found = json.loads(lzma.decompress(KEPT.read_bytes()))
    return Executed(
        [Test(*one) for one in found["tests"]],
        {
            name: (digest, [Reached(test, int(bits, 16)) for test, bits in reached])
            for name, (digest, reached) in found["functions"].items()
        },
    )


# ---- the tests of a change


def those_of(root: Path, file: str, change: Change) -> list[str]:
    """Tests that execute what a change is in, as recorded: those of its statement first; none where nothing is known.

    What is compiled is executed where the function that calls it is, and so are constants and classes where they are
    named.
    """
    text = (root / file).read_text(encoding="utf-8")
    own = functions(text).get(change.name)
    found: list[Reached] = []
    if own is not None and f"{file}:{own.name}" in executed().functions:
        statement = own.statements.get(change.line)
        found = _of(file, own, statement)
        hand_on = [one for one in functions(text).values() if statement in own.said.get(one.name, ())]
        handed = _names(reached for one in hand_on for reached in _of(file, one, None))[: MOST // 2]
        if handed and found:  # what all commands execute to say what each does
            return list(dict.fromkeys(handed + _names(found)))
        if not found or len({one.test for one in found}) >= FEW:
            return _names(found)
    outer, _, inner = change.name.rpartition(".")
    is_method = outer[:1].isupper() and not inner.startswith("__")
    words = frozenset({inner if is_method else change.name.partition(".")[0]} - {""}) or assigned(text, change.line)
    done = set[str]()
    files = {file}
    for _ in range(REMOVES):
        files |= {user for one in files for user in _importers(root, one)}
        callers = [(user, function) for user in sorted(files) for function in _callers(root, user, words)]
        for user, function in callers:
            for statement in {number for word in words for number in function.said.get(word, ())}:
                found += _of(user, function, statement)
        if len({one.test for one in found}) >= FEW:
            break
        done |= words
        words = frozenset(word for _, one in callers for word in (one.name.partition(".")[0], *one.also)) - done
    return _names(found)


def _of(file: str, function: Function, statement: int | None) -> list[Reached]:
    """The recorded tests of a function, those of a statement first where the function is as it was."""
    digest, found = executed().functions.get(f"{file}:{function.name}", ("", []))
    if digest != function.digest or statement is None:
        return found
    return [one for one in found if one.statements >> statement & 1]


def _names(found: Iterable[Reached]) -> list[str]:
    """The cheapest tests of these, each once."""
    known = executed().tests
    named = dict.fromkeys(known[one.test] for one in found)
    few = sorted(list(named)[: 3 * MOST], key=lambda test: test.seconds)[:MOST]
    return [test.name for test in few]


@cache
def _importers(root: Path, file: str) -> frozenset[str]:
    """The files of the packages that import from a file."""
    modules = {path: name for name, path in product(root).items()}
    name = modules[root / file]
    return frozenset(path.relative_to(root).as_posix() for path in modules if name in read(path).imports)


def _callers(root: Path, file: str, words: frozenset[str]) -> Iterator[Function]:
    """The functions of a file that name one of these."""
    for one in functions((root / file).read_text(encoding="utf-8")).values():
        if not words.isdisjoint(one.said):
            yield one
