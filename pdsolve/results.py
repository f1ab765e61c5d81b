"""The database of a run: schema, writer, reader. Everything that looks at results needs this module alone.

A plain SQLite file. Fields of nodes are float32, in chunks of `CHUNK` nodes; the view ``node_state`` decodes them
in SQL, so ``SELECT time, uy FROM node_state WHERE node = 7`` works in any client. One transaction writes a frame
with its broken bonds and its ledger: a killed run loses at most the last frame. About once a second it holds a
checkpoint in full precision as well, from which a run goes on.
"""

from __future__ import annotations

import json
import sqlite3
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

APPLICATION_ID = 0x70647273  # "pdrs"
SCHEMA_VERSION = 2
CHUNK = 1024  # nodes
PAGE, WAL_PAGES = 16384, 2048  # bytes; pages that are written before they are moved into the database proper
READERS = 3.0  # s that a run waits in the end for those who read its database
FIELDS = {  # name: unit, in the order of the view
    "ux": "m",
    "uy": "m",
    "vx": "m/s",
    "vy": "m/s",
    "ax": "m/s^2",
    "ay": "m/s^2",
    "energy": "J/m^3",
    "damage": "1",
}


class ResultsError(ValueError):
    """A database that cannot be used; the message names the file, what was found and what was expected."""


class EmptyError(ResultsError):
    """A database with nothing in it yet: a run has only just begun."""


class WriteError(ResultsError):
    """A database that could not be written: a full disk, a folder that may not be written to."""


class Nodes(NamedTuple):
    """What a run knows of its n nodes from the start."""

    ids: NDArray[np.int64]  # (n,)
    position: NDArray[np.float64]  # (n, 2) reference position, m
    delta: NDArray[np.float64]  # (n,) spacing, m
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included
    cut: NDArray[np.int64]  # (n,) bonds cut by a pre-crack


class Families(NamedTuple):
    """Who is bonded to whom at the start, those of node i at start[i]:start[i + 1]; cut and unseen ones left out."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int64]  # (b,) rows of the nodes, not their ids


class Breaks(NamedTuple):
    """Bonds broken in a run, in the order of their steps; a bond of both its nodes is there twice."""

    step: NDArray[np.int64]  # (b,)
    node: NDArray[np.int64]  # (b,) id of the node whose bond it was
    neighbour: NDArray[np.int64]  # (b,) id


class Frame(NamedTuple):
    """What one transaction writes."""

    step: int
    time: float  # s
    fields: Mapping[str, NDArray[np.floating]] | None  # (n,) each; None: a checkpoint between two frames
    breaks: Breaks  # since the last transaction
    ledger: Sequence[tuple[float, ...]]  # rows of `history` since the last transaction
    probes: Sequence[tuple[float, ...]]  # rows of `probe` since the last transaction
    checkpoint: Mapping[str, NDArray[np.floating]] | None  # None: the last one stays
    reactions: Sequence[tuple[Any, ...]] = ()  # rows of `reaction` since the last transaction
    wall_time: float = 0.0  # s spent so far


TABLES = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value);
CREATE TABLE node ("row" INTEGER PRIMARY KEY, node INTEGER UNIQUE NOT NULL, x REAL, y REAL, z REAL,
    delta REAL, area REAL, family INTEGER, cut INTEGER);
CREATE TABLE family_chunk (chunk INTEGER PRIMARY KEY, bonds BLOB, ahead BLOB); -- deflated int32: the bonds of each
    -- node, and for each bond how many rows further its neighbour is
CREATE TABLE crack (x0 REAL, y0 REAL, x1 REAL, y1 REAL); -- segments of pre-cracks
CREATE TABLE frame (step INTEGER PRIMARY KEY, time REAL NOT NULL);
CREATE TABLE field_chunk (step INTEGER, field TEXT, chunk INTEGER, data BLOB NOT NULL,
    PRIMARY KEY (step, field, chunk));
CREATE TABLE bond_break (step INTEGER, node INTEGER, neighbour INTEGER);
CREATE TABLE history (step INTEGER PRIMARY KEY, time REAL, kinetic REAL, strain REAL, dissipated REAL, work REAL,
    momentum_x REAL, momentum_y REAL, broken INTEGER);
CREATE TABLE probe (step INTEGER, time REAL, node INTEGER, ux REAL, uy REAL, vx REAL, vy REAL, ax REAL, ay REAL,
    PRIMARY KEY (node, step));
CREATE TABLE reaction (step INTEGER, time REAL, condition INTEGER, kind TEXT, force_x REAL, force_y REAL,
    displacement_x REAL, displacement_y REAL, PRIMARY KEY (condition, step)); -- N/m that each of the model's
    -- conditions, counted from 0, acts with on the plate, and the mean displacement of its nodes, m
CREATE TABLE checkpoint (name TEXT PRIMARY KEY, step INTEGER, type TEXT, data BLOB);
CREATE TABLE float32_prefix (prefix INTEGER PRIMARY KEY, base REAL, unit REAL); -- sign and exponent of a float32
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {SCHEMA_VERSION};
"""


def _prefixes() -> list[tuple[int, float | None, float | None]]:
    """For each sign and exponent of a float32 the value at mantissa 0 and of one unit of mantissa."""
    rows: list[tuple[int, float | None, float | None]] = []
    for prefix in range(512):
        sign, exponent = (-1.0 if prefix & 256 else 1.0), prefix & 255
        if exponent == 255:
            rows.append((prefix, None, None))  # infinite or not a number
        elif exponent == 0:
            rows.append((prefix, 0.0, sign * 2.0**-149))
        else:
            rows.append((prefix, sign * 2.0 ** (exponent - 127), sign * 2.0 ** (exponent - 150)))
    return rows


def _view() -> str:
    every_byte = f"x'{bytes(range(256)).hex()}'"

    def decoded(field: str) -> str:
        one = ", ".join(
            f'instr({every_byte}, substr(data, 4 * (n."row" % {CHUNK}) + {b + 1}, 1)) - 1 AS b{b}' for b in range(4)
        )
        return f"""(SELECT base + unit * (((b2 & 127) << 16) | (b1 << 8) | b0) FROM (SELECT {one} FROM field_chunk
    WHERE step = f.step AND field = '{field}' AND chunk = n."row" / {CHUNK})
    JOIN float32_prefix ON prefix = ((b3 << 1) | (b2 >> 7))) AS {field}"""

    columns = [decoded(field) for field in FIELDS]
    for at, name in ((2, "0.0 AS uz"), (5, "0.0 AS vz"), (8, "0.0 AS az")):
        columns.insert(at, name)
    return f"""CREATE VIEW node_state AS SELECT f.step AS step, f.time AS time, n.node AS node,
    n.x AS x, n.y AS y, n.z AS z, {", ".join(columns)} FROM frame f CROSS JOIN node n"""


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
        with _explained(path, WriteError):
            connection = _connected(path)
            writer = cls(connection)
            connection.executescript(f"BEGIN;{TABLES}{_view()};")
            connection.executemany("INSERT INTO float32_prefix VALUES (?, ?, ?)", _prefixes())
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
        with _explained(path, WriteError):
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
        with _explained(self._path(), WriteError):
            self.connection.execute("BEGIN")
            self._tell(meta)
            self.connection.execute("COMMIT")

    def _tell(self, meta: Mapping[str, Any]) -> None:
        self.connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", meta.items())

    def write(self, frame: Frame) -> None:
        """Write a frame in one transaction. Raises WriteError where the disk does not take it."""
        with _explained(self._path(), WriteError):
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
            with _explained(path, WriteError):
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


HINTS = {
    "SQLITE_BUSY": ", expected one that no other program keeps to itself",
    "SQLITE_CORRUPT": ", expected a whole one (was the file cut short?)",
    "SQLITE_NOTADB": ", expected one written by pdsolve",
}


class _explained:
    """Turns SQLite's errors into one of ours that names the file."""

    def __init__(self, path: Path | None, kind: type[ResultsError] = ResultsError) -> None:
        self.path, self.kind = path, kind

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, sqlite3.Error):
            hint = HINTS.get(getattr(error, "sqlite_errorname", ""), "")
            raise self.kind(f"{self.path or 'results in memory'}: {error}{hint}") from None


class Results:
    """Reads one run. Arrays are in the order of the model's nodes; steps name frames."""

    def __init__(self, connection: sqlite3.Connection, name: str) -> None:
        self.connection = connection
        self.name = name
        self._nodes: Nodes | None = None

    @classmethod
    def open(cls, path: Path) -> Results:
        """The results in the file at `path`, read only. Raises ResultsError if it is not one of ours."""
        if not path.is_file():
            raise ResultsError(f"{path}: found no such file, expected a database of results")
        with _explained(path):
            connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
            try:
                cls._check(connection, path)
            except BaseException:
                connection.close()
                raise
        return cls(connection, str(path))

    @staticmethod
    def _check(connection: sqlite3.Connection, path: Path) -> None:
        found = connection.execute("PRAGMA application_id").fetchone()[0]
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        tables = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if not tables:
            raise EmptyError(f"{path}: found an empty database, expected one written by pdsolve")
        if found != APPLICATION_ID:
            raise ResultsError(f"{path}: found a database of another program, expected one written by pdsolve")
        if version != SCHEMA_VERSION:
            raise ResultsError(f"{path}: found schema version {version}, expected {SCHEMA_VERSION}")

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self.connection.close()

    def _rows(self, query: str, values: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        with _explained(Path(self.name)), closing(self.connection.execute(query, values)) as cursor:
            return cursor.fetchall()

    def meta(self) -> dict[str, Any]:
        """What the run says of itself: mode, step, versions, status; all but the model."""
        return dict(self._rows("SELECT key, value FROM meta WHERE key <> 'model'"))

    def model(self) -> str:
        """The grid file the run was made from, in full. Raises ResultsError if there is none."""
        rows = self._rows("SELECT value FROM meta WHERE key = 'model'")
        if not rows:
            raise ResultsError(f"{self.name}: found no model, expected the grid file that was solved")
        return str(rows[0][0])

    def summary(self) -> dict[str, Any]:
        """The closing summary; empty while the run goes on."""
        summary: dict[str, Any] = json.loads(self.meta().get("summary", "{}"))
        return summary

    def nodes(self) -> Nodes:
        """The nodes of the model, read once: the arrays are shared and cannot be written to."""
        if self._nodes is None:
            kinds = np.dtype("i8, f8, f8, f8, f8, i8, i8")
            with _explained(Path(self.name)):
                count = self.connection.execute("SELECT count(*) FROM node").fetchone()[0]
                query = 'SELECT node, x, y, delta, area, family, cut FROM node ORDER BY "row"'
                with closing(self.connection.execute(query)) as rows:
                    table = np.fromiter(rows, kinds, count)
            ids, x, y, *others = (np.ascontiguousarray(table[name]) for name in kinds.names or ())
            self._nodes = Nodes(ids, np.column_stack([x, y]), *others)
            for column in self._nodes:
                column.flags.writeable = False
        return self._nodes

    def families(self) -> Families:
        """Who is bonded to whom at the start."""
        counts, neighbours, row = [np.zeros(1, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], 0
        for packed in self._rows("SELECT bonds, ahead FROM family_chunk ORDER BY chunk"):
            count, ahead = (np.frombuffer(zlib.decompress(blob), dtype="<i4").astype(np.int64) for blob in packed)
            neighbours.append(np.repeat(np.arange(row, row + len(count)), count) + ahead)
            counts.append(count)
            row += len(count)
        return Families(np.cumsum(np.concatenate(counts)), np.concatenate(neighbours))

    def cracks(self) -> NDArray[np.float64]:
        """Segments (k, 4) of pre-cracks x0, y0, x1, y1, m."""
        return np.array(self._rows("SELECT x0, y0, x1, y1 FROM crack ORDER BY rowid"), dtype=float).reshape(-1, 4)

    def frames(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Steps and times (s) of the frames."""
        rows = self._rows("SELECT step, time FROM frame ORDER BY step")
        return np.array([row[0] for row in rows], dtype=np.int64), np.array([row[1] for row in rows], dtype=float)

    def field(self, name: str, step: int) -> NDArray[np.float32]:
        """A field (n,) of the frame at `step`. Raises ResultsError, naming those there are, if it is not there."""
        rows = self._rows("SELECT data FROM field_chunk WHERE step = ? AND field = ? ORDER BY chunk", (int(step), name))
        if not rows:
            steps, _ = self.frames()
            if step not in steps:
                there = f"{len(steps)} frames from {steps[0]} to {steps[-1]}" if len(steps) else "none yet"
                raise ResultsError(f"{self.name}: found no frame of step {step}, expected one of {there}")
            fields = f"{', '.join(self.stored(step))} (pdsolve --fields stores others)"
            raise ResultsError(f"{self.name}: found no field '{name}', expected one of {fields}")
        return np.frombuffer(b"".join(row[0] for row in rows), dtype="<f4")

    def stored(self, step: int) -> list[str]:
        """The names of the fields that the frame at `step` holds, in the order of the view."""
        rows = self._rows("SELECT DISTINCT field FROM field_chunk WHERE step = ?", (int(step),))
        return [name for name in FIELDS if (name,) in rows]

    def breaks(self) -> Breaks:
        """All bonds broken so far."""
        rows = self._rows("SELECT step, node, neighbour FROM bond_break ORDER BY step, rowid")
        return Breaks(*np.array(rows, dtype=np.int64).reshape(-1, 3).T)

    def history(self) -> NDArray[np.void]:
        """The ledger, a record a row, with fields step, time, kinetic, strain, dissipated, work, momentum_x,
        momentum_y and broken."""
        names = [row[1] for row in self._rows("PRAGMA table_info(history)")]
        rows = self._rows("SELECT * FROM history ORDER BY step")
        return np.array(rows, dtype=[(name, float) for name in names])

    def probes(self) -> NDArray[np.void]:
        """What was written down at the probes, a record a row, with fields step, time, node, ux ... ay."""
        names = [row[1] for row in self._rows("PRAGMA table_info(probe)")]
        rows = self._rows("SELECT * FROM probe ORDER BY node, step")
        return np.array(rows, dtype=[(name, float) for name in names])

    def reactions(self) -> NDArray[np.void]:
        """What the conditions did, a record a row, with fields step, time, condition, force_x, force_y, displacement_x
        and displacement_y; their kinds are in the model."""
        names = ("step", "time", "condition", "force_x", "force_y", "displacement_x", "displacement_y")
        rows = self._rows(f"SELECT {', '.join(names)} FROM reaction ORDER BY condition, step")
        return np.array(rows, dtype=[(name, float) for name in names])

    def checkpoint(self) -> tuple[int, dict[str, NDArray[np.floating]]]:
        """Step and arrays of the last checkpoint. Raises ResultsError if there is none."""
        rows = self._rows("SELECT name, step, type, data FROM checkpoint")
        if not rows:
            raise ResultsError(f"{self.name}: found no checkpoint, expected one to go on from")
        return rows[0][1], {name: np.frombuffer(data, dtype=kind).copy() for name, _, kind, data in rows}
