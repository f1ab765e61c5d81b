"""Opens databases for reading, and repairs SQLite's files left by a killed program."""

from __future__ import annotations

import os
import sqlite3
import struct
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from pdsolve.results.errors import ResultsError

LITTLE, MASK = 0x82, 0xFFFFFFFF  # the byte of a log whose checksums are of little-endian words; of a word
HEADER, FRAME = 32, 24  # bytes: at the head of a log, and of each page in it
BESIDE = ("-journal", "-wal")  # what SQLite keeps beside a database, under the name that it was opened by
LOGGED = b"\2\2"  # in a database's header: its newest pages may be in a log
INDEX = 3007000  # the version of the index of a log, with the number of pages that can be read in its fifth word


def read_only(path: Path) -> sqlite3.Connection:
    """A read-only connection to the file at `path`; a journal left by a killed program is rolled back first.

    Raises sqlite3.Error. Raises ResultsError if the journal or the log cannot be read because the folder is
    write-protected, or if it belongs to another name of the file.
    """
    _expect_own_name(path)
    try:
        return _opened(path, "mode=ro")
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN):
            raise
    try:
        _opened(path, "mode=rw").close()
        return _opened(path, "mode=ro")
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN):
            raise
    for beside in _beside(os.path.realpath(path)):
        raise ResultsError(
            f"{path}: found {os.path.basename(beside)} of a run that was killed, which cannot be put back here,"
            " expected a folder that can be written to; copy both files to one"
        )
    return _opened(path, "mode=ro&immutable=1")


def roll_back(path: Path) -> None:
    """Roll back a journal left by a killed program; failures are reported by the next program that opens the file."""
    if os.path.exists(f"{os.path.realpath(path)}-journal"):
        with suppress(sqlite3.Error):
            _opened(path, "mode=rw").close()


def _beside(name: str) -> list[str]:
    """Names of the database's journal and log files that are not empty."""
    found = [f"{name}{end}" for end in BESIDE]
    return [beside for beside in found if os.path.exists(beside) and os.path.getsize(beside)]


def _expect_own_name(path: Path) -> None:
    """Raise ResultsError if a file has several names (hard links) and SQLite's files belong to another one.

    Under this name SQLite would open it without them: outdated or half written.
    """
    try:
        found = path.stat()
        if found.st_nlink < 2 or _beside(real := os.path.realpath(path)):
            return
        with path.open("rb") as file:
            logged = file.read(20)[18:] == LOGGED
        others = [entry.path for entry in os.scandir(os.path.dirname(real)) if entry.inode() == found.st_ino]
    except OSError:
        return
    beside = next((beside for other in others for beside in _beside(other)), None)
    if beside or logged:
        at = f"beside another name of it, {os.path.basename(beside)}" if beside else "beside another name of it"
        raise ResultsError(
            f"{path}: found a hard link to a database that is not complete without the file {at}, expected the name"
            " that its run was given; read or resume it by that"
        )


def _opened(path: Path, how: str) -> sqlite3.Connection:
    """A connection that has successfully read something."""
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?{how}", uri=True)
    try:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


class Log(NamedTuple):
    """SQLite's log beside a database without a writer: transactions not yet in the database itself."""

    read: int = 0  # transactions that can be read
    lost: int = 0  # transactions behind a damaged place, which SQLite leaves out without a word


def log_of(connection: sqlite3.Connection, path: Path) -> Log:
    """How far the log of the database at `path` can be read over an open connection.

    A transaction interrupted by the end of the program has no end mark and does not count. Raises sqlite3.Error.
    """
    connection.execute("SELECT count(*) FROM sqlite_master").fetchone()  # SQLite has looked for the end of the log now
    real = os.path.realpath(path)
    try:
        with open(f"{real}-wal", "rb") as log, open(f"{real}-shm", "rb") as index:
            version, _, _, _, pages = struct.unpack("=5I", index.read(20))
            header = log.read(HEADER)
            if version != INDEX or len(header) < HEADER:
                return Log()
            _, _, size, _, *salt = struct.unpack_from(">6I", header)
            known = _is_whole(header)
            ends = []  # of each page of this round of the log, whether it is the last of a transaction
            while len(head := log.read(FRAME)) == FRAME:
                _, end, *own = struct.unpack_from(">4I", head)
                if not known:
                    salt, known = own, True
                ends.append(end > 0 and own == salt)
                log.seek(size, os.SEEK_CUR)
    except (OSError, struct.error):
        return Log()
    return Log(sum(ends[:pages]), sum(ends[pages:]))


def _is_whole(header: bytes) -> bool:
    """Whether the checksum in a log's header is correct."""
    one = two = 0
    words = "<" if header[3] == LITTLE else ">"
    for first, second in struct.iter_unpack(f"{words}2I", header[:24]):
        one = (one + first + two) & MASK
        two = (two + second + one) & MASK
    return (one, two) == struct.unpack_from(">2I", header, 24)
