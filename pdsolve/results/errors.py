"""What can be wrong with a database."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pdsolve.errors import CheckpointError


class ResultsError(ValueError):
    """A database that cannot be used; the message names the file, what was found and what was expected."""


class EmptyError(ResultsError):
    """A database with nothing in it yet: a run has only just begun."""


class DamagedError(ResultsError):
    """A database that does not hold what was written to it."""


class WriteError(ResultsError):
    """A database that could not be written: a full disk, a folder that may not be written to."""


class GoneError(WriteError):
    """A database that was removed or renamed while a run wrote to it."""


class TakenError(WriteError):
    """A database that another run has begun to write to."""


class BusyError(ResultsError):
    """A database that another run is writing to."""


class ResultsWarning(UserWarning):
    """Something about a database that a user should know of while the run goes on; one line."""


MOST_SAID = 200  # letters of what SQLite says: it may quote a damaged value in full
HINTS = {
    "SQLITE_BUSY": ", expected one that no other program keeps to itself",
    "SQLITE_INTERRUPT": ", expected a whole one: its pages lead in circles",
    "SQLITE_TOOBIG": ", expected no value larger than the file",
    "SQLITE_CORRUPT": ", expected a whole one (was the file cut short?)",
    "SQLITE_NOTADB": ", expected one written by pdsolve",
}


class explained:
    """Turns SQLite's errors into one of ours that names the file."""

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
def gone_back(path: Path) -> Iterator[None]:
    """Raises DamagedError, which names the file, where parts of a run do not find in its checkpoint what is theirs."""
    try:
        yield
    except CheckpointError as error:
        raise DamagedError(f"{path}: table checkpoint: {error}") from None
