"""One run at a time writes to a database, and the lock that sees to it ends with its holder."""

from __future__ import annotations

import errno
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from database_contents import contents, newest
from messages import mentions, naming

from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import Model
from pdsolve.results import BusyError, Results, ResultsWarning, WriteError, lock, writing_to
from pdsolve.run.simulation import Progress, resume, simulate


def taken(path: Path) -> None:
    """Take the lock and let it go."""
    with writing_to(path):
        pass


@pytest.mark.parametrize(("host", "where"), [("here", " on here"), ("", "")])
def test_a_lock_goes_with_its_holder(host: str, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A host without a name, as in some containers, is not named."""
    monkeypatch.setattr(socket, "gethostname", lambda: host)
    path, holder = tmp_path / "x.sqlite", f"(process {os.getpid()}{where})"
    with writing_to(path):
        with pytest.raises(BusyError, match=naming("x.sqlite", found=holder)):
            taken(path)
        taken(tmp_path / "y.sqlite")
    taken(path)
    assert list(tmp_path.iterdir()) == []


def test_a_link_to_a_database_is_the_database(tmp_path: Path) -> None:
    (tmp_path / "link.sqlite").symlink_to("x.sqlite")
    with writing_to(tmp_path / "x.sqlite"), pytest.raises(BusyError):
        taken(tmp_path / "link.sqlite")


@pytest.mark.process
@pytest.mark.endurance
def test_a_killed_holder_holds_nothing(tmp_path: Path) -> None:
    code = """if True:
        import sys, time
        from pathlib import Path
        from pdsolve.results import writing_to
        with writing_to(Path(sys.argv[1])):
            print("holding", flush=True)
            time.sleep(60)
    """
    path = tmp_path / "x.sqlite"
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"holding\n"
        with pytest.raises(BusyError, match=rf"\(process {child.pid}\b"):
            taken(path)
        os.kill(child.pid, signal.SIGKILL)
    assert [file.name for file in tmp_path.iterdir()] == ["x.sqlite-lock"]
    taken(path)
    assert list(tmp_path.iterdir()) == []


def test_a_lock_that_is_let_go_while_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its file goes between opening and locking: the lock on that would keep no one out."""
    path, tries = tmp_path / "x.sqlite", []
    take = lock._lock

    def late(handle: int) -> None:
        if not tries:
            Path(f"{path}-lock").unlink()
        tries.append(handle)
        take(handle)

    monkeypatch.setattr(lock, "_lock", late)
    monkeypatch.setattr(lock, "TRIES", 1)
    with writing_to(path), pytest.raises(BusyError):
        taken(path)
    assert len(tries) == 3


def test_a_file_system_without_locks_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(handle: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock, "_lock", none)
    with pytest.warns(ResultsWarning, match=naming("x.sqlite", "No locks available")):
        taken(tmp_path / "x.sqlite")


@pytest.mark.parametrize("kind", ["a pipe", "a hard link", "another file"])
def test_what_is_no_lock_is_not_taken_for_one(tmp_path: Path, kind: str) -> None:
    """Nor written over or removed."""
    place, victim = tmp_path / "x.sqlite-lock", tmp_path / "victim"
    victim.write_text("mine")
    if kind == "a pipe":
        os.mkfifo(place)
    elif kind == "a hard link":
        place.hardlink_to(victim)
    else:
        victim.rename(place)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(WriteError, match=naming("x.sqlite-lock", found="no lock")):
        taken(tmp_path / "x.sqlite")
    assert sorted(tmp_path.iterdir()) == before
    assert kind == "a pipe" or place.read_text() == "mine"


@pytest.mark.slow
def test_a_second_run_is_refused_and_the_first_goes_on(
    probed: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the same tables as if it had been alone, whoever wants to write to its file or reads it."""
    model, path, seen = tmp_path / "plate.json", tmp_path / "plate.sqlite", []
    model.write_text(probed.to_json())
    monkeypatch.chdir(tmp_path)

    def others(progress: Progress) -> bool:
        if progress.step in (20, 35, 60):
            for words in (["--resume", str(path)], [str(model), "--force"], [str(model), "--force", "-o", str(path)]):
                assert pdsolve(words) == 2
                out, err = capsys.readouterr()
                assert (out, err.count("\n")) == ("", 1)
                assert mentions(err, "plate.sqlite", found=("writing", "process"))
            with pytest.raises(BusyError):
                simulate(probed, path)
            seen.append(newest(path, at_least=(progress.step - 1) // 10 * 10))
            with Results.open(path) as results:
                assert results.meta()["status"] == "running"
            assert pdpost(["history", str(path), "--node", "7", "--json"]) == 0
            capsys.readouterr()
        return False

    simulate(probed, path, watch=others).close()
    assert seen == [10, 30, 50]
    simulate(probed, tmp_path / "alone.sqlite").close()
    assert contents(path) == contents(tmp_path / "alone.sqlite")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["alone.sqlite", "plate.json", "plate.sqlite"]
    before = path.read_bytes()
    resume(path).close()  # finished: nothing to lock
    assert path.read_bytes() == before
