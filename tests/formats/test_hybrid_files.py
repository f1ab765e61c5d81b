"""Databases of runs with a fine zone that moves: their nodes, their books, and what a killed run goes on to."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents, kill_when
from messages import naming
from zoned_plates import struck

from pdsolve.measures.cracked_nodes import damage_with_pre_cracks_at
from pdsolve.results import Results, writer
from pdsolve.run.simulation import Options, Progress, StepBatchTimer, resume, simulate

TESTS = Path(__file__).parent.parent


@pytest.fixture(scope="module", params=[pytest.param("brittle", marks=pytest.mark.slow), "bilinear"])
def solved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A run of either law, left alone."""
    path = tmp_path_factory.mktemp("hybrid") / "whole.sqlite"
    simulate(struck("hybrid", law=request.param), path, Options(threads=1)).close()
    return path, request.param


@pytest.mark.slow
def test_frames_are_of_the_nodes_there_are(solved: tuple[Path, str]) -> None:
    """Ever more fine ones, whose area is that of the plate; damage of a frame is what births and bonds say."""
    with Results.open(solved[0]) as results:
        steps, fine = results.frames()[0].tolist(), []
        for step in steps:
            nodes = results.nodes(step)
            assert len(results.field("ux", step)) == len(nodes.ids)
            assert nodes.area.sum() == pytest.approx(0.1 * 0.2, rel=1e-12)
            fine.append(int((nodes.delta < 3e-3).sum()))
            assert damage_with_pre_cracks_at(results, step) == pytest.approx(results.field("damage", step), abs=1e-6)
        assert fine[-1] > 1.2 * fine[0]
        assert sorted(fine) == fine
        books = results.history()
        assert np.all(np.diff(books["fine_share"]) >= 0)
        assert books["fine_share"][-1] == pytest.approx(results.summary()["hybrid"]["fine_share"])
        assert 0 < books["clipped_stretch"][-1] < 1
        assert books["refinement"][-1] != 0


@pytest.mark.slow
@pytest.mark.endurance
def test_a_killed_run_goes_on_to_the_same_tables(solved: tuple[Path, str], tmp_path: Path) -> None:
    """kill -9 while cells become fine, and steps taken by other numbers at a time: the same to the bit."""
    whole, law = solved
    program = f"""
import sys, time; sys.path.insert(0, {str(TESTS)!r})
from pathlib import Path
from zoned_plates import struck
from pdsolve.run.simulation import Options, simulate
import pdsolve.run.simulation
pdsolve.run.simulation.PATIENCE = 1e6
watch = lambda progress: bool(time.sleep(0.02))
simulate(struck("hybrid", law={law!r}), Path(sys.argv[1]), Options(threads=1), watch)
"""
    path = tmp_path / "killed.sqlite"
    kill_when(lambda results: len(results.frames()[0]) >= 4, path, ["-c", program, str(path)])
    resume(path).close()
    assert contents(path) == contents(whole)


@pytest.mark.slow
def test_large_arrays_of_a_checkpoint_are_written_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bytes with the same checksums, of which a run goes on."""
    rows = []
    for large in (writer.LARGE, 1000):
        monkeypatch.setattr(writer, "LARGE", large)
        monkeypatch.setattr(writer, "PIECE", 99)
        path = tmp_path / f"{large}.sqlite"
        simulate(struck("hybrid", steps=8), path, Options(threads=1)).close()
        with closing(sqlite3.connect(path)) as connection:
            rows.append(connection.execute("SELECT * FROM checkpoint ORDER BY name").fetchall())
        with Results.open(path) as results:
            results.verify()
    assert max(len(data) for *_, data in rows[1]) > 10 * 8 * 99
    assert rows[0] == rows[1]


@pytest.mark.slow
def test_a_stop_between_two_entries_of_the_ledger_is_heard(
    solved: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At once, back to the last checkpoint, or at the entry where that comes soon; then to the same tables."""
    whole, law = solved
    path, heard = tmp_path / "stopped.sqlite", []
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    monkeypatch.setattr(StepBatchTimer, "will_finish_soon", lambda pace, steps: False)

    def stop(progress: Progress) -> bool:
        heard.append(progress.step)
        return progress.step > 45

    with pytest.raises(KeyboardInterrupt, match=naming("step 50")):
        simulate(struck("hybrid", law=law), path, Options(threads=1), stop)
    assert heard[-1] == 50
    with Results.open(path) as results:
        assert (results.meta()["status"], results.checkpoint()[0] < 50) == ("interrupted", True)
    monkeypatch.setattr(StepBatchTimer, "will_finish_soon", lambda pace, steps: True)
    with resume(path, 1, lambda progress: progress.step > 45) as results:
        assert (results.meta()["status"], results.checkpoint()[0] > 45) == ("interrupted", True)
    resume(path).close()
    assert contents(path) == contents(whole)
