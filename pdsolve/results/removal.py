"""Removes databases, after everything that goes with them is checked."""

from __future__ import annotations

import os
import re
import sqlite3
from contextlib import closing
from pathlib import Path

from pdmesh.files import irregular
from pdsolve.results.errors import WriteError
from pdsolve.results.opening import read_only
from pdsolve.results.pieces import OF_RANK
from pdsolve.results.side_files import INDEX, JOURNAL, LOG, expect_sound

BESIDE = f"({LOG}|{INDEX}|{JOURNAL})?"  # behind the name of a database: its files, or nothing
INDEX_OF = "piece_of"  # the key of the table meta in which a database of a rank names its index
SQLITE = b"SQLite format 3\0"


def remove(path: Path, of_ranks: bool = True) -> None:
    """Delete a database, or the target of a link, with SQLite's files beside it, and those `of_ranks`.

    Everything is checked before anything is deleted. Raises WriteError if it cannot be deleted, or is no regular file,
    ResultsError for files beside it that SQLite has not left there.
    """
    try:
        file_kind = irregular(path)
        if file_kind is not None:
            raise WriteError(f"{path} is {file_kind}; name a database or nothing")
        expect_sound(path)
        place = Path(os.path.realpath(path))
        pieces = _of_ranks(place) if of_ranks else []
        for file in [*(Path(f"{place}{end}") for end in ("", LOG, INDEX, JOURNAL)), *pieces]:
            file.unlink(missing_ok=True)
    except OSError as error:
        raise WriteError(f"{path}: {error.strerror}") from None


def _of_ranks(place: Path) -> list[Path]:
    """Databases of ranks beside an index that say whose they are, or have nothing in them, with SQLite's files.

    Other databases of such names, as copies of a user, are not among them. Raises ResultsError for other files.
    """
    pattern = re.compile(re.escape(place.name) + OF_RANK + BESIDE)
    files = [file for file in place.parent.iterdir() if pattern.fullmatch(file.name)] if place.parent.is_dir() else []
    ours = []
    for database in sorted({file.with_name(file.name.removesuffix(_end(file))) for file in files}):
        expect_sound(database)
        if not os.path.lexists(database):
            continue
        _expect_regular(database)
        with database.open("rb") as data:
            head = data.read(len(SQLITE))
        if head.strip(b"\0") and head != SQLITE:
            raise WriteError(f"{database} is no database of a rank; move it away")
        if _is_piece(database, place.name):
            ours.append(database)
    return [file for file in files if file.with_name(file.name.removesuffix(_end(file))) in ours]


def expect_piece(database: Path, index: str) -> None:
    """Raise WriteError unless a rank of the run whose index has this name may write to a database."""
    if not os.path.lexists(database):
        return
    _expect_regular(database)
    if not _is_piece(database, index):
        raise WriteError(f"{database} is a database that is not of a rank of {index}; move it away")


def _expect_regular(database: Path) -> None:
    """Raise WriteError for a link, for what is no regular file, and for one that has another name too."""
    if database.is_symlink() or irregular(database) is not None or database.stat().st_nlink > 1:
        raise WriteError(f"{database} is no regular file; move it away")


def _is_piece(database: Path, index: str) -> bool:
    """Whether a database has nothing in it or says that it belongs to this index."""
    if not database.stat().st_size:
        return True
    try:
        with closing(read_only(database)) as connection:
            row = connection.execute("SELECT value FROM meta WHERE key = ?", (INDEX_OF,)).fetchone()
    except sqlite3.Error:
        return False
    return bool(row == (index,))


def _end(file: Path) -> str:
    """What stands behind the name of a database in that of a file of SQLite beside it."""
    return next((end for end in (LOG, INDEX, JOURNAL) if file.name.endswith(end)), "")
