"""A sample of what may be wrong in the packages, drawn from every folder, and how much of it tests notice."""

from __future__ import annotations

import random
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from benchmarks.mutants import trees
from benchmarks.mutants.changes import Change, changes
from benchmarks.mutants.equivalent import EQUIVALENT
from benchmarks.mutants.executed import those_of
from benchmarks.mutants.likely import cheapest_first, likely, product

SOON, HANGS = 20.0, 30.0  # s: a test that ends so soon in what is right may take so much longer in what is not
COMPILED = 2  # times the limit, where kernels are compiled anew
PATIENCE = 4  # times the limit for a test that failed, where all is right
KILLED, SURVIVED, UNDECIDED = "killed", "SURVIVED", "undecided"


class Drawn(NamedTuple):
    """A change of a file."""

    file: str
    change: Change
    line: str  # of the file, as it is


class Fate(NamedTuple):
    """What became of a mutant."""

    what: str  # KILLED, SURVIVED, or UNDECIDED: the machine was too slow
    by: str  # the test that noticed, or what else there is to say
    seconds: float


class Pair(NamedTuple):
    """A copy of the checkout to be broken, and one that stays right."""

    broken: Path
    right: Path
    passing: set[str]  # tests known to pass in what is right
    failing: set[str]  # and those known not to


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


def fate(pair: Pair, one: Drawn, limit: float) -> Fate:
    """Whether a test fails with this change that does not in the tree that is right, within so many seconds."""
    first = those_of(pair.right, one.file, one.change)
    files = cheapest_first(likely(pair.right, one.file, one.change.name))
    files += [file for file in dict.fromkeys(name.partition("::")[0] for name in first) if file not in files]
    text = (pair.broken / one.file).read_text(encoding="utf-8")
    began, suspect = time.perf_counter(), None
    with trees.broken(pair.broken, one.file, one.change.applied(text)) as kept:
        limit *= 1 if kept else COMPILED
        while (left := limit - (time.perf_counter() - began)) > 0:
            ran = trees.run(pair.broken, files, left, kept=kept, first=first, left_out=pair.failing)
            taken = time.perf_counter() - began
            if ran.code in (0, trees.NO_TESTS):
                return Fate(SURVIVED, "", taken)
            if ran.code == trees.TIMED_OUT:
                return _out_of_time(pair, ran.running, first, kept)._replace(seconds=taken)
            suspect = ran.failed
            if suspect is None or "::" not in suspect:  # its files cannot be imported, or pytest itself failed
                is_sound = trees.run(pair.right, files[:1], limit, kept=True, collect=True).code == 0
                return Fate(KILLED if is_sound else UNDECIDED, suspect or "pytest itself", taken)
            if suspect not in pair.passing:  # which is run once where all is right: kernels may be compiled for it
                sound = trees.run(pair.right, [suspect], PATIENCE * limit, kept=True)
                if sound.code == trees.TIMED_OUT:
                    return Fate(UNDECIDED, f"{suspect} takes too long without it", taken)
                (pair.passing if sound.code == 0 else pair.failing).add(suspect)
            if suspect in pair.passing:
                return Fate(KILLED, suspect, taken)
    return Fate(UNDECIDED, f"{suspect} fails without it", time.perf_counter() - began)


def _out_of_time(pair: Pair, test: str | None, first: list[str], kept: bool) -> Fate:
    """What to make of a test that was running when the time was up.

    One that does not end noticed the change. Else tests that execute it have all passed, or the machine is too slow.
    """
    if test is None:
        return Fate(UNDECIDED, "no test in the time", 0.0)
    if test not in pair.failing:
        sound = trees.run(pair.right, [test], SOON, kept=True)
        if sound.code == 0:
            more = HANGS if kept else PATIENCE * HANGS  # kernels are compiled
            again = trees.run(pair.broken, [test], sound.seconds + more, kept=kept)
            if again.code == trees.TIMED_OUT:
                return Fate(KILLED, f"{test} does not end", 0.0)
    if test in first:
        return Fate(UNDECIDED, f"{test} takes too long", 0.0)
    return Fate(SURVIVED, "time was up", 0.0)


def measured(number: int | None, seed: int, limit: float, jobs: int, minutes: float | None = None) -> Counter[str]:
    """Break places, `jobs` at a time, `limit` seconds for the tests of each; how many there are of each fate.

    It ends with `number` that were killed or survived, or after so many minutes; an undecided place is drawn anew, as
    often as there are places.
    """
    until = time.monotonic() + 60 * (minutes if minutes is not None else 1e9)
    fates, lock, begun = Counter[str](), Lock(), list[Drawn]()
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(jobs) as pool:
        folder = Path(name)
        pairs = [
            Pair(trees.copied(folder / f"broken {job}"), trees.copied(folder / f"right {job}"), set(), set())
            for job in range(jobs)
        ]
        places = drawn(pairs[0].right, seed)  # whatever becomes of the checkout meanwhile

        def work(pair: Pair) -> None:
            while time.monotonic() < until:
                with lock:
                    if number is not None and len(begun) >= min(number + fates[UNDECIDED], 2 * number):
                        return
                    begun.append(mutant := next(places))
                found = fate(pair, mutant, limit)
                with lock:
                    fates[found.what] += 1
                what = f"{mutant.file}:{mutant.change.line}: {mutant.line} -> {mutant.change.becomes}"
                by = f" by {found.by}" if found.what == KILLED else f" ({found.by})" if found.by else ""
                print(f"{found.what}, {found.seconds:.0f} s: {what}{by}", flush=True)

        list(pool.map(work, pairs))
    return fates
