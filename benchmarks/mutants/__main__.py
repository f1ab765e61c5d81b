"""Whether tests notice when the code is wrong: it is broken in one place at a time, in a copy, and a test has to fail.

`make mutants`, or `python -m benchmarks.mutants [WORD ...]`: the table of those written by hand, or those whose file or
line has a word in it; then, without words, a sample of `--sample` places from every folder, `--seed` says which.
`--sample-only` leaves out the table, `--minutes` draws as many as the time allows. Returns 1 where one of the table
survives, where its line is not there any more, where a test fails without it, or where less of the sample is noticed
than `LEAST`. Places whose tests take too long here, or fail anyway, count as neither: others are drawn for them.

`--record`, with Python 3.12 or newer, runs the quick tests and keeps which of them execute what: the sample's tests.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.mutants import executed, sample, trees
from benchmarks.mutants.mutant import Mutant
from benchmarks.mutants.table import MUTANTS

LEAST = 0.9  # of a sample has to be noticed ...
FEW, LEAST_OF_FEW = 50, 0.5  # ... or, where it is small: 20 of the 30 that were drawn first were, see README.md
TOO_FEW = 4  # places say nothing: the machine is too slow
TABLE_LIMIT = 600.0  # s for the tests of a mutant of the table


def passes(tree: Path, tests: Sequence[str], kept: bool = True) -> bool:
    """Whether all of these tests of a tree do, with kernels that were compiled before if they are `kept`."""
    ran = trees.run(tree, tests, TABLE_LIMIT, slow=True, kept=kept)
    if ran.code not in (0, 1):
        raise SystemExit(f"{' '.join(tests)}: these tests could not be run\n{ran.said[-4000:]}")
    return ran.code == 0


def fate(tree: Path, mutant: Mutant) -> str:
    """What became of a mutant of the table."""
    text = (tree / mutant.file).read_text(encoding="utf-8")
    if text.count(mutant.line) != 1:
        return f"STALE: its line is there {text.count(mutant.line)} times, expected once"
    with trees.broken(tree, mutant.file, text.replace(mutant.line, mutant.becomes)) as kept:
        return "SURVIVED" if passes(tree, mutant.tests.split(), kept) else "killed"


def table(chosen: Sequence[Mutant]) -> int:
    """How many of these survive."""
    alive = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = trees.copied(Path(folder) / "tree")
        if not passes(tree, list(dict.fromkeys(test for one in chosen for test in one.tests.split()))):
            raise SystemExit("some of the tests fail without a mutant")
        for one in chosen:
            began = time.perf_counter()
            found = fate(tree, one)
            alive += found != "killed"
            what = one.becomes.strip() or one.line.strip()
            print(f"{found}, {time.perf_counter() - began:.0f} s: {one.file}: {what}", flush=True)
    print(f"{len(chosen)} mutants of the table, {alive} alive")
    return alive


def is_enough(fates: Counter[str]) -> bool:
    """Whether tests noticed what they have to, of the places that were decided."""
    decided = fates[sample.KILLED] + fates[sample.SURVIVED]
    return decided <= TOO_FEW or fates[sample.KILLED] >= (LEAST if decided >= FEW else LEAST_OF_FEW) * decided


def main(words: Sequence[str]) -> int:
    """Break, test, mend; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants")
    parser.add_argument("words", nargs="*", metavar="WORD", help="mutants of the table with a word in file or line")
    parser.add_argument("--sample", type=int, default=100, metavar="N", help="places from every folder (100)")
    parser.add_argument("--minutes", type=float, metavar="M", help="as many places as there are in this time instead")
    parser.add_argument("--seed", type=int, default=0, help="which places (0)")
    parser.add_argument("--limit", type=float, default=120.0, metavar="S", help="for the tests of each place (120)")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="places at a time (2)")
    parser.add_argument("--sample-only", action="store_true", help="leave out the table")
    parser.add_argument("--record", action="store_true", help="keep which tests execute what: half an hour")
    args = parser.parse_args(words)
    if args.record:
        return executed.record()
    chosen = [one for one in MUTANTS if not args.words or any(word in one.file + one.line for word in args.words)]
    failed = not args.sample_only and table(chosen) > 0
    if args.words or not args.sample:
        return int(failed)
    began = time.perf_counter()
    number = args.sample if args.minutes is None else None
    fates = sample.measured(number, args.seed, args.limit, args.jobs, args.minutes)
    decided = fates[sample.KILLED] + fates[sample.SURVIVED]
    print(
        f"{fates[sample.KILLED]} of {decided} places noticed (seed {args.seed}, {time.perf_counter() - began:.0f} s),"
        f" {fates[sample.UNDECIDED]} others undecided; expected at least {LEAST:.0%}, {LEAST_OF_FEW:.0%} of fewer than"
        f" {FEW}" + (": too few to say" if decided <= TOO_FEW else "")
    )
    return int(failed or not is_enough(fates))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
