"""Reads the database of a run."""

from __future__ import annotations

import json
import sqlite3
import zlib
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.errors import EmptyError, ResultsError, explained
from pdsolve.results.schema import APPLICATION_ID, FIELDS, SCHEMA_VERSION, Breaks, Families, Nodes


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
        with explained(path):
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
        with explained(Path(self.name)), closing(self.connection.execute(query, values)) as cursor:
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
            with explained(Path(self.name)):
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
