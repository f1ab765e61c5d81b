"""What the tests of the sandbox share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to run a program in, beside a file that is nobody's business."""
    folder = tmp_path / "here"
    folder.mkdir()
    (tmp_path / "secret").write_text("0.25 0.5 topsecret\n", encoding="utf-8")
    monkeypatch.chdir(folder)
    return folder
