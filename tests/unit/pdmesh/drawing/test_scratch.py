"""Folders that killed runs leave: the next run removes them, and no others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

pytest.importorskip("fcntl")

from pdmesh.drawing import scratch

HOLD = """import signal
from pdmesh.drawing.scratch import scratch
with scratch() as folder:
    print(folder, flush=True)
    signal.pause()
"""


def old(folder: Path) -> Path:
    """A folder as it is after a while."""
    past = time.time() - 2 * scratch.YOUNG
    os.utime(folder, (past, past), follow_symlinks=False)
    return folder


@pytest.mark.process
def test_what_a_killed_run_leaves_is_swept_and_what_a_living_one_has_is_not(tmp_path: Path) -> None:
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    command = [sys.executable, "-P", "-c", HOLD]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as run:
        assert run.stdout is not None
        folder = Path(run.stdout.readline().strip())
        assert folder.parent == tmp_path
        (folder / "plate.geo").write_text("\n")
        old(folder)
        scratch.sweep(tmp_path)
        assert folder.exists()
        run.send_signal(signal.SIGKILL)
    scratch.sweep(tmp_path)
    assert not folder.exists()


def test_what_is_not_ours_stays(tmp_path: Path) -> None:
    """Other names, files, links, folders that others may look into, and new ones."""
    name = f"{scratch.PREFIX}abcd_12"
    other = tmp_path / "other"
    other.mkdir()
    (other / "data").write_text("mine")
    stays = [tmp_path / f"{scratch.PREFIX}mine", tmp_path / "pdmesh-abcd_123"]
    for path in stays:
        path.mkdir(0o700)
    (tmp_path / f"{name}3").write_text("a file")
    (tmp_path / f"{name}4").symlink_to(other)
    (tmp_path / f"{name}5").mkdir()
    (tmp_path / f"{name}5").chmod(0o755)
    stays += [old(tmp_path / f"{name}{number}") for number in (3, 4, 5)]
    (tmp_path / f"{name}6").mkdir(0o700)
    for path in [*stays[:2], other]:
        old(path)
    stays += [tmp_path / f"{name}6", other / "data"]
    left = tmp_path / f"{name}7"
    left.mkdir(0o700)
    old(left)
    scratch.sweep(tmp_path)
    assert all(path.exists() for path in stays)
    assert not left.exists()


def test_folders_of_another_user_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = tmp_path / f"{scratch.PREFIX}abcd_123"
    left.mkdir(0o700)
    old(left)
    with monkeypatch.context() as patch:
        patch.setattr(os, "getuid", lambda: os.stat(tmp_path).st_uid + 1)
        scratch.sweep(tmp_path)
    assert left.exists()


def test_the_first_folder_of_a_process_sweeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    scratch._sweep_once.cache_clear()
    left = tmp_path / f"{scratch.PREFIX}abcd_123"
    left.mkdir(0o700)
    old(left)
    with scratch.scratch() as folder:
        assert not left.exists()
        assert folder.stat().st_mode & 0o777 == 0o700
    assert not folder.exists()
