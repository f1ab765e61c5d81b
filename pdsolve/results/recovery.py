"""State of a database of results after its run has ended or was interrupted; and the removal of databases."""

from __future__ import annotations

import os
import re
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from pdmesh.file_kinds import FileKind, kind_of
from pdmesh.files import irregular
from pdsolve.results.errors import EmptyError, ResultsError, WriteError, explained
from pdsolve.results.lock import holder
from pdsolve.results.opening import Log, log_of, read_only
from pdsolve.results.pieces import OF_RANK
from pdsolve.results.reader import Results
from pdsolve.results.side_files import INDEX, JOURNAL, LOG, expect_sound

BESIDE = f"({LOG}|{INDEX}|{JOURNAL})?"  # behind the name of a database: its files, or nothing
INDEX_OF = "piece_of"  # the key of the table meta in which a database of a rank names its index
SQLITE = b"SQLite format 3\0"


class StateKind(Enum):
    """What can be done with a database; the value describes it and how to continue."""

    NONE = "no file: a run begins"
    RUNNING = "a run is writing to it: wait for its end, or stop it"
    EMPTY = "nothing in it, its run was stopped before the first frame: solve it anew"
    UNBEGUN = "no checkpoint yet, its run was stopped before the first frame: --resume begins anew"
    STOPPED = "its run was stopped: --resume goes on from its last checkpoint"
    FAILED = "its run ended badly: solve it anew with other settings"
    FINISHED = "its run is finished"


BADLY = ("unstable", "unsettled")  # how a run ends that would do so again


class State(NamedTuple):
    """The state of a database."""

    kind: StateKind
    meta: Mapping[str, Any] = {}  # what the run says of itself; empty where there is nothing to read
    step: int | None = None  # of the last checkpoint
    frame: int | None = None  # the step of the last frame
    holder: str = ""  # the run that is writing to it, as "process 12 on host"
    log: Log = Log()

    @property
    def message(self) -> str:
        """The state in a line, without the name of the file."""
        said = str(self.kind.value)
        if self.kind is StateKind.RUNNING:
            return f"{said} ({self.holder})"
        return f"{said}, at step {self.step}" if self.kind is StateKind.STOPPED else said

    @property
    def warning(self) -> str | None:
        """A warning about content lost in a damaged log; None if nothing is lost."""
        if not self.log.lost:
            return None
        until = "no frame" if self.frame is None else f"frames up to step {self.frame}"
        empty = self.kind is StateKind.EMPTY
        how = "it is to be solved anew" if empty else "pdsolve --resume solves what came later again"
        return (
            f"its log ({self.log.read + self.log.lost} transactions) is damaged after {self.log.read}; {until} can"
            f" be read, {how}"
        )


def state_of(path: Path) -> State:
    """The state of the database at `path`; a journal left by a killed run is rolled back.

    A free file may be taken the next moment: a writer asks for its lock (`writing_to`) and gets a BusyError then.
    Raises ResultsError for a file that is not a database of results, and for a damaged one.
    """
    lock_holder = holder(path)
    if lock_holder is not None:
        return State(StateKind.RUNNING, holder=lock_holder)
    if not os.path.lexists(path):
        expect_sound(path)
        for file in (Path(os.path.realpath(path) + end) for end in (LOG, JOURNAL)):
            if file.is_file() and file.stat().st_size:  # of a killed run, whose database was renamed
                raise ResultsError(
                    f"{path}: {file.name} is there without its database (was it renamed? rename {file.name} alike;"
                    " otherwise remove it)"
                )
        return State(StateKind.NONE)
    try:
        with Results.open(path) as results, explained(path):
            meta, connection = results.meta(), results.connection
            log = log_of(connection, path)
            ((step,),) = connection.execute("SELECT max(step) FROM checkpoint")
            ((frame,),) = connection.execute("SELECT max(step) FROM frame")
            status = meta.get("status")
            kind = StateKind.UNBEGUN if step is None else StateKind.STOPPED
            if status == "finished":
                kind = StateKind.FINISHED
            elif status in BADLY:
                kind = StateKind.FAILED
            return State(kind, meta, step, frame, log=log)
    except EmptyError:
        with explained(path), closing(read_only(path)) as connection:
            return State(StateKind.EMPTY, log=log_of(connection, path))


def is_empty(path: Path) -> bool:
    """Whether a run that was stopped before its first frame has left a file at `path` with nothing in it."""
    try:
        if not path.is_file() or (path.stat().st_size and kind_of(path) is not FileKind.RESULTS):
            return False  # SQLite takes a few bytes of anything for nothing
        state = state_of(path)
    except (ResultsError, OSError):
        return False
    return state.kind is StateKind.EMPTY and not state.log.lost


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
