"""A kill at every call that changes a file: what is left is read, and gone on with to the same end."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import pytest

from benchmarks.kills import Trial, compiler, trials

pytestmark = pytest.mark.skipif(compiler() is None, reason="found no C compiler, or not Linux")


def check(found: Sequence[Trial], states: set[str]) -> None:
    """Nothing is lost, and all these states were met."""
    assert [trial for trial in found if trial.fault] == []
    assert {trial.state for trial in found} == states


@pytest.mark.slow
def test_a_kill_at_the_last_calls(tmp_path: Path) -> None:
    """While SQLite's log is put away, all frames there: a journal is to be rolled back."""
    check(list(islice(trials([("bonds", False)], tmp_path), 8)), {"FINISHED"})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("resumed", "every"), [(False, 1), (True, 4), pytest.param(True, 1, marks=pytest.mark.endurance)]
)
def test_a_kill_at_every_call(tmp_path: Path, resumed: bool, every: int) -> None:
    """Of a run from its beginning, and of one that goes on with another."""
    found = list(trials([("bonds", resumed)], tmp_path, every))
    calls = [trial.call for trial in found]
    assert max(calls) > 100
    assert len(set(calls)) == len(calls) >= max(calls) // every
    check(found, {"STOPPED", "FINISHED"} if resumed else {"NONE", "EMPTY", "UNBEGUN", "STOPPED", "FINISHED"})


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["heat", "heat at rest", "fatigue", "fatigue by K"])
def test_a_kill_between_jumps_and_while_heat_goes_through(kind: str, tmp_path: Path) -> None:
    """At calls all over a run, begun anew and resumed: what is in a checkpoint is enough for the same end."""
    found = list(islice(trials([(kind, False), (kind, True)], tmp_path, 2), 16))
    assert [trial for trial in found if trial.fault] == []
    assert {trial.resumed for trial in found} == {False, True}
    assert "STOPPED" in {trial.state for trial in found}
