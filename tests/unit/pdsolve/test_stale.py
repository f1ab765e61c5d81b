"""Kernels compiled from sources that have changed since."""

from __future__ import annotations

import os
from pathlib import Path

from pdsolve.stale import drop_stale


def test_what_is_older_than_any_source_goes_and_the_rest_stays(tmp_path: Path) -> None:
    package, kept = tmp_path / "package", tmp_path / "kept"
    for folder in (package / "laws", kept):
        folder.mkdir(parents=True)
    for name, written in (
        ("package/a.py", 100),
        ("package/laws/b.py", 300),
        ("kept/a.nbi", 200),
        ("kept/a.1.nbc", 400),
    ):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (written, written))
    (kept / "a.py311.txt").write_bytes(b"")
    drop_stale(package, [kept, tmp_path / "none"])
    assert sorted(path.name for path in kept.iterdir()) == ["a.1.nbc", "a.py311.txt"]
