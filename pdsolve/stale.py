"""Compiled kernels that are out of date."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path


def drop_stale(package: Path, folders: Iterable[Path]) -> None:
    """Delete what numba has kept in `folders` from before any source of the package was last changed.

    numba itself looks at a kernel's own file, not at those of the functions compiled into it: with other sizes of
    arrays in them, the old kernel would write where it must not. What cannot be deleted is left.
    """
    newest = max(source.stat().st_mtime for source in package.rglob("*.py"))
    for folder in folders:
        for compiled in folder.glob("*.nb[ic]"):
            with suppress(OSError):
                if compiled.stat().st_mtime < newest:
                    compiled.unlink()
