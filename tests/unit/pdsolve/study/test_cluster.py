"""Runs that the workers of a Dask scheduler solve: what comes back of them when the scheduler ends."""

from __future__ import annotations

import sys
from concurrent.futures import CancelledError, Future
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock, Mock

import pytest
from messages import naming

from pdsolve.study.cluster import solved_by
from pdsolve.study.description import Case, StudyError
from pdsolve.study.one_run import Outcome, Task


class Waiting(Future[Outcome]):
    """A future of Dask's."""

    def release(self) -> None:
        """Let go of it."""


@pytest.mark.parametrize("lost", [CancelledError("scheduler-connection-lost"), OSError("closed")])
def test_a_scheduler_that_ends_is_a_line(lost: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it has said until then is kept."""
    first, second = Waiting(), Waiting()
    first.set_result(Outcome(1, {"nodes": 1}))
    second.result = second.exception = Mock(side_effect=lost)  # type: ignore[method-assign]
    client = MagicMock()
    client.__enter__.return_value.map.return_value = client.map.return_value = [first, second]
    parts = {"Client": Mock(return_value=client), "KilledWorker": RuntimeError, "as_completed": list}
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(**parts))
    tasks = [Task(number, Path("plate.json"), Case({}, {}, {}), Path(f"{number}.sqlite")) for number in (1, 2)]
    outcomes = solved_by(tasks, "tcp://127.0.0.1:1")
    assert next(outcomes).number == 1
    with pytest.raises(StudyError, match=naming("--scheduler tcp://127.0.0.1:1", found="ended")):
        next(outcomes)
