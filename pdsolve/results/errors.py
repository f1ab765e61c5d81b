"""Errors and warnings about databases of results."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pdsolve.errors import CheckpointError


class ResultsError(ValueError):
    """A database that cannot be used; the message names the file, what was found and what was expected."""


class EmptyError(ResultsError):
    """A database without content: its run has just begun."""


class DamagedError(ResultsError):
    """A database that does not hold what was written to it."""


class WriteError(ResultsError):
    """A database that could not be written, for instance on a full disk or in a write-protected folder."""


class GoneError(WriteError):
    """A database that was removed or renamed during its run."""


class TakenError(WriteError):
    """A database that another run has started to write."""


class BusyError(ResultsError):
    """A database that another run is writing."""


class ResultsWarning(UserWarning):
    """A remark about a database for the user of a running program; one line."""


MOST_SAID = 200  # letters of what SQLite says: it may quote a damaged value in full
HINTS = {
    "SQLITE_BUSY": "; close the program that keeps it to itself",
    "SQLITE_INTERRUPT": "; use a whole one: its pages lead in circles",
    "SQLITE_TOOBIG": "; use a whole one: a value is larger than the file",
    "SQLITE_CORRUPT": "; use a whole one (was the file cut short?)",
    "SQLITE_NOTADB": "; use one written by pdsolve",
}


class explained:
    """A context that turns SQLite's errors into ours, naming the file."""

    def __init__(self, path: Path | None, kind: type[ResultsError] = ResultsError) -> None:
        self.path, self.kind = path, kind

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, sqlite3.Error | UnicodeDecodeError):  # the latter where a name in the file is no text
            said = " ".join(str(error).split())
            hint = HINTS.get(getattr(error, "sqlite_errorname", ""), "")
            raise self.kind(f"{self.path or 'results in memory'}: {said[:MOST_SAID]}{hint}") from None


@contextmanager
def name_damaged_checkpoint(path: Path) -> Iterator[None]:
    """A context that raises DamagedError, naming the file, if a checkpoint's content is invalid."""
    try:
        yield
    except CheckpointError as error:
        raise DamagedError(f"{path}: table checkpoint: {error}") from None
