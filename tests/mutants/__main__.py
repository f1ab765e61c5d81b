"""Whether tests notice when the code is wrong: it is broken in one place at a time, in a copy, and a test has to fail.

`make mutants`, or `PYTHONPATH=tests python -m mutants [WORD ...]`: the places of the table, or those whose file or line
has a word in it. Returns 1 where a mutant survives, where its line is not there any more, or where a test fails without
it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from mutants import trees
from mutants.mutant import Mutant
from mutants.table import MUTANTS


def outcome(tree: Path, mutant: Mutant) -> str:
    """What became of a mutant."""
    text = (tree / mutant.file).read_text(encoding="utf-8")
    if text.count(mutant.line) != 1:
        return f"STALE: its line is there {text.count(mutant.line)} times, expected once"
    with trees.broken(tree, mutant.file, text.replace(mutant.line, mutant.becomes)) as is_same:
        return "killed" if trees.first_failure(tree, mutant.tests.split(), with_kernels=is_same) else "SURVIVED"


def main(words: Sequence[str]) -> int:
    """Break, test, mend; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m mutants")
    parser.add_argument("words", nargs="*", metavar="WORD", help="mutants with a word in file or line (all)")
    args = parser.parse_args(words)
    chosen = MUTANTS
    if args.words:
        chosen = tuple(mutant for mutant in MUTANTS if any(word in mutant.file + mutant.line for word in args.words))
    alive = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = trees.copied(Path(folder) / "tree")
        tests = list(dict.fromkeys(test for mutant in chosen for test in mutant.tests.split()))
        if failure := trees.first_failure(tree, tests, with_kernels=True):
            print(f"a test fails without a mutant: {failure}")
            return 1
        for mutant in chosen:
            start = time.perf_counter()
            became = outcome(tree, mutant)
            alive += became != "killed"
            what = mutant.becomes.strip() or mutant.line.strip()
            print(f"{became}, {time.perf_counter() - start:.0f} s: {mutant.file}: {what}", flush=True)
    print(f"{len(chosen)} mutants, {alive} alive")
    return int(alive > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
