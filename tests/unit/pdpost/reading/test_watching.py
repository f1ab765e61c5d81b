"""Following a run: while it writes, when it ends, when it falls silent."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from messages import naming
from tampered_databases import tampered

import pdsolve.results.writer
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdpost.figures import field_figure, style
from pdpost.reading import watching
from pdpost.reading.watching import SilentError
from pdsolve.model import Model
from pdsolve.results import Results, ResultsError, Writer


class Clock:
    """A clock that waiting moves."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


def running(path: Path) -> None:
    """Say that the run at `path` goes on, as one that was killed does."""
    with tampered(path) as connection:
        connection.execute("UPDATE meta SET value = 'running' WHERE key = 'status'")


def test_a_run_that_has_ended_is_shown_once(small_results: Path) -> None:
    assert list(watching.frames(small_results, 10.0, print)) == [60]


@pytest.mark.slow
def test_a_killed_run_is_given_up_with_a_word(small_results: Path) -> None:
    running(small_results)
    said: list[str] = []
    clock = Clock()
    steps = watching.frames(small_results, 100.0, said.append, clock=clock, wait=clock.wait)
    assert next(steps) == 60
    with pytest.raises(SilentError, match=naming(found="100 s", expected="'running'")):
        next(steps)
    assert [words.split("new for ")[1].split(" s")[0] for words in said] == ["10", "20", "40", "80"]
    assert clock.now == pytest.approx(100.0)


def test_a_run_that_has_not_begun_is_waited_for(small_results: Path, tmp_path: Path) -> None:
    path = tmp_path / "later.sqlite"
    clock = Clock()

    def wait(seconds: float) -> None:
        clock.wait(seconds)
        if clock.now > 3:
            path.write_bytes(small_results.read_bytes())

    assert list(watching.frames(path, 10.0, print, clock=clock, wait=wait)) == [60]
    path.write_text("not a database, but long enough to look like one\n" * 40)
    with pytest.raises(ResultsError, match="file is not a database"):
        list(watching.frames(path, 10.0, print, clock=clock, wait=wait))


@pytest.mark.slow
def test_a_watched_run_comes_to_the_same_bits(small_plate: Model, tmp_path: Path) -> None:
    """Each frame it draws is one of the run's, more than one of them while it runs; nobody waits for the watcher."""
    model = tmp_path / "plate.json"
    write_file(document_of(small_plate.grid, small_plate.settings), model)
    extra = ["--set", "run.steps=30000", "--set", "run.every=200", "--set", "run.time_step=1.5e-10", "-q"]
    watched, alone = tmp_path / "watched.sqlite", tmp_path / "alone.sqlite"
    command = [sys.executable, "-m", "pdsolve", str(model), *extra, "-o"]
    with subprocess.Popen([*command, str(watched)]) as child:
        steps, early = [], 0
        for step in watching.frames(watched, 120.0, print, poll=0.01):
            with Results.open(watched) as results:
                style.save(field_figure.field(results, "damage", step), tmp_path / "a.png")
            steps.append(step)
            early += child.poll() is None
    assert child.returncode == 0
    assert early > 1
    assert steps == sorted(set(steps))
    assert steps[-1] == 30000
    subprocess.run([*command, str(alone)], check=True)
    with Results.open(watched) as one, Results.open(alone) as other:
        assert one.checkpoint()[1]["value"].tobytes() == other.checkpoint()[1]["value"].tobytes()
        assert np.array_equal(one.breaks(), other.breaks())
        assert np.array_equal(one.frames(), other.frames())
        assert one.meta()["status"] == "finished"


def test_a_reader_does_not_fail_the_end_of_a_run(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who has the database open when the run ends keeps SQLite from tidying up, and no more."""
    monkeypatch.setattr(pdsolve.results.writer, "READERS", 0.1)
    writer = Writer.reopen(small_results)
    with Results.open(small_results) as reader:
        query = reader.connection.execute("SELECT * FROM node")
        query.fetchone()
        writer.close("finished")
        query.close()
    with Results.open(small_results) as results:
        assert results.meta()["status"] == "finished"
        assert len(results.nodes().ids) == 252


def test_the_end_of_a_run_waits_a_moment_for_readers(small_results: Path) -> None:
    """One single file is left once they have gone."""
    writer = Writer.reopen(small_results)
    reader = Results(sqlite3.connect(small_results, check_same_thread=False), "reader")
    reader.nodes()
    looked = threading.Timer(0.2, reader.close)
    looked.start()
    writer.close("finished")
    looked.join()
    assert [path.name for path in small_results.parent.glob("small.sqlite*")] == ["small.sqlite"]
