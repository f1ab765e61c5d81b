"""Writes the database of a run."""

from __future__ import annotations

import json
import os
import sqlite3
import time
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.checksums import (
    KEYS,
    Checksum,
    Row,
    checked,
    crc_of,
    records,
    select,
    select_schema,
    stored,
    with_crc,
)
from pdsolve.results.errors import GoneError, ResultsError, ResultsWarning, WriteError, explained
from pdsolve.results.lock import KEY, Token, writing_to
from pdsolve.results.opening import for_writing
from pdsolve.results.pieces import KEY as KEY_OF_PIECES
from pdsolve.results.pieces import Pieces, beside
from pdsolve.results.reader import Results
from pdsolve.results.recovery import INDEX_OF, remove
from pdsolve.results.schema import (
    CHUNK,
    STEPPED,
    TABLES,
    Births,
    Column,
    Epoch,
    Families,
    FrameRecord,
    Nodes,
    prefixes,
    select_nodes,
    statements,
)

PAGE, WAL_PAGES = 16384, 2048  # bytes; pages that are written before they are moved into the database proper
LARGE, PIECE = 2**24, 2**17  # bytes of an array that is written in pieces; values in each of them
READERS = 3.0  # s that a run waits in the end for those who read its database
LOOK = 0.1  # s between two looks whether another program has let go of it
LEAST_WAIT = 1.0  # s that it is waited for, even by a run that is to stop
FIRST_WORD = 5.0  # s of waiting after which something is said; then after twice as long, and so on


class Writer:
    """Writes one run: `begin` begins a new database, `reopen` continues one; close it at the end.

    While another program locks the database, it waits, with an occasional ResultsWarning, until `stop` returns true.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path | None) -> None:
        self.connection = connection
        self.path = path  # None: in memory
        self.stop: Callable[[], bool] = lambda: False
        self._place = Path(os.path.realpath(path or "."))  # though a run may go to another folder
        self._token: Token | None = None  # None: nobody else can write to it, or it is not this writer's yet
        self._checksums: dict[str, Checksum] = {}  # within a transaction

    @classmethod
    def begin(cls, path: Path | None, births: Births, cracks: NDArray[np.float64], meta: Mapping[str, Any]) -> Writer:
        """A new database at `path` of nodes that are asked for some rows at a time; an existing one is replaced.

        Raises WriteError if it cannot be written, leaving nothing behind.
        """
        if path is not None:
            remove(path, of_ranks=not {KEY_OF_PIECES, INDEX_OF} & meta.keys())
        writer = cls(_connected(path), path)
        try:
            with writer._transaction(new=True) as connection:
                if path is not None:
                    writer._token = Token.of(writer._place)
                for statement in statements(births.dimension):
                    connection.execute(statement)
                writer._checksums = dict.fromkeys(TABLES, Checksum())
                writer._checksums["schema"] = Checksum().of("schema", connection.execute(select_schema()))
                writer._insert("INSERT", "checksum", [(name, 0, 0) for name in writer._checksums])
                writer._append("float32_prefix", prefixes())
                if KEY_OF_PIECES not in meta:
                    writer._write_nodes(births.first, 0, births)
                writer._append("epoch", [(0, births.total, births.bonds)])
                writer._append("crack" if cracks.shape[1] == 4 else "crack_face", cracks.tolist())
                created = datetime.now(UTC).isoformat(timespec="seconds")
                writer._write_meta({**meta, "created": created, **writer._running()})
        except BaseException:
            writer.discard()
            raise
        return writer

    @classmethod
    def reopen(cls, path: Path, files: tuple[str, ...] = ()) -> Writer:
        """The database at `path`, to continue from its checkpoint; later steps are deleted.

        Of one in pieces, `files` are those that ranks go on with.

        Raises ResultsError if it is not a database of results or has no checkpoint.
        """
        with Results.open(path) as results:
            step, pieces = results.checkpoint_step(), results.pieces
        for file in (file for piece in pieces for file in piece.files):
            merge_leftover_files(beside(path, file))
        writer = cls(_connected(path), path)
        with writer._transaction() as connection:
            later = {table: f"step > {step}" for table in STEPPED}
            if not pieces:
                later |= {"node": f"birth > {step}", "family_chunk": "first >= (SELECT count(*) FROM node)"}
            for table, where in later.items():
                if connection.execute(f"DELETE FROM {table} WHERE {where}").rowcount:
                    writer._add_up(table)
            writer._token = Token.of(writer._place)
            writer._write_meta(writer._running())
            if pieces:
                writer._write_meta({KEY_OF_PIECES: json.dumps((*pieces, Pieces(step, files)))})
        return writer

    def _running(self) -> dict[str, str]:
        return {"status": "running"} | ({} if self._token is None else {KEY: json.dumps(self._token)})

    def write_meta(self, meta: Mapping[str, Any]) -> None:
        """Set keys of the table `meta`. Raises WriteError."""
        with self._transaction():
            self._write_meta(meta)

    def write(self, frame: FrameRecord) -> None:
        """Write a frame in one transaction. Raises WriteError, for instance on a full disk."""
        if frame.ready is not None:
            frame.ready()
        with self._transaction():
            for epoch in frame.epochs:
                self._write_epoch(epoch)
            if frame.fields is not None:
                self._append("frame", [(frame.step, frame.time, " ".join(frame.fields))])
                for name, values in frame.fields.items():
                    self._write_field(frame.step, name, frame.first // CHUNK, values, frame.rows)
            self._append("bond_break", records("bond_break", frame.breaks))
            self._append("history", frame.ledger)
            self._append("mass", frame.masses)
            self._append("probe", frame.probes)
            self._append("reaction", frame.reactions)
            self._append("crack_particle", frame.particles)
            if frame.checkpoint is not None:
                self.connection.execute(
                    "DELETE FROM checkpoint WHERE ? IS NULL OR step < ?", (frame.keeps, frame.keeps)
                )
                for name, array in frame.checkpoint.items():  # one by one, as they are large
                    key = (name, frame.step, array.dtype.str)
                    if isinstance(array, Column):
                        self._write_entry(key, array)
                        continue
                    flat = np.ascontiguousarray(array).reshape(-1)
                    if array.nbytes >= LARGE:  # of large ones SQLite would make copies
                        pieces = (flat[at : at + PIECE] for at in range(0, len(flat), PIECE))
                        self._write_entry(key, Column(flat.dtype, len(flat), zlib.crc32(flat.data), pieces))
                    else:
                        self._insert("INSERT", "checkpoint", [with_crc("checkpoint", (*key, flat.view(np.uint8).data))])
                self._add_up("checkpoint")
                self._write_meta({"wall_time": frame.wall_time})

    def close(self, status: str) -> None:
        """Close the database as a single file with `status`; SQLite's log stays if another program is reading.

        One in memory stays open. Raises WriteError.
        """
        if self.path is None:
            self.write_meta({"status": status})
            return
        try:
            with self._transaction() as connection:
                connection.execute("DELETE FROM meta WHERE key = ?", (KEY,))
                self._write_meta({"status": status})
            with explained(self.path, WriteError):
                deadline = time.monotonic() + READERS
                while not self._alone() and time.monotonic() < deadline:
                    time.sleep(0.02)
        except GoneError:
            # All of SQLite's log goes into the file, even if that was renamed and its log stayed behind
            self._token = None
            with suppress(ResultsError, sqlite3.Error):
                with self._transaction() as connection:
                    connection.execute("DELETE FROM meta WHERE key = ?", (KEY,))
                    self._write_meta({"status": status})
                self.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                if not self._place.exists():
                    remove(self._place)  # what SQLite kept beside it
            raise
        finally:
            self.connection.close()

    def abandon(self, status: str) -> None:
        """Close after an error, as far as possible without waiting; the original error is the one to report."""
        self.stop = lambda: True
        with suppress(ResultsError):
            self.close(status)

    def discard(self) -> None:
        """Delete the database, as far as possible."""
        self.connection.close()
        if self.path is not None and (self._token is None or self._token.is_of(self._place)):
            with suppress(ResultsError):
                remove(self.path)

    @contextmanager
    def _transaction(self, new: bool = False) -> Iterator[sqlite3.Connection]:
        """A context whose writes are committed or, after an error, rolled back; a `new` database has no tables yet.

        Raises WriteError.
        """
        with explained(self.path, WriteError):
            if self.connection.in_transaction:  # the last one met an error, or an interrupt
                self.connection.execute("ROLLBACK")
            self._begin()
            if self._token is not None:
                self._token.expect_own(self.connection, self._place)
            before = [] if new else self.connection.execute("SELECT name, rows, crc FROM checksum")
            stored_checksums = {name: Checksum(rows, crc) for name, rows, crc in before}
            self._checksums = stored_checksums.copy()
            yield self.connection
            changed = [(*now, name) for name, now in self._checksums.items() if now != stored_checksums.get(name)]
            self.connection.executemany("UPDATE checksum SET rows = ?, crc = ? WHERE name = ?", changed)
            self.connection.execute("COMMIT")

    def _begin(self) -> None:
        """Begin a transaction as soon as no other program locks the database."""
        since, word = time.monotonic(), FIRST_WORD
        while True:
            try:
                self.connection.execute("BEGIN IMMEDIATE")
                return
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY:
                    raise
            waited = time.monotonic() - since
            if self.stop() and waited >= LEAST_WAIT:
                raise WriteError(
                    f"{self.path} was locked by another program for {waited:.0f} s; close it; the database holds"
                    " the run up to its last checkpoint"
                )
            if waited >= word:
                warnings.warn(
                    f"{self.path}: locked by another program for {waited:.0f} s; waiting for it to let go",
                    ResultsWarning,
                    stacklevel=2,
                )
                word *= 2

    def _append(self, table: str, rows: Sequence[Row] | NDArray[np.void]) -> None:
        """Append rows to a table, those with large values without their CRC, and update its checksum."""
        if not len(rows):
            return
        if isinstance(rows, np.ndarray):
            self._insert("INSERT", table, rows.tolist())
        else:
            rows = [with_crc(table, row) if table in KEYS else tuple(map(stored, row)) for row in rows]
            self._insert("INSERT", table, rows)
        self._checksums[table] = self._checksums[table].of(table, rows)

    def _insert(self, how: str, table: str, rows: Sequence[Row]) -> None:
        if rows:
            marks = ", ".join("?" * len(rows[0]))
            self.connection.executemany(f"{how} INTO {table} VALUES ({marks})", rows)

    def _add_up(self, table: str) -> None:
        """Compute the checksum from the existing rows."""
        self._checksums[table] = Checksum().of(table, self.connection.execute(select(table, columns=checked(table))))

    def _write_meta(self, meta: Mapping[str, Any]) -> None:
        rows = [with_crc("meta", (key, stored(value))) for key, value in meta.items()]
        self._insert("INSERT OR REPLACE", "meta", rows)
        self._add_up("meta")

    def _write_nodes(self, first: int, birth: int, births: Births) -> None:
        """Write nodes, from row `first` on, and their families in chunks."""
        for at in range(0, births.total, CHUNK):
            rows = np.arange(at, min(at + CHUNK, births.total))
            nodes, row = births.nodes(at, at + len(rows)), first + rows
            flat = [np.zeros(len(row))] * (3 - nodes.position.shape[1])
            columns = (row, nodes.ids, *nodes.position.T, *flat, *nodes[2:], np.full(len(row), birth))
            self._append("node", records("node", columns))
            start, neighbour = births.families(at, at + len(row))
            ahead = neighbour - np.repeat(row, np.diff(start))
            blobs = (zlib.compress(column.astype("<i4").tobytes(), 1) for column in (np.diff(start), ahead))
            self._append("family_chunk", [(first + at, *blobs)])

    def _write_epoch(self, epoch: Epoch) -> None:
        start, neighbour = epoch.families

        def families(first: int, last: int) -> Families:
            return Families(start[first : last + 1] - start[first], neighbour[start[first] : start[last]])

        def nodes(first: int, last: int) -> Nodes:
            return select_nodes(born, np.arange(first, last))

        born, dimension = epoch.born, epoch.born.position.shape[1]
        bonds = int((born.family - born.cut).sum())
        self._write_nodes(epoch.first, epoch.step, Births(len(born.ids), dimension, bonds, nodes, families))
        self._append("node_death", records("node_death", [np.full_like(epoch.died, epoch.step), epoch.died]))
        self._append("epoch", [(epoch.step, epoch.nodes, epoch.bonds)])

    def _write_field(
        self, step: int, name: str, first: int, values: NDArray[np.floating] | Column, rows: NDArray[np.int64] | None
    ) -> None:
        """Write the values (n,) of the nodes `rows`, NaN for others in a chunk; chunks without values are left out.

        `first` is the number of the first chunk.
        """
        if isinstance(values, Column):
            for chunk, part in enumerate(_in_chunks(values.pieces), first):
                self._append("field_chunk", [(step, name, chunk, part.data)])
            return
        data, chunks = values.astype("<f4"), np.arange(-(-len(values) // CHUNK))
        if rows is not None:
            data = np.full(self._checksums["node"].rows, np.nan, dtype="<f4")
            data[rows] = values
            chunks = np.flatnonzero(np.bincount(rows // CHUNK))
        bits = data.data
        parts = ((chunk, bits[CHUNK * chunk : CHUNK * (chunk + 1)]) for chunk in chunks.tolist())
        self._append("field_chunk", [(step, name, first + chunk, part) for chunk, part in parts])

    def _write_entry(self, key: Row, column: Column) -> None:
        """Write a row of the checkpoint whose data come in pieces."""
        size, at = column.dtype.itemsize * column.length, 0
        crc = crc_of(key, size, column.crc)
        insert = "INSERT INTO checkpoint VALUES (?, ?, ?, ?, zeroblob(?))"
        row = self.connection.execute(insert, (*key, crc, size)).lastrowid
        assert row is not None
        with self.connection.blobopen("checkpoint", "data", row) as blob:
            for piece in column.pieces:
                blob.write(piece.tobytes())
                at += piece.nbytes
        if at != size:
            raise RuntimeError(f"{key[0]} has {at} bytes; it must have {size}")

    def _alone(self) -> bool:
        """Merge SQLite's log; False if a reader prevents it.

        Raises GoneError, as SQLite would remove another run's log.
        """
        if self._token is not None:
            self._token.expect_in_place(self._place)
        try:
            self.connection.execute("PRAGMA journal_mode = DELETE")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorname != "SQLITE_BUSY":
                raise
            self.connection.execute("PRAGMA wal_checkpoint(PASSIVE)")
            return False
        return True


def _in_chunks(pieces: Iterator[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """The values of pieces, in chunks of CHUNK, of which the last may be shorter."""
    rest = np.zeros(0, dtype="<f4")
    for piece in pieces:
        rest = np.concatenate([rest, piece])
        full_length = len(rest) // CHUNK * CHUNK
        yield from rest[:full_length].reshape(-1, CHUNK)
        rest = rest[full_length:]
    if len(rest):
        yield rest


def _connected(path: Path | None) -> sqlite3.Connection:
    """A connection for writing, usable by one thread after another.

    Readers are not disturbed; the disk is synchronized once in `WAL_PAGES` pages.
    """
    with explained(path, WriteError):
        connection = for_writing(path, timeout=LOOK, isolation_level=None, check_same_thread=False)
        try:
            connection.execute(f"PRAGMA page_size = {PAGE}")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            connection.execute(f"PRAGMA wal_autocheckpoint = {WAL_PAGES}")
        except BaseException:
            connection.close()
            raise
    return connection


def merge_leftover_files(path: Path) -> None:
    """Merge the files of a finished run that was killed before doing so, as far as possible."""
    real = os.path.realpath(path)
    if any(os.path.exists(f"{real}{suffix}") for suffix in ("-wal", "-journal", "-lock")):
        with suppress(ResultsError), writing_to(path):
            if any(os.path.exists(f"{real}{suffix}") for suffix in ("-wal", "-journal")):
                Writer(_connected(path), path).abandon("finished")
