"""The mutants of `make mutants` are of the code that is there; whether tests kill them, it says itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.mutants import MUTANTS

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.line[:40]}")
def test_none_is_out_of_date(mutant: object) -> None:
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.line) == 1  # type: ignore[attr-defined]
    for name in mutant.tests.split():  # type: ignore[attr-defined]
        path, _, test = name.partition("::")
        assert test.partition("[")[0] in (ROOT / path).read_text(encoding="utf-8")
