"""Writes the database of a run."""

from __future__ import annotations

import sqlite3
import time
import zlib
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.errors import WriteError, explained
from pdsolve.results.reader import Results
from pdsolve.results.schema import CHUNK, TABLES, Families, Frame, Nodes, prefixes, view

PAGE, WAL_PAGES = 16384, 2048  # bytes; pages that are written before they are moved into the database proper
READERS = 3.0  # s that a run waits in the end for those who read its database


class Writer:
    """Writes one run. Use `create` for a new database, `reopen` for one to go on with; close it in the end."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self.connection = connection

    @classmethod
    def create(
        cls,
        path: Path | None,
        nodes: Nodes,
        families: Callable[[int, int], Families],
        cracks: NDArray[np.float64],
        meta: Mapping[str, Any],
    ) -> Writer:
        """A new database at `path` (in memory if None), replacing what is there; `cracks` (k, 4) are segments, m.

        `families(first, last)` gives those of the rows `first` to `last` - 1. Raises WriteError if it cannot be
        written.
        """
        if path is not None:
            remove(path)
        with explained(path, WriteError):
            connection = _connected(path)
            writer = cls(connection)
            connection.executescript(f"BEGIN;{TABLES}{view()};")
            connection.executemany("INSERT INTO float32_prefix VALUES (?, ?, ?)", prefixes())
            columns = (np.arange(len(nodes.ids)), nodes.ids, *nodes.position.T, np.zeros(len(nodes.ids)), *nodes[2:])
            for chunk, at in enumerate(range(0, len(nodes.ids), CHUNK)):
                rows = zip(*(column[at : at + CHUNK].tolist() for column in columns), strict=True)
                connection.executemany("INSERT INTO node VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
                start, neighbour = families(at, min(at + CHUNK, len(nodes.ids)))
                ahead = neighbour - np.repeat(np.arange(at, at + len(start) - 1), np.diff(start))
                blobs = (zlib.compress(column.astype("<i4").tobytes(), 1) for column in (np.diff(start), ahead))
                connection.execute("INSERT INTO family_chunk VALUES (?, ?, ?)", (chunk, *blobs))
            connection.executemany("INSERT INTO crack VALUES (?, ?, ?, ?)", cracks.tolist())
            writer._tell({**meta, "created": datetime.now(UTC).isoformat(timespec="seconds"), "status": "running"})
            connection.execute("COMMIT")
        return writer

    @classmethod
    def reopen(cls, path: Path) -> Writer:
        """The database at `path`, to go on writing from its checkpoint: what it has of later steps is dropped.

        Raises ResultsError if it is not one of ours or has no checkpoint.
        """
        with Results.open(path) as results:
            step, _ = results.checkpoint()
        with explained(path, WriteError):
            connection = _connected(path)
            connection.execute("BEGIN")
            for table in ("frame", "field_chunk", "bond_break", "history", "probe", "reaction"):
                connection.execute(f"DELETE FROM {table} WHERE step > ?", (step,))
            connection.execute("COMMIT")
        writer = cls(connection)
        writer.tell({"status": "running"})
        return writer

    def tell(self, meta: Mapping[str, Any]) -> None:
        """Set keys of the table `meta`."""
        with explained(self._path(), WriteError):
            self.connection.execute("BEGIN")
            self._tell(meta)
            self.connection.execute("COMMIT")

    def _tell(self, meta: Mapping[str, Any]) -> None:
        self.connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", meta.items())

    def write(self, frame: Frame) -> None:
        """Write a frame in one transaction. Raises WriteError where the disk does not take it."""
        with explained(self._path(), WriteError):
            self.connection.execute("BEGIN")
            if frame.fields is not None:
                self.connection.execute("INSERT INTO frame VALUES (?, ?)", (frame.step, frame.time))
                for name, values in frame.fields.items():
                    self._write_field(frame.step, name, values)
            rows = zip(*(column.tolist() for column in frame.breaks), strict=True)
            self.connection.executemany("INSERT INTO bond_break VALUES (?, ?, ?)", rows)
            noted = (("history", 9, frame.ledger), ("probe", 9, frame.probes), ("reaction", 8, frame.reactions))
            for table, columns, lines in noted:
                marks = ", ".join("?" * columns)
                self.connection.executemany(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", lines)
            self.connection.executemany(
                "INSERT OR REPLACE INTO checkpoint VALUES (?, ?, ?, ?)",
                [
                    (name, frame.step, array.dtype.str, array.tobytes())
                    for name, array in (frame.checkpoint or {}).items()
                ],
            )
            if frame.checkpoint is not None:
                self._tell({"wall_time": frame.wall_time})
            self.connection.execute("COMMIT")

    def _write_field(self, step: int, name: str, values: NDArray[np.floating]) -> None:
        data = values.astype("<f4")
        chunks = enumerate(range(0, len(data), CHUNK))
        rows = [(step, name, chunk, data[at : at + CHUNK].tobytes()) for chunk, at in chunks]
        self.connection.executemany("INSERT INTO field_chunk VALUES (?, ?, ?, ?)", rows)

    def close(self, status: str) -> None:
        """Leave one single file behind, with `status` in its meta; with SQLite's log beside it if someone reads on."""
        path = self._path()
        self.tell({"status": status})
        if path is not None:
            with explained(path, WriteError):
                deadline = time.monotonic() + READERS
                while not self._alone() and time.monotonic() < deadline:
                    time.sleep(0.02)
            self.connection.close()

    def _alone(self) -> bool:
        """Put SQLite's log away; False where a reader keeps it."""
        try:
            self.connection.execute("PRAGMA journal_mode = DELETE")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorname != "SQLITE_BUSY":
                raise
            self.connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
            return False
        return True

    def _path(self) -> Path | None:
        name = self.connection.execute("PRAGMA database_list").fetchone()[2]
        return Path(name) if name else None


def _connected(path: Path | None) -> sqlite3.Connection:
    """A connection to write with: readers are not disturbed, and the disk is waited for once in `WAL_PAGES`."""
    connection = sqlite3.connect(":memory:" if path is None else path, isolation_level=None)
    connection.execute(f"PRAGMA page_size = {PAGE}")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    connection.execute(f"PRAGMA wal_autocheckpoint = {WAL_PAGES}")
    return connection


def remove(path: Path) -> None:
    """Delete a database with what SQLite keeps beside it."""
    for name in (path, Path(f"{path}-wal"), Path(f"{path}-shm")):
        name.unlink(missing_ok=True)
