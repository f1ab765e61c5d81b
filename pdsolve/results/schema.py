"""Contents of a database of results: its tables, and the tuples written and read.

Every node that ever lived is a row with a birth and perhaps a death.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pdmesh.model.output_fields import ALONG, UNITS

APPLICATION_ID = 0x70647273  # "pdrs"
SCHEMA_VERSION, WITHOUT_SPACE, WITHOUT_EPOCHS, WITHOUT_CHECKSUMS = 7, 5, 3, 2
CHUNK = 1000  # nodes: their fields, with keys, are just less than a quarter of a page
NEVER = np.iinfo(np.int64).max


class Nodes(NamedTuple):
    """Properties of n nodes, fixed at their birth."""

    ids: NDArray[np.int64]  # (n,)
    position: NDArray[np.float64]  # (n, 2) reference position, m; (n, 3) of a body in space
    delta: NDArray[np.float64]  # (n,) spacing, m
    area: NDArray[np.float64]  # (n,) m^2; of a body volume, m^3
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those that were gone at birth included
    cut: NDArray[np.int64]  # (n,) bonds that were gone at birth: cut by a pre-crack, or broken before


def select_nodes(nodes: Nodes, rows: NDArray[np.int64]) -> Nodes:
    """The nodes of these rows (k,)."""
    ids, position, delta, area, family, cut = nodes
    return Nodes(ids[rows], position[rows], delta[rows], area[rows], family[rows], cut[rows])


class Families(NamedTuple):
    """Bonds at birth, those of node i at start[i]:start[i + 1], without cut and unseen ones."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int64]  # (b,) rows of the nodes, not their ids


class Breaks(NamedTuple):
    """Bonds broken in a run, in the order of their steps; a bond in both families appears twice."""

    step: NDArray[np.int64]  # (b,)
    node: NDArray[np.int64]  # (b,) id of the node whose bond it was
    neighbour: NDArray[np.int64]  # (b,) id


class Epoch(NamedTuple):
    """Nodes that are born and die between two steps. A node whose bonds change dies and is born under the same id."""

    step: int  # the first that is taken without the dead and with the born
    first: int  # row of the first of those born; how many rows there were before
    born: Nodes  # (b,)
    families: Families  # of those born; neighbours are rows of the table `node`
    died: NDArray[np.int64]  # (d,) rows of the table `node`
    nodes: int  # living after it
    bonds: int  # directed, after it


class Column(NamedTuple):
    """Values that are not in one place: they come in pieces, in order, once."""

    dtype: np.dtype[Any]
    length: int
    crc: int  # CRC-32 of their bytes
    pieces: Iterator[NDArray[Any]]


class Births(NamedTuple):
    """Nodes that are asked for some rows at a time, and their families."""

    total: int  # nodes
    dimension: int
    bonds: int  # directed
    nodes: Callable[[int, int], Nodes]  # of the rows from the first to the one before the last
    families: Callable[[int, int], Families]
    first: int = 0  # row of the first


class FrameRecord(NamedTuple):
    """The content of one transaction."""

    step: int
    time: float  # s
    fields: Mapping[str, NDArray[np.floating] | Column] | None  # (n,) each; None: a checkpoint between two frames
    breaks: Breaks  # since the last transaction
    ledger: Sequence[tuple[float, ...]]  # rows of `history` since the last transaction
    probes: Sequence[tuple[float, ...]]  # rows of `probe` since the last transaction
    checkpoint: Mapping[str, NDArray[Any] | Column] | None  # None: the last one stays
    reactions: Sequence[tuple[Any, ...]] = ()  # rows of `reaction` since the last transaction
    wall_time: float = 0.0  # s spent so far
    epochs: Sequence[Epoch] = ()  # since the last transaction
    rows: NDArray[np.int64] | None = None  # (n,) of the table `node` that the fields' nodes are; None: 0 to n - 1
    particles: Sequence[tuple[Any, ...]] = ()  # rows of `crack_particle` since the last transaction
    masses: Sequence[tuple[float, ...]] = ()  # rows of `mass` since the last transaction
    first: int = 0  # of those rows, whole chunks before which are in other databases
    keeps: int | None = None  # the step of an earlier checkpoint that stays; None: none does
    ready: Callable[[], None] | None = None  # waits until it may be written


TABLES = {  # name: columns
    "meta": "key TEXT PRIMARY KEY, crc INTEGER, value",
    "node": """"row" INTEGER PRIMARY KEY, node INTEGER NOT NULL, x REAL, y REAL, z REAL, delta REAL, area REAL,
    family INTEGER, cut INTEGER, birth INTEGER NOT NULL, UNIQUE (node, birth)""",
    "node_death": """step INTEGER NOT NULL, "row" INTEGER UNIQUE NOT NULL -- a node is there from its birth until the
    -- step before its death
    """,
    "epoch": "step INTEGER PRIMARY KEY, nodes INTEGER, bonds INTEGER -- steps at which nodes change\n",
    "family_chunk": """first INTEGER PRIMARY KEY, crc INTEGER, bonds BLOB, ahead BLOB -- deflated int32: the bonds of
    -- each node from this row on, and for each bond how many rows further its neighbour is, or was at that birth: who
    -- has its id later takes its place
    """,
    "crack_particle": """particle INTEGER PRIMARY KEY, step INTEGER, parent INTEGER, x REAL, y REAL, normal_x REAL,
    normal_y REAL -- cracks as particles, from 0: the first step with it, and that it grew from, -1 if from none
    """,
    "crack": "x0 REAL, y0 REAL, x1 REAL, y1 REAL -- segments of pre-cracks\n",
    "crack_face": """x0 REAL, y0 REAL, z0 REAL, x1 REAL, y1 REAL, z1 REAL, x2 REAL, y2 REAL, z2 REAL -- triangles of
    -- those of a body in space
    """,
    "frame": "step INTEGER PRIMARY KEY, time REAL NOT NULL, fields TEXT -- names, with a space between\n",
    "field_chunk": """step INTEGER, field TEXT, chunk INTEGER, crc INTEGER, data BLOB NOT NULL,
    PRIMARY KEY (step, field, chunk)""",
    "bond_break": "step INTEGER, node INTEGER, neighbour INTEGER",
    "history": """step INTEGER PRIMARY KEY, time REAL, kinetic REAL, strain REAL, dissipated REAL, work REAL,
    momentum_x REAL, momentum_y REAL, broken INTEGER, refinement REAL, fine_share REAL, clipped_stretch REAL,
    momentum_z REAL, damped REAL, friction REAL""",
    "mass": """step INTEGER PRIMARY KEY, time REAL, inside REAL, through REAL, supplied REAL, solid REAL,
    dissolved REAL, surface REAL -- of models of diffusion
    """,
    "probe": """step INTEGER, time REAL, node INTEGER, ux REAL, uy REAL, vx REAL, vy REAL, ax REAL, ay REAL,
    uz REAL, vz REAL, az REAL, PRIMARY KEY (node, step)""",
    "reaction": """step INTEGER, time REAL, condition INTEGER, kind TEXT, force_x REAL, force_y REAL,
    displacement_x REAL, displacement_y REAL, force_z REAL, displacement_z REAL, PRIMARY KEY (condition, step) -- N/m
    -- (of a body N) that each of the model's conditions, counted from 0, acts with, and the mean displacement of its
    -- nodes, m
    """,
    "checkpoint": "name TEXT PRIMARY KEY, step INTEGER, type TEXT, crc INTEGER, data BLOB",
    "float32_prefix": "prefix INTEGER PRIMARY KEY, base REAL, unit REAL -- sign and exponent of a float32\n",
    "checksum": """name TEXT PRIMARY KEY, rows INTEGER, crc INTEGER -- of the rows of each table, in their order, and of
    -- the SQL of all tables
    """,
}


# grow in a run
STEPPED = (
    "frame",
    "field_chunk",
    "bond_break",
    "history",
    "mass",
    "probe",
    "reaction",
    "node_death",
    "epoch",
    "crack_particle",
)


def prefixes() -> list[tuple[int, float | None, float | None]]:
    """For each sign and exponent of a float32: the value at mantissa 0, and that of one unit of mantissa."""
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


def statements(dimension: int = 2) -> list[str]:
    """SQL that creates an empty database, of a plate or of a body in space."""
    tables = [f"CREATE TABLE {name} ({columns})" for name, columns in TABLES.items()]
    marks = [f"PRAGMA application_id = {APPLICATION_ID}", f"PRAGMA user_version = {SCHEMA_VERSION}"]
    return [*tables, _view(dimension), *marks]


def _view(dimension: int) -> str:
    every_byte = f"x'{bytes(range(256)).hex()}'"

    def decoded(field: str) -> str:
        bytes_sql = ", ".join(
            f'instr({every_byte}, substr(data, 4 * (n."row" % {CHUNK}) + {b + 1}, 1)) - 1 AS b{b}' for b in range(4)
        )
        return f"""(SELECT base + unit * (((b2 & 127) << 16) | (b1 << 8) | b0) FROM (SELECT {bytes_sql} FROM field_chunk
    WHERE step = f.step AND field = '{field}' AND chunk = n."row" / {CHUNK})
    JOIN float32_prefix ON prefix = ((b3 << 1) | (b2 >> 7))) AS {field}"""

    flat = ALONG if dimension == 2 else ()
    columns = [f"0.0 AS {column}" if column in flat else decoded(column) for column in UNITS]
    return f"""CREATE VIEW node_state AS SELECT f.step AS step, f.time AS time, n.node AS node,
    n.x AS x, n.y AS y, n.z AS z, {", ".join(columns)} FROM frame f CROSS JOIN node n
    LEFT JOIN node_death d ON d."row" = n."row" WHERE n.birth <= f.step AND (d.step IS NULL OR d.step > f.step)"""


class _Sorted(NamedTuple):
    """The r rows sorted by id, then by birth."""

    row: NDArray[np.int64]  # (r,)
    birth: NDArray[np.int64]  # (r,)
    ids: NDArray[np.int64]  # (k,) all there are, rising
    first: NDArray[np.int64]  # (k,) where those of each id begin


class Lives:
    """All r nodes that ever lived, in the order of birth."""

    def __init__(self, nodes: Nodes, birth: NDArray[np.int64], death: NDArray[np.int64]) -> None:
        """`birth` (r,) is the first step of a node, `death` (r,) the first step without it, NEVER if it lives."""
        self.nodes, self.birth, self.death = nodes, birth, death

    def rows(self, step: int) -> NDArray[np.int64]:
        """Rows (n,) of the nodes that live at a step."""
        return np.flatnonzero((self.birth <= step) & (step < self.death))

    def at(self, ids: NDArray[np.int64], step: ArrayLike) -> NDArray[np.int64]:
        """Rows (k,) of the nodes with these ids (k,) at a step, or at steps (k,); -1 if none had the id then."""
        table, steps = self._sorted, np.broadcast_to(step, np.shape(ids))
        if not len(table.ids) or not len(ids):
            return np.full(len(ids), -1)
        number = np.searchsorted(table.ids, ids).clip(max=len(table.ids) - 1)
        turn = int(max(self.birth.max(), steps.max())) + 1  # more than any step
        numbers = np.repeat(np.arange(len(table.ids)), np.diff(np.append(table.first, len(table.row))))
        at = np.searchsorted(numbers * turn + table.birth, number * turn + steps, side="right") - 1
        row = table.row[at]
        alive = (self.nodes.ids[row] == ids) & (self.birth[row] <= steps) & (steps < self.death[row])
        return np.where(alive, row, -1)

    def now(self, step: int) -> NDArray[np.int64]:
        """For each row (r,), the index in `rows(step)` of the node with its id at that step; -1 without one."""
        rows = self.rows(step)
        place = np.full(len(self.birth), -1)
        place[rows] = np.arange(len(rows))
        same = self.at(self.nodes.ids, step)
        return np.where(same < 0, -1, place[same])

    def broke(self, breaks: Breaks, rows: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether the bonds (k,) from nodes `rows` (k,) to nodes `ids` (k,) broke during their lives."""
        number = np.unique(np.concatenate([ids, breaks.neighbour]), return_inverse=True)[1]
        node_rows = np.concatenate([rows, self.at(breaks.node, breaks.step)])
        bonds = node_rows * (number.max(initial=0) + 1) + number
        return np.isin(bonds[: len(ids)], bonds[len(ids) :])

    @cached_property
    def _sorted(self) -> _Sorted:
        row = np.lexsort((self.birth, self.nodes.ids))
        ids, first = np.unique(self.nodes.ids[row], return_index=True)
        return _Sorted(row, self.birth[row], ids, first)
