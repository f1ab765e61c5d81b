"""A sample of what may be wrong in the packages, drawn from every folder, and how much of it tests notice."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

from benchmarks.mutants import trees
from benchmarks.mutants.changes import Change, changes
from benchmarks.mutants.equivalent import EQUIVALENT
from benchmarks.mutants.likely import cheapest_first, likely, product

HANGS = 30.0  # s that a test may take longer than it does in what is right


class Drawn(NamedTuple):
    """A change of a file."""

    file: str
    change: Change
    line: str  # of the file, as it is


class Fate(NamedTuple):
    """What became of a mutant."""

    killed: bool
    by: str  # the test that noticed
    seconds: float


def drawn(root: Path, seed: int) -> Iterator[Drawn]:
    """Changes of the packages in a random order that goes round the folders; none that is known to change nothing."""
    folders: dict[Path, list[Path]] = {}
    for path in product(root).values():
        folders.setdefault(path.parent, []).append(path)
    chance, order = random.Random(seed), sorted(folders)
    chance.shuffle(order)
    while True:
        for folder in order:
            path = chance.choice(folders[folder])
            file, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
            known = changes(file, text)
            if not known:
                continue
            change = chance.choice(known)
            line = text.splitlines()[change.line - 1].strip()
            if (file, line, change.becomes) not in EQUIVALENT:
                yield Drawn(file, change, line)


def fate(tree: Path, right: Path, one: Drawn, limit: float) -> Fate:
    """Whether a test of a tree fails with this change that does not in the tree that is right."""
    tests = cheapest_first(likely(trees.ROOT, one.file, one.change.name))
    text = (tree / one.file).read_text(encoding="utf-8")
    with trees.broken(tree, one.file, one.change.applied(text)) as kept:
        ran = trees.run(tree, tests, limit, kept=kept)
        if ran.code in (0, trees.NO_TESTS):
            return Fate(False, "", ran.seconds)
        if ran.code == trees.TIMED_OUT:
            return Fate(*_hangs(tree, right, ran.running, limit), ran.seconds)
    suspect = ran.failed or tests[0]
    passes = trees.run(right, [suspect], limit, kept=True).code in (0, trees.NO_TESTS)
    return Fate(passes, suspect if passes else f"{suspect} fails anyway", ran.seconds)


def _hangs(tree: Path, right: Path, test: str | None, limit: float) -> tuple[bool, str]:
    """Whether a test that ends where all is right does not where it is not."""
    if test is None:
        return False, "time was up"
    sound = trees.run(right, [test], limit, kept=True)
    if sound.code == 0 and trees.run(tree, [test], sound.seconds + HANGS).code == trees.TIMED_OUT:
        return True, f"{test} does not end"
    return False, "time was up"


def measured(number: int, seed: int, limit: float, jobs: int) -> int:
    """Break `number` places, `jobs` at a time, `limit` seconds for the tests of each; how many were noticed."""
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(jobs) as pool:
        folder, free = Path(name), SimpleQueue[tuple[Path, Path]]()
        for job in range(jobs):
            free.put((trees.copied(folder / f"broken {job}"), trees.copied(folder / f"right {job}")))

        def one(mutant: Drawn) -> bool:
            pair = free.get()
            try:
                found = fate(*pair, mutant, limit)
            finally:
                free.put(pair)
            what = f"{mutant.file}:{mutant.change.line}: {mutant.line} -> {mutant.change.becomes}"
            by = f" by {found.by}" if found.killed else f" ({found.by})" if found.by else ""
            print(f"{'killed' if found.killed else 'SURVIVED'}, {found.seconds:.0f} s: {what}{by}", flush=True)
            return found.killed

        return sum(pool.map(one, islice(drawn(trees.ROOT, seed), number)))
