"""The mutants of `make mutants` are of the code that is there; whether tests kill them, that says itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from mutants.table import MUTANTS
from mutants.trees import same_kernels

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.line[:40]}")
def test_none_is_out_of_date(mutant: object) -> None:
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.line) == 1  # type: ignore[attr-defined]
    for name in mutant.tests.split():  # type: ignore[attr-defined]
        path, _, test = name.partition("::")
        assert test.partition("[")[0] in (ROOT / path).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "line", "becomes", "same"),
    [
        ("pdsolve/measures/balance.py", "+ through", "- through", True),
        ("pdsolve/laws/pair.py", "* bond.stretch\n", "/ bond.stretch\n", False),  # compiled, and unmarked
        ("pdsolve/operators/bond_list_loops.py", "m[i] = 0", "m[i] = 1", False),
        (
            "pdsolve/lattice/blocks.py",
            "row_of(worst, slot, lane)",
            "row_of(worst, lane, slot)",
            False,
        ),  # compiled
        ("pdsolve/codegen/jit_cache.py", "now - used >", "now + used >", True),
        ("pdsolve/codegen/jit_cache.py", "KEPT, DAY, UNUSED = 8", "KEPT, DAY, UNUSED = 9", False),
    ],
)
def test_kernels_are_kept_where_what_is_broken_is_in_none(file: str, line: str, becomes: str, same: bool) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    assert line in text
    assert same_kernels(file, text, text.replace(line, becomes)) is same
