"""A run that was stopped, killed or kept waiting, wherever it was: its tables are those of a run left alone."""

from __future__ import annotations

import dataclasses
import random
import re
import shutil
import sqlite3
import threading
import time
from pathlib import Path

import msgspec
import pytest
from database_contents import contents, newest
from messages import naming

from pdmesh.model.document import Displacement, Velocity
from pdsolve.model import Model
from pdsolve.results import Results, ResultsWarning, WriteError, Writer
from pdsolve.run.simulation import Options, Progress, resume, simulate


@pytest.fixture(autouse=True)
def _look_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)


@pytest.fixture
def driven(probed: Model) -> Model:
    """Softening, held and loaded by profiles: all that a checkpoint has to know."""
    ramp = ((0.0, 0.3), (1.5e-6, 1.0), (2.5e-6, 0.2))
    loads = tuple(msgspec.structs.replace(load, profile=ramp) for load in probed.settings.conditions)
    left = Velocity(box=(0.0, -6e-3, 1e-3, 6e-3), x=-0.5, profile=ramp)
    right = Displacement(box=(19e-3, -6e-3, 20e-3, 6e-3), x=0.0)
    material = msgspec.structs.replace(probed.settings.material, law="bilinear", kr=3.0)
    settings = msgspec.structs.replace(probed.settings, conditions=(*loads, left, right), material=material)
    return dataclasses.replace(probed, settings=settings)


def stopped_at(path: Path, model: Model, stops: list[int], options: Options) -> None:
    """Solve with an interrupt after each of these steps."""
    left = sorted(stops)
    for number, stop in enumerate(left):
        again = (resume, (path,)) if number else (simulate, (model, path, options))
        with again[0](*again[1], watch=lambda progress, stop=stop: progress.step == stop) as results:
            assert (results.meta()["status"], results.checkpoint()[0]) == ("interrupted", stop)
    resume(path).close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [Options(), Options("thesis"), Options(kernel="listed", precision="float32"), Options(precision="float32")],
)
def test_interrupted_anywhere(driven: Model, tmp_path: Path, options: Options) -> None:
    """Between two frames, between two entries of the ledger, at either, twice in a row."""
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    simulate(driven, whole, options).close()
    expected = contents(whole)
    none = ("crack_face", "crack_particle", "mass", "node_death")
    assert all(expected[table] for table in expected if table not in none)
    dice = random.Random(4)
    some, many = dice.sample(range(1, 60), 5), dice.sample(range(1, 60), 9)
    for stops in ([33], [10], [15], [1, 2], [29, 30, 31], [59], some, many):
        stopped_at(path, driven, stops, options)
        found = contents(path)
        assert [table for table in expected if found[table] != expected[table]] == [], stops


@pytest.mark.slow
def test_an_end_that_comes_early_comes_at_the_same_step(probed: Model, tmp_path: Path) -> None:
    """`until` is looked at with the ledger; an interrupt in between is not a look."""
    run = msgspec.structs.replace(probed.settings.run, steps=3000, until="quiet", quiet=1e-6)
    model = dataclasses.replace(probed, settings=msgspec.structs.replace(probed.settings, run=run))
    with simulate(model, tmp_path / "whole.sqlite") as whole:
        end, last = whole.summary()["steps"], int(whole.breaks().step.max())
    assert end % 5 == 0
    between = next(step for step in range(last + 20, end) if step % 5)
    stopped_at(tmp_path / "stopped.sqlite", model, [between], Options())
    assert contents(tmp_path / "stopped.sqlite") == contents(tmp_path / "whole.sqlite")


def test_what_a_killed_run_wrote_after_its_checkpoint_is_dropped(
    driven: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames, broken bonds, ledger, probes and reactions: copied from under a run with a checkpoint at step 0 only."""
    for age in ("CHECKPOINT_WITH_FRAME", "CHECKPOINT_WITH_ROW"):
        monkeypatch.setattr(f"pdsolve.run.recorder.{age}", 1e9)  # s: whatever a busy machine takes
    path, killed = tmp_path / "whole.sqlite", tmp_path / "killed.sqlite"

    def kill(progress: Progress) -> bool:
        if progress.step == 47:
            newest(path, at_least=40)
            for beside in ("", "-wal", "-shm"):
                shutil.copy(f"{path}{beside}", f"{killed}{beside}")
        return False

    simulate(driven, path, watch=kill).close()
    with Results.open(killed) as results:
        assert results.checkpoint()[0] == 0
        assert results.frames()[0].tolist() == [0, 10, 20, 30, 40]
        assert len(results.breaks().step) > 0
        assert results.history()["step"].max() == 40
    resume(killed).close()
    assert contents(killed) == contents(path)


@pytest.mark.slow
@pytest.mark.parametrize("call", range(2, 30, 3))
def test_an_interrupt_in_the_middle_of_writing(
    probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int
) -> None:
    """Asked for twice, it comes at any moment: what was being written is not there, the rest is."""
    simulate(probed, tmp_path / "whole.sqlite").close()
    path, append, calls = tmp_path / "stopped.sqlite", Writer._append, []

    def interrupted(writer: Writer, table: str, rows: list[tuple[object, ...]]) -> None:
        append(writer, table, rows)
        calls.append(table)
        if len(calls) == before + call:
            raise KeyboardInterrupt

    monkeypatch.setattr(Writer, "_append", interrupted)
    before = 10**9
    with monkeypatch.context() as patch:  # how many there are before the first frame
        patch.setattr("pdsolve.run.simulation._advance_to_end", lambda *_: "finished")
        simulate(probed, path).close()
    before = len(calls)
    calls.clear()
    with pytest.raises(KeyboardInterrupt):
        simulate(probed, path)
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
        results.verify()
    resume(path).close()
    assert contents(path) == contents(tmp_path / "whole.sqlite")


def test_an_interrupt_before_the_first_frame_leaves_nothing(
    probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    for place in ("_write_nodes", "write"):
        with monkeypatch.context() as patch:
            patch.setattr(Writer, place, interrupted)
            with pytest.raises(KeyboardInterrupt):
                simulate(probed, tmp_path / "plate.sqlite")
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "place", ["pdsolve.run.simulation.prepare", "pdsolve.run.simulation._advance_to_end_and_close_results"]
)
def test_old_results_stay_until_a_run_is_prepared(
    small_plate: Model, small_results: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """As `--force` does not remove them; the first frame of the new run takes their place."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    before = small_results.read_bytes()
    monkeypatch.setattr(place, interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulate(small_plate, small_results)
    assert {path.name: path.read_bytes() for path in small_results.parent.iterdir()} == {"small.sqlite": before}


class Foreign:
    """Another program that keeps a database to itself from a step on."""

    def __init__(self, path: Path, step: int, seconds: float | None = None) -> None:
        self.path, self.step, self.seconds = path, step, seconds
        self.connection: sqlite3.Connection | None = None
        self.since = 0.0

    def __call__(self, progress: Progress) -> bool:
        if self.connection is None and progress.step == self.step:
            self.connection = sqlite3.connect(self.path, isolation_level=None, check_same_thread=False)
            self.connection.execute("BEGIN IMMEDIATE")
            self.since = time.monotonic()
            if self.seconds is not None:
                threading.Timer(self.seconds, self.connection.close).start()
        return False


@pytest.mark.endurance
def test_a_run_waits_for_another_program(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what for, and goes on."""
    monkeypatch.setattr("pdsolve.results.writer.FIRST_WORD", 0.2)
    path = tmp_path / "plate.sqlite"
    foreign = Foreign(path, 17, seconds=0.7)
    with pytest.warns(ResultsWarning, match=naming("plate.sqlite", "locked", re.compile(r"\d s"))) as said:
        simulate(probed, path, watch=foreign).close()
    assert len([word for word in said if word.category is ResultsWarning]) == 2  # after 0.2 and 0.4 s
    simulate(probed, tmp_path / "alone.sqlite").close()
    assert contents(path) == contents(tmp_path / "alone.sqlite")


@pytest.mark.endurance
def test_a_run_that_is_stopped_while_it_waits_says_what_for(probed: Model, tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    foreign = Foreign(path, 33)

    def watch(progress: Progress) -> bool:
        foreign(progress)
        return foreign.connection is not None and time.monotonic() - foreign.since > 0.5

    with pytest.raises(WriteError, match=naming("plate.sqlite", found=("locked", re.compile(r"\d s")))):
        simulate(probed, path, watch=watch)
    assert foreign.connection is not None
    foreign.connection.close()
    with Results.open(path) as results:
        assert results.meta()["status"] == "running"  # it could not be written that it does not
    with resume(path) as resumed:
        assert resumed.meta()["status"] == "finished"
    simulate(probed, tmp_path / "alone.sqlite").close()
    assert contents(path) == contents(tmp_path / "alone.sqlite")


def test_a_run_that_fails_keeps_its_cause(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not what goes wrong when it is closed after that."""
    path = tmp_path / "plate.sqlite"

    def fail(progress: Progress) -> bool:
        if progress.step == 33:
            monkeypatch.setattr(Writer, "write_meta", no_more)
            raise RuntimeError("the cause")
        return False

    def no_more(*_: object) -> None:
        raise WriteError("cannot be written")

    with pytest.raises(RuntimeError, match="the cause"):
        simulate(probed, path, watch=fail)
    assert [file.name for file in tmp_path.iterdir()] == ["plate.sqlite"]
