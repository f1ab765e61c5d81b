"""Identity of a database's writer, stored in the database, as its lock file may be removed and the database renamed."""

from __future__ import annotations

import json
import os
import secrets
import socket
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from pdsolve.results.errors import GoneError, ResultsError, TakenError
from pdsolve.results.opening import read_only

KEY = "writer"  # of the token in the table `meta`, while a run writes


class Token(NamedTuple):
    """A writer of a database."""

    mark: str  # of this writer alone
    process: int
    began: int  # of the process, in Linux's ticks since the start of the machine; 0 elsewhere
    host: str
    file: int  # the database's number in its file system: a copy has another, and is not written to

    @classmethod
    def of(cls, path: Path) -> Token:
        """A new token of this process for the database at `path`. Raises OSError."""
        process = os.getpid()
        return cls(secrets.token_hex(8), process, _began(process), socket.gethostname(), path.stat().st_ino)

    @property
    def name(self) -> str:
        """The process in words, with its host if known."""
        return f"process {self.process}" + (f" on {self.host}" if self.host else "")

    def is_of(self, path: Path) -> bool:
        """Whether the database at `path` is the one this token was made for."""
        try:
            return path.stat().st_ino == self.file
        except OSError:
            return False

    def is_alive(self, path: Path) -> bool:
        """Whether another live process on this machine writes to the database at `path`."""
        on_this_machine = self.host == socket.gethostname() and self.process != os.getpid()
        return on_this_machine and 0 < self.began == _began(self.process) and self.is_of(path)

    def expect_in_place(self, path: Path) -> None:
        """Raise GoneError if the database is no longer at `path`."""
        if not self.is_of(path):
            raise GoneError(
                f"{path} was removed or renamed while a run was writing to it; the run stops (one that was renamed"
                " has all until here: pdsolve --resume it)"
            )

    def expect_own(self, connection: sqlite3.Connection, path: Path) -> None:
        """Raise GoneError, or TakenError if another run has started to write to the database."""
        self.expect_in_place(path)
        rows = connection.execute("SELECT value FROM meta WHERE key = ?", (KEY,)).fetchall()
        if rows != [(json.dumps(self),)]:
            raise TakenError(f"{path}: another run is writing to it; this one stops, the other goes on")


def _began(process: int) -> int:
    try:
        said = Path(f"/proc/{process}/stat").read_bytes()
        return int(said.rpartition(b")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return 0


def token_in(path: Path) -> Token | None:
    """The token in the database at `path`; None without one."""
    with suppress(sqlite3.Error, ResultsError, OSError, ValueError, TypeError):
        if path.is_file():
            with closing(read_only(path)) as connection:
                rows = connection.execute("SELECT value FROM meta WHERE key = ?", (KEY,)).fetchall()
            return Token(*json.loads(rows[0][0])) if rows else None
    return None
