"""Reads the database of a run; bonds are checked while decompressing."""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath
from pdmesh.model.output_fields import UNITS, USUAL
from pdsolve.fracture.crack_particles import Particles
from pdsolve.results import pieces, validation
from pdsolve.results.checksums import Row, select
from pdsolve.results.errors import ResultsError, explained
from pdsolve.results.opening import read_only
from pdsolve.results.schema import (
    CHUNK,
    NEVER,
    SCHEMA_VERSION,
    WITHOUT_SPACE,
    Breaks,
    Families,
    Lives,
    Nodes,
    select_nodes,
)
from pdsolve.results.tables import Meta, Tables
from pdsolve.results.validation import wrong_chunk

TABLE = "family_chunk"


def written_families(tables: Tables, nodes: Nodes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of bonds (n,) of every node that ever lived, at its birth, and rows (b,) of their neighbours.

    Neighbours of one node are consecutive. Raises DamagedError.
    """
    counts, neighbours, row = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], 0
    rows, expected = len(nodes.ids), nodes.family - nodes.cut
    for first, *_, bonds, further in tables.all(TABLE):
        count = _inflated(tables, bonds, CHUNK)
        follows = first == (row if tables.epochs else row // CHUNK)
        wrong = None if follows else "chunks do not follow each other"
        tables.expect(TABLE, wrong or wrong_chunk(row, count, rows))
        if count.any() and not np.array_equal(count, expected[row : row + len(count)]):  # of diffusion none is written
            tables.impossible(TABLE, "numbers of bonds are not those of the table node")
        total = int(count.sum())
        ahead = _inflated(tables, further, total)
        if len(ahead) != total:
            tables.impossible(TABLE, f"{len(ahead)} neighbours or more are there; {total} belong there")
        neighbour = np.repeat(np.arange(row, row + len(count)), count) + ahead
        if ((neighbour < 0) | (neighbour >= rows)).any():
            tables.impossible(TABLE, f"neighbours do not exist; there are {rows} nodes")
        neighbours.append(neighbour)
        counts.append(count)
        row += len(count)
    if row != rows:
        tables.impossible(TABLE, f"bonds of {row} nodes are there; there are {rows} nodes")
    return np.concatenate(counts), np.concatenate(neighbours)


def _inflated(tables: Tables, packed: bytes, most: int) -> NDArray[np.int64]:
    """Decompressed integers, at most `most` + 1 of them, as decompressed data may be far larger than the file."""
    try:
        data = zlib.decompressobj().decompress(packed, 4 * (most + 1))
    except zlib.error as error:
        tables.impossible(TABLE, f"bonds cannot be read ({error}); they must be deflated")
    return np.frombuffer(data[: len(data) // 4 * 4], dtype="<i4").astype(np.int64)


class Results:
    """Reads the results of one run. Arrays hold the nodes of one step, in the model's order; steps identify frames.

    Nodes may be born and die between steps; the default step is that of the last frame. Everything read is compared
    with its checksum; all methods raise ResultsError on a mismatch.
    """

    def __init__(self, connection: sqlite3.Connection, name: str, path: Path | None = None) -> None:
        """`path` is the file, which may come from anyone; None: in memory."""
        self.connection = connection
        self.name = name
        self._tables = Tables(connection, name, path)
        self.pieces: tuple[pieces.Pieces, ...] = ()  # databases of ranks that this is the index of
        self._others: list[Results] = []  # those, open
        self._lives: tuple[tuple[int | None, ...], Lives] | None = None  # with how many rows it was read from
        self._nodes: tuple[Lives, int, Nodes] | None = None  # of an epoch
        self._breaks: tuple[int | None, Breaks] | None = None  # with how many rows it was read from
        self.decoded: dict[type, Any] = {}  # parts of the model, which stays as it is, by their type

    @classmethod
    def open(cls, path: FilePath) -> Results:
        """The results in the file at `path`, read only. Raises ResultsError if it is not a database of results."""
        path = Path(path)
        if not path.is_file():
            raise ResultsError(f"{path}: no such file; name a database of results")
        with explained(path):
            connection, results = read_only(path), None
            try:
                results = cls(connection, str(path), path.resolve())
                results._tables.expect_ours()
                text = results._meta_rows(f"WHERE key = '{pieces.KEY}'").get(pieces.KEY)
                if text is not None:  # an index of the databases of ranks
                    results.pieces, sets = pieces.pieces_of(text, results.name), []
                    for piece in results.pieces:
                        first = len(results._others)
                        for file in piece.files:
                            results._others.append(Results.open(pieces.beside(path, file)))
                        sets.append((piece, [rank_results._tables for rank_results in results._others[first:]]))
                    results._tables = pieces.TablesInPieces(results._tables, sets)
                if results._tables.count("node") == 0:  # a run writes its nodes together with its tables
                    results._tables.impossible("node", validation.NO_NODE)
            except BaseException:
                results.close() if results is not None else connection.close()
                raise
        return results

    @property
    def version(self) -> int:
        """The version of the schema."""
        return self._tables.version

    @property
    def checked(self) -> bool:
        """Whether there are checksums, as in all but the oldest files."""
        return self._tables.checked

    def verify(self, older: bool = False) -> None:
        """Read and check everything.

        Raises ResultsError for damage and, unless `older`, for a file of an older version.
        """
        if self._tables.version != SCHEMA_VERSION and not older:
            raise ResultsError(
                f"{self.name} has schema version {self._tables.version}, which can be read but not gone on with"
                f" ({SCHEMA_VERSION} can); solve it anew"
            )
        self._tables.verify()

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        """Name, model and status of the results."""
        try:
            status, steps, nodes = self.meta().get("status"), self.frames()[0], len(self.nodes(0).ids)
        except (sqlite3.Error, ValueError):  # closed, or damaged: whoever asks for words wants no error
            return f"<Results {self.name}>"
        return f"<Results {self.name}: {nodes} nodes, {len(steps)} frames, {status}>"

    def close(self) -> None:
        """Close the database."""
        for rank_results in self._others:
            rank_results.close()
        self.connection.close()

    def meta(self) -> dict[str, Any]:
        """Metadata of the run without the model: mode, step, versions, status."""
        tables, most = self._tables, "WHERE key <> 'model'"
        with tables.snapshot():
            if tables.checked:
                tables.compare("meta", tables.rows(select("meta", columns="key, crc")))
            return Meta(self._meta_rows(most), name=self.name)

    def _meta_rows(self, where: str) -> dict[str, Any]:
        rows = {row[0]: row[-1] for row in self._tables.each("meta", where)}
        for key, value in rows.items():
            self._tables.expect("meta", validation.wrong_meta(key, value))
        return rows

    def model(self) -> str:
        """The grid file the run was made from, in full. Raises ResultsError if there is none."""
        rows = self._meta_rows("WHERE key = 'model'")
        if not rows:
            raise ResultsError(f"{self.name} has no model; use results with the grid file that was solved")
        return str(rows["model"])

    def summary(self) -> dict[str, Any]:
        """The closing summary; empty while the run goes on."""
        try:
            summary = json.loads(self.meta().get("summary", "{}"))
        except (ValueError, RecursionError):
            summary = None
        if not isinstance(summary, dict):
            self._tables.impossible("meta", "the summary is none; it must be names and values as JSON")
        return summary

    @cached_property
    def dimension(self) -> int:
        """2 for a plate, 3 for a body in space."""
        return int(self.meta().get("dimension", 2)) if self._tables.space else 2

    def epochs(self) -> NDArray[np.int64]:
        """Steps (k,) at which the nodes change, beginning with 0."""
        if not self._tables.epochs:
            return np.zeros(1, dtype=np.int64)
        rows = self._tables.all("epoch")
        self._tables.expect("epoch", validation.wrong_epochs(rows))
        return np.array([row[0] for row in rows], dtype=np.int64)

    def bond_updates(self, steps: int) -> int:
        """Number of directed bonds times steps, over the first `steps` steps."""
        if not self._tables.epochs:
            return steps * int((self.nodes().family - self.nodes().cut).sum())
        first, _, bonds = np.array(self._tables.all("epoch"), dtype=np.int64).T
        long = np.diff(np.append(first.clip(min=1), steps + 1).clip(max=steps + 1))
        return int(long @ bonds)

    def epoch(self, step: int | None = None) -> int:
        """The step since which the nodes are those of `step`."""
        epochs = self.epochs()
        if len(epochs) > 1 and step is None:
            step = int(self.frames()[0].max(initial=0))
        at = int(np.searchsorted(epochs, step or 0, side="right")) - 1
        return int(epochs[max(at, 0)])

    def lives(self) -> Lives:
        """All nodes that ever lived, read once: the arrays are shared and read-only."""
        with self._tables.snapshot():
            counts = self._tables.count("node"), self._tables.count("node_death")
            if self._lives is None or self._lives[0] != counts:
                table = self._tables.records("node")
                row, ids, x, y, z, *others = (np.ascontiguousarray(table[name]) for name in table.dtype.names or ())
                nodes = Nodes(ids, np.column_stack([x, y, z][: self.dimension]), *others[:4])
                birth, death = np.zeros(len(ids), dtype=np.int64), np.full(len(ids), NEVER)
                if self._tables.epochs:
                    birth = others[4]
                self._tables.expect("node", validation.wrong_nodes(nodes, row, birth))
                if self._tables.epochs:
                    deaths = self._tables.records("node_death")
                    self._tables.expect("node_death", validation.wrong_deaths(deaths["f0"], deaths["f1"], birth))
                    death[deaths["f1"]] = deaths["f0"]
                for column in (*nodes, birth, death):
                    column.flags.writeable = False
                self._lives = counts, Lives(nodes, birth, death)
        return self._lives[1]

    def nodes(self, step: int | None = None) -> Nodes:
        """The nodes at a step. The arrays are shared and read-only."""
        lives, epoch = self.lives(), self.epoch(step)
        if self._nodes is None or self._nodes[0] is not lives or self._nodes[1] != epoch:
            rows = lives.rows(epoch)
            self._tables.expect("node", None if len(rows) else f"step {epoch} has no node; it must have at least one")
            all_alive = len(rows) == len(lives.birth)
            nodes = lives.nodes if all_alive else select_nodes(lives.nodes, rows)
            for column in nodes:
                column.flags.writeable = False
            self._nodes = lives, epoch, nodes
        return self._nodes[2]

    def rows(self, step: int | None = None) -> NDArray[np.int64]:
        """Rows (n,), in the table `node`, of the nodes at a step."""
        count = self._tables.count("node")
        if count is not None and len(self.epochs()) == 1:
            return np.arange(count)
        return self.lives().rows(self.epoch(step))

    def families(self, step: int | None = None) -> Families:
        """Families of the nodes at a step, as bonded at birth; a node that takes over a neighbour's id takes its
        place."""
        bonds, neighbour = written_families(self._tables, self.lives().nodes)
        if len(self.epochs()) > 1:
            # Those of the nodes at a step are numbered among them; broken bonds to dead nodes are left out
            step, lives = self.epoch(step), self.lives()
            rows, ids = lives.rows(step), lives.nodes.ids
            alive = np.zeros(len(bonds), dtype=bool)
            alive[rows] = True
            node, neighbour = np.repeat(rows, bonds[rows]), neighbour[np.repeat(alive, bonds)]
            place = lives.now(step)[neighbour]
            dead_ends = np.flatnonzero(place < 0)
            intact = (
                dead_ends[~lives.broke(self.breaks(), node[dead_ends], ids[neighbour[dead_ends]])]
                if len(dead_ends)
                else dead_ends
            )
            if len(intact):
                raise ResultsError(
                    f"{self.name}: a bond of node {ids[node[intact[0]]]} leads to one that is gone at step {step};"
                    " nodes whose bonds change must be born anew"
                )
            living = place >= 0
            bonds, neighbour = np.bincount(node[living], minlength=len(bonds))[rows], place[living]
        return Families(np.concatenate([[0], np.cumsum(bonds)]), neighbour)

    def cracks(self) -> NDArray[np.float64]:
        """Segments (k, 4) of pre-cracks x0, y0, x1, y1, or triangles (k, 9) in a body, m."""
        if self.dimension == 3:
            return self._places("crack_face", 9)
        return self._places("crack", 4)

    def _places(self, table: str, columns: int) -> NDArray[np.float64]:
        places = np.array(self._tables.all(table), dtype=float).reshape(-1, columns)
        self._tables.expect(table, validation.wrong_places(places))
        return places

    def particles(self) -> Particles:
        """All crack particles; empty if bonds break by themselves."""
        rows = self._tables.all("crack_particle") if self._tables.particles else []
        table = np.array(rows, dtype=float).reshape(-1, 7)
        number, step, parent = table[:, :3].astype(np.int64).T
        wrong = validation.wrong_particles(step, parent, number)
        self._tables.expect("crack_particle", wrong or validation.wrong_places(table[:, 3:]))
        return Particles(table[:, 3:5].copy(), table[:, 5:7].copy(), parent, step)

    def frames(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Steps and times (s) of the frames."""
        rows = self._tables.all("frame")
        steps, times = np.array([row[0] for row in rows], np.int64), np.array([row[1] for row in rows], float)
        self._tables.expect("frame", validation.wrong_frames(steps, times))
        return steps, times

    def field(self, name: str, step: int) -> NDArray[np.float32]:
        """A field (n,) of the nodes at `step`. Raises ResultsError, naming the stored fields, if it is missing."""
        chunk_rows = list(self._tables.each("field_chunk", "WHERE step = ? AND field = ?", (int(step), name)))
        if not chunk_rows:
            steps, _ = self.frames()
            if step not in steps:
                frames_text = f"{len(steps)} frames from {steps[0]} to {steps[-1]}" if len(steps) else "none yet"
                raise ResultsError(f"{self.name} has no frame of step {step}; use one of {frames_text}")
            if name not in (stored := self.stored(step)):
                fields = f"{', '.join(stored)} (pdsolve --fields stores others)"
                raise ResultsError(f"{self.name} has no field '{name}'; use one of {fields}")
        sizes = [len(row[-1]) for row in chunk_rows]
        if any(size != 4 * CHUNK for size in sizes[:-1]) or any(size % 4 or size > 4 * CHUNK for size in sizes[-1:]):
            self._tables.impossible("field_chunk", f"a chunk is cut short; each has {CHUNK} values")
        values = np.frombuffer(b"".join(row[-1] for row in chunk_rows), dtype="<f4")
        count, stored_chunks = self._tables.count("node"), [row[2] for row in chunk_rows]
        if count is not None and len(self.epochs()) == 1:
            if stored_chunks != list(range(-(-count // CHUNK))) or len(values) != count:
                self._tables.damaged("field_chunk")
            return self._finite(name, step, values)
        chunk, at = np.divmod(self.rows(step), CHUNK)
        chunks = np.unique(chunk)
        place = CHUNK * np.searchsorted(chunks, chunk) + at
        if stored_chunks != chunks.tolist() or len(values) <= place.max(initial=-1):
            self._tables.damaged("field_chunk")
        return self._finite(name, step, values[place])

    def _finite(self, name: str, step: int, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The values (n,) of a field. Raises DamagedError for impossible ones."""
        if np.isinf(values).any() or (name in USUAL and np.isnan(values).any()):
            self._tables.impossible("field_chunk", f"{name} at step {step} is no number; it must be finite")
        return values

    def stored(self, step: int) -> list[str]:
        """The names of the fields that the frame at `step` holds, in the order of the view."""
        if self._tables.checked:
            names = {row[0]: row[2].split() for row in self._tables.all("frame")}.get(int(step), [])
        else:
            rows = self._tables.rows("SELECT DISTINCT field FROM field_chunk WHERE step = ?", (int(step),))
            names = [row[0] for row in rows]
        return [name for name in UNITS if name in names]

    def frame(self, step: int | None = None) -> dict[str, NDArray[Any]]:
        """All nodes and fields of a frame, as columns by name: ``pandas.DataFrame(results.frame())`` takes them.

        Parameters
        ----------
        step : int, optional
            The step of the frame; the last one by default (`frames` lists them).

        Returns
        -------
        dict of str to ndarray
            ``node`` (the number), ``x``, ``y`` (``z`` in space) where the node was at the start, m, then each stored
            field, such as ``damage`` and ``ux`` (m); n values each.

        Raises
        ------
        ResultsError
            If there is no frame at this step.

        Examples
        --------
        >>> table = results.frame()  # doctest: +SKIP
        >>> table["x"][table["damage"] > 0.3].max()  # doctest: +SKIP
        0.0714
        """
        steps, _ = self.frames()
        if step is None and len(steps):
            step = int(steps[-1])
        if step is None or step not in steps:
            raise ResultsError(f"{self.name} has no frame of step {step}; use one of {steps.tolist() or 'a later run'}")
        nodes = self.nodes(step)
        columns = {"node": nodes.ids} | dict(zip("xyz", nodes.position.T, strict=False))
        return columns | {name: self.field(name, step) for name in self.stored(step)}

    def breaks(self) -> Breaks:
        """All bonds broken so far, read once: the arrays are shared and read-only."""
        with self._tables.snapshot():
            count = self._tables.count("bond_break")
            if self._breaks is None or self._breaks[0] != count:
                table = self._tables.records("bond_break")
                breaks = Breaks(*(np.ascontiguousarray(table[name]) for name in table.dtype.names or ()))
                self._tables.expect("bond_break", validation.wrong_breaks(breaks, self.lives().nodes.ids))
                for column in breaks:
                    column.flags.writeable = False
                self._breaks = count, breaks
        return self._breaks[1]

    def history(self) -> NDArray[np.void]:
        """The ledger, one record a row.

        Its fields are step, time, kinetic, strain, dissipated, work, momentum_x, momentum_y, broken, refinement,
        fine_share, clipped_stretch, momentum_z, damped and friction. In files of schema 6 and older, damped energy is
        part of the dissipated energy.
        """
        return self._numbers("history", self._tables.all("history"))

    def masses(self) -> NDArray[np.void]:
        """Mass balance of a substance, one record a row; empty for a model of mechanics.

        Its fields are step, time, inside, through, supplied, solid, dissolved and surface.
        """
        rows = self._tables.all("mass") if self._tables.version > WITHOUT_SPACE else []
        return self._numbers("mass", rows)

    def probes(self) -> NDArray[np.void]:
        """Records of the probes, with fields step, time, node, ux ... ay, uz, vz, az."""
        records = self._numbers("probe", self._tables.all("probe"))
        return records[np.lexsort((records["step"], records["node"]))]

    def reactions(self) -> NDArray[np.void]:
        """Records of the conditions.

        Their fields are step, time, condition, force_x, force_y, displacement_x, displacement_y, force_z and
        displacement_z; the model holds the kinds of conditions.
        """
        rows = [(*row[:3], *row[4:]) for row in self._tables.all("reaction")]
        records = self._numbers("reaction", rows, leave_out="kind")
        return records[np.lexsort((records["step"], records["condition"]))]

    def has_checkpoint(self) -> bool:
        """Whether there is a checkpoint; a run may be stopped before its first frame."""
        return bool(self._tables.count("checkpoint"))

    def checkpoint(self) -> tuple[int, dict[str, NDArray[np.floating]]]:
        """Step and arrays of the last checkpoint. Raises ResultsError if there is none."""
        rows = self._tables.all("checkpoint")
        if not rows:
            raise ResultsError(f"{self.name} has no checkpoint to go on from; solve it anew")
        self._tables.expect("checkpoint", validation.wrong_checkpoint(rows))
        return rows[0][1], {name: np.frombuffer(data, dtype=kind).copy() for name, _, kind, *_, data in rows}

    def checkpoint_step(self) -> int:
        """Step of the last checkpoint. Raises ResultsError if there is none."""
        rows = self._tables.rows("SELECT step FROM checkpoint LIMIT 1")
        if not rows:
            raise ResultsError(f"{self.name} has no checkpoint to go on from; solve it anew")
        return int(rows[0][0])

    def count(self, table: str) -> int | None:
        """Number of rows written to a table; None if unknown."""
        return self._tables.count(table)

    def bonded(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Families of the rows `first` to `last` - 1 of the table `node`: bonds that count, and those gone at birth."""
        rows = self._tables.each("node", 'WHERE "row" >= ? AND "row" < ?', (first, last))
        family, cut = np.array([row[7:9] for row in rows], dtype=np.int64).reshape(-1, 2).T
        return family, cut

    def _numbers(self, table: str, rows: Sequence[Row], leave_out: str = "") -> NDArray[np.void]:
        """Rows of a table as records of floats, named as its columns are."""
        names = [row[1] for row in self._tables.rows(f"PRAGMA table_info({table})")]
        return np.array(rows, dtype=[(name, float) for name in names if name != leave_out])
