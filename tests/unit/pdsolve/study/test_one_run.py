"""A run of a study goes on from whatever has become of it: begun anew, waited for, gone on with or refused."""

from __future__ import annotations

import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest
from database_contents import contents
from messages import mentions

from pdsolve.model import Model
from pdsolve.results import StateKind, Writer, remove, state_of, writing_to
from pdsolve.run.simulation import Progress, simulate
from pdsolve.study import one_run
from pdsolve.study.description import Case
from pdsolve.study.one_run import Task, solve_and_measure
from pdsolve.study.recovered_runs import provenance


@pytest.fixture
def task(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Task:
    """A run of the small plate, whose measures are none."""
    monkeypatch.setattr(one_run, "compute_run_measures", lambda results, further: {})
    (tmp_path / "plate.json").write_text(probed.to_json())
    return Task(1, tmp_path / "plate.json", Case({}, {}, {}), tmp_path / "0001.sqlite", digest="abc")


def origin(task: Task) -> str:
    """How it calls itself."""
    return provenance(task.case.key, task.digest)


def killed_before_a_frame(task: Task, probed: Model, patch: pytest.MonkeyPatch) -> None:
    def none(writer: Writer, *_: object) -> None:
        raise RuntimeError("a test")

    with patch.context() as inner:
        inner.setattr(Writer, "write", none)
        inner.setattr(Writer, "discard", lambda writer: writer.connection.close())
        with pytest.raises(RuntimeError, match="a test"):
            simulate(probed, task.output, provenance=origin(task))
    assert state_of(task.output).kind is StateKind.UNBEGUN


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("again", [False, True])
def test_one_that_was_killed_before_its_first_frame_begins_anew(
    task: Task, probed: Model, monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    killed_before_a_frame(task, probed, monkeypatch)
    assert solve_and_measure(task._replace(again=again)).error is None
    whole = task.output.with_name("whole.sqlite")
    simulate(probed, whole).close()
    assert contents(task.output) == contents(whole)


def test_one_that_is_held_is_waited_for(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    ends, waits = threading.Event(), threading.Event()
    held = threading.Thread(target=lambda: hold(task.output, waits, ends))
    held.start()
    waits.wait()
    monkeypatch.setattr(one_run, "PAUSE", 0.01)
    sleep = one_run.time.sleep
    monkeypatch.setattr(one_run.time, "sleep", lambda seconds: (ends.set(), sleep(seconds)))
    found = solve_and_measure(task)
    held.join()
    assert ends.is_set()
    assert found.error is None, found.error


def hold(path: Path, waits: threading.Event, ends: threading.Event) -> None:
    with writing_to(path):
        waits.set()
        ends.wait(60.0)


def test_one_that_is_held_for_long_is_refused_in_a_line(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_run, "PATIENCE", 0.0)
    with writing_to(task.output):
        error = solve_and_measure(task).error
    assert error is not None
    assert mentions(error, "0001.sqlite", found=("writing", "process"))
    assert "waited 0 s (--again: " in error


@pytest.mark.slow
def test_one_that_was_stopped_goes_on_and_one_of_another_study_stays(task: Task, probed: Model) -> None:
    def stop(progress: Progress) -> bool:
        return progress.step >= 20

    simulate(probed, task.output, watch=stop, provenance="another").close()
    assert mentions(str(solve_and_measure(task).error), found=("results", "run"))
    for said in (origin(task), f"pdsolve study: {task.case.key}"):  # the latter by an older version
        remove(task.output)
        simulate(probed, task.output, watch=stop, provenance=said).close()
        began = task.output.stat().st_ino
        assert solve_and_measure(task).error is None
        assert task.output.stat().st_ino == began


def test_a_damaged_one_is_refused_and_solved_again_where_that_is_asked_for(task: Task, probed: Model) -> None:
    assert solve_and_measure(task).error is None
    simulate(probed, task.output, watch=lambda progress: True, provenance=origin(task)).close()
    with closing(sqlite3.connect(task.output)) as connection, connection:
        connection.execute("UPDATE field_chunk SET data = zeroblob(length(data))")
    error = solve_and_measure(task).error
    assert error is not None
    assert error.endswith("(--again: solves it anew)")
    assert solve_and_measure(task._replace(again=True)).error is None
    task.output.write_bytes(b"nothing of ours" * 100)
    error = solve_and_measure(task._replace(again=True)).error
    assert error is not None
    assert error.endswith("(remove it, and --again solves it anew)")
    assert task.output.read_bytes() == b"nothing of ours" * 100
