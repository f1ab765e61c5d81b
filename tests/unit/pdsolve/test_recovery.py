"""Each state that a database of results may be in, and a run that finds another's token or its file gone."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from database_contents import contents, newest
from messages import mentions, naming

from pdsolve.model import Model
from pdsolve.results import BusyError, GoneError, Results, ResultsError, StateKind, TakenError, Writer, state_of
from pdsolve.results.lock import Token
from pdsolve.results.opening import recover
from pdsolve.results.writer import PAGE
from pdsolve.run.simulation import Progress, resume, simulate

HELD = """if True:
    import sys, time
    from pathlib import Path
    from pdsolve.results import Writer, writing_to
    path = Path(sys.argv[1])
    with writing_to(path):
        writer = Writer.reopen(path) if path.exists() else None
        print("holding", flush=True)
        time.sleep(60)
"""


@contextmanager
def held(path: Path) -> Iterator[int]:
    """Another process that writes to the database at `path`: its number."""
    with subprocess.Popen([sys.executable, "-c", HELD, str(path)], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"holding\n"
        try:
            yield child.pid
        finally:
            os.kill(child.pid, signal.SIGKILL)


@pytest.fixture
def stopped(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run that was stopped at step 33 of 60."""
    path = tmp_path / "plate.sqlite"
    with monkeypatch.context() as patch:
        patch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
        simulate(probed, path, watch=lambda progress: progress.step == 33).close()
    return path


def killed(path: Path, model: Model, step: int, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the database at `path`, as a run that is killed after `step` leaves it."""
    copy = path.with_name("killed.sqlite")

    def kill(progress: Progress) -> bool:
        if progress.step == step:
            newest(path, at_least=step // 10 * 10)
            for beside in ("", "-wal", "-shm"):
                shutil.copy(f"{path}{beside}", f"{copy}{beside}")
        return False

    with monkeypatch.context() as patch:
        patch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
        simulate(model, path, watch=kill).close()
    return copy


def test_nothing_there_and_nothing_in_it(tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    assert state_of(path).kind is StateKind.NONE
    path.touch()
    assert state_of(path).kind is StateKind.EMPTY
    with pytest.raises(ResultsError, match=naming("plate.sqlite")):
        resume(path)


def test_stopped_and_finished(stopped: Path) -> None:
    state = state_of(stopped)
    assert (state.kind, state.step, state.frame, state.meta["status"]) == (StateKind.STOPPED, 33, 30, "interrupted")
    assert state.message.endswith("at step 33")
    resume(stopped).close()
    assert state_of(stopped).kind is StateKind.FINISHED
    with closing(sqlite3.connect(stopped)) as connection:
        assert connection.execute("SELECT * FROM meta WHERE key = 'writer'").fetchall() == []


def test_stopped_before_the_first_frame(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its model is there: it begins anew, to the same tables."""
    path, whole = tmp_path / "plate.sqlite", tmp_path / "whole.sqlite"

    def none(writer: Writer, *_: object) -> None:
        raise RuntimeError("a test")

    with monkeypatch.context() as patch:
        patch.setattr(Writer, "write", none)
        patch.setattr(Writer, "discard", lambda writer: writer.connection.close())
        with pytest.raises(RuntimeError, match="a test"):
            simulate(probed, path, provenance="a test")
    state = state_of(path)
    assert (state.kind, state.step, state.meta["provenance"]) == (StateKind.UNBEGUN, None, "a test")
    resume(path).close()
    simulate(probed, whole).close()
    assert contents(path) == contents(whole)


@pytest.mark.slow
def test_a_run_that_writes_is_seen_without_the_file_of_its_lock(stopped: Path) -> None:
    with held(stopped.with_name("none.sqlite")):
        assert state_of(stopped.with_name("none.sqlite")).kind is StateKind.RUNNING
    copy = stopped.with_name("copy.sqlite")
    with held(stopped) as process:
        Path(f"{stopped}-lock").unlink()
        state = state_of(stopped)
        assert (state.kind, state.holder.split()[:2]) == (StateKind.RUNNING, ["process", str(process)])
        with pytest.raises(BusyError, match=naming("plate.sqlite", found=f"process {process}")):
            resume(stopped)
        for beside in ("", "-wal"):
            shutil.copy(f"{stopped}{beside}", f"{copy}{beside}")  # its token too, but nobody writes to it
        assert state_of(copy).kind is StateKind.STOPPED
    assert state_of(stopped).kind is StateKind.STOPPED


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("folder", [".", "other"])
def test_a_hard_link_to_what_has_its_log_beside_another_name(
    probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    """It is read and gone on with by the name that the run was given alone, and by any name when all is in it."""
    path, link = killed(tmp_path / "plate.sqlite", probed, 33, monkeypatch), tmp_path / folder / "link.sqlite"
    link.parent.mkdir(exist_ok=True)
    os.link(path, link)
    before = sorted(link.parent.iterdir())
    for use in (Results.open, state_of, resume):
        with pytest.raises(ResultsError, match=naming("link.sqlite", found="hard link")):
            use(link)  # type: ignore[operator]
    assert sorted(link.parent.iterdir()) == before
    resume(path).close()
    assert state_of(link).kind is StateKind.FINISHED


def test_a_journal_that_is_to_be_rolled_back(stopped: Path, probed: Model) -> None:
    """As a kill in the middle of a transaction without a log leaves it; it is read and gone on with."""
    killed, before = stopped.with_name("killed.sqlite"), contents(stopped)
    with closing(sqlite3.connect(stopped, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("UPDATE field_chunk SET data = zeroblob(5000)")
        for beside in ("", "-journal"):
            shutil.copy(f"{stopped}{beside}", f"{killed}{beside}")
        connection.execute("ROLLBACK")
    uri = f"file:{killed}?mode=ro"
    with closing(sqlite3.connect(uri, uri=True)) as plain, pytest.raises(sqlite3.OperationalError, match="readonly"):
        plain.execute("SELECT * FROM meta").fetchall()
    with Results.open(killed) as results:
        assert results.frames()[0].tolist() == [0, 10, 20, 30]
    assert Path(f"{killed}-journal").exists()
    recover(killed)
    assert not Path(f"{killed}-journal").exists()
    assert contents(killed) == before
    resume(killed).close()
    assert state_of(killed).kind is StateKind.FINISHED


@pytest.mark.slow
def test_a_damaged_log_is_said(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite leaves out all that is behind the damage, in silence."""
    copy = killed(tmp_path / "plate.sqlite", probed, 57, monkeypatch)
    log = Path(f"{copy}-wal")
    data = bytearray(log.read_bytes())
    state = state_of(copy)
    assert (state.kind, state.frame, state.log.lost, state.warning) == (StateKind.STOPPED, 50, 0, None)
    lost, frames = [], []
    for at in range(len(data) - PAGE // 2, 0, -5 * PAGE):
        spoilt = data.copy()
        spoilt[at] ^= 1
        log.write_bytes(spoilt)
        found = state_of(copy)
        assert found.log.read + found.log.lost == state.log.read
        until = "no frame" if found.frame is None else f"step {found.frame}"
        assert mentions(found.warning, until, found=found.log.read)
        lost.append(found.log.lost)
        frames.append(-1 if found.frame is None else found.frame)
    assert lost[0] == 1
    assert lost == sorted(lost)
    assert frames == sorted(frames, reverse=True)
    assert len(set(frames)) > 3
    assert (found.kind, frames[-1]) == (StateKind.EMPTY, -1)
    log.write_bytes(data[: len(data) * 4 // 5])  # cut short: nothing is known of what was behind
    assert state_of(copy).frame in frames
    resume(copy).close()
    assert contents(copy) == contents(tmp_path / "plate.sqlite")


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("how", ["removed", "renamed", "renamed with its log"])
def test_a_database_that_goes_while_a_run_writes(
    probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    """The run stops at the next frame; what was renamed has all frames and is gone on with."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    path, other = tmp_path / "plate.sqlite", tmp_path / "other.sqlite"

    def go(progress: Progress) -> bool:
        if progress.step == 33:
            newest(path, at_least=30)
            path.rename(other)
            if "log" in how:
                Path(f"{path}-wal").rename(f"{other}-wal")
            if how == "removed":
                other.unlink()
        assert progress.step <= 50  # frames are written while the run goes on
        return False

    with pytest.raises(GoneError, match=naming("plate.sqlite", found=("removed", "renamed"))):
        simulate(probed, path, watch=go)
    assert not any(file.name.startswith("plate") for file in tmp_path.iterdir())
    if how != "removed":
        with Results.open(other) as results:
            assert results.frames()[0].tolist() == [0, 10, 20, 30]
        resume(other).close()
        simulate(probed, tmp_path / "whole.sqlite").close()
        assert contents(other) == contents(tmp_path / "whole.sqlite")


@pytest.mark.slow
def test_a_second_run_without_the_file_of_the_lock(
    probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first stops as soon as it finds the other's token, or file, and destroys nothing."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    monkeypatch.setattr(Token, "is_alive", lambda *_: False)  # as of one on another machine
    path, whole = tmp_path / "plate.sqlite", tmp_path / "whole.sqlite"
    simulate(probed, whole).close()

    def resumed(progress: Progress) -> bool:
        if progress.step == 33:
            newest(path, at_least=30)
            Path(f"{path}-lock").unlink()
            resume(path).close()
        return False

    with pytest.raises(TakenError, match=naming("plate.sqlite", found=("run", "writing"), expected="this one stops")):
        simulate(probed, path, watch=resumed)
    assert contents(path) == contents(whole)

    def anew(progress: Progress) -> bool:
        if progress.step == 33:
            Path(f"{path}-lock").unlink()
            simulate(probed, path).close()
        return False

    with pytest.raises(GoneError):
        simulate(probed, path, watch=anew)
    assert contents(path) == contents(whole)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["plate.sqlite", "whole.sqlite"]
