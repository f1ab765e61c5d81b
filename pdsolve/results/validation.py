"""Valid contents of a database's tables beyond matching checksums, as a file may come from anyone.

Each function returns the error as "found ..., expected ...", or None.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.base_structs import MOST_STEPS
from pdmesh.model.document import LARGEST, MOST
from pdsolve.results.checksums import Row
from pdsolve.results.opening import connect
from pdsolve.results.schema import CHUNK, Breaks, Nodes, statements

TYPES: Mapping[str, tuple[type, ...]] = {  # of a column in SQL: what its values are in Python
    "INTEGER": (int,),
    "REAL": (float, int, type(None)),  # there is no NaN in SQL
    "TEXT": (str,),
    "BLOB": (bytes,),
    "": (str, float, int, bytes, type(None)),
}
NO_NODE = "there is no node; the file is damaged, solve the model anew"
LARGEST_INT = 2**62  # what ids may be
NUMBERS = {  # of meta: the bounds of what must be a number, the first of them left out
    "time_step": (0.0, MOST),
    "stable_time_step": (0.0, float("inf")),
    "initial_energy": (-1e100, 1e100),
    "wall_time": (-1.0, 1e15),
    "dimension": (1, 3),
}
WORDS = ("program", "provenance", "units", "mode", "precision", "kernel", "status", "created", "summary", "model")
CHECKPOINTED = ("<f4", "<f8", "<i4", "<i8", "<u4", "<u8", "|i1", "|u1", "|b1", "<i2", "<u2")  # types of arrays


def table_columns(connection: sqlite3.Connection, table: str) -> list[tuple[str, str, int]]:
    """Name, type and kind (0: ordinary) of the columns of a table."""
    with closing(connection.execute(f"PRAGMA table_xinfo({table})")) as rows:
        return [(row[1], row[2], row[6]) for row in rows]


def wrong_schema(connection: sqlite3.Connection, current: bool) -> str | None:
    """Objects in ``sqlite_master`` that are unknown or differ from ours.

    For files of older versions (not `current`), only columns are checked, and some may be missing.
    """
    with closing(connection.execute("SELECT type, name, tbl_name, sql, rootpage FROM sqlite_master")) as rows:
        objects = rows.fetchall()
    ours = [_master(2), _master(3)]
    for kind, name, table, sql, _ in objects:
        if kind == "index" and sql is None and str(name).startswith("sqlite_autoindex_") and table in ours[0]:
            continue
        if (kind, name) not in [("table", expected) for expected in ours[0] if expected != VIEW] + [("view", VIEW)]:
            return f"the {kind} {str(name)[:80]!r} is not pdsolve's; keep yours in another file"
        if current and not any(plain(sql) == master[name] for master in ours):
            return f"the {kind} {name} is not that of pdsolve"
        if not current and kind == "table":
            expected = [*_known_columns()[name], *OLDER.get(name, ())]
            if (
                any(column not in expected for column in table_columns(connection, name))
                or "VIRTUAL" in sql[:20].upper()
            ):
                return f"the table {name} is not that of pdsolve"
    names = [name for kind, name, *_ in objects if kind != "index"]
    missing = [name for name in ours[0] if name not in names] if current else []
    if missing:
        return f"{missing[0]} is missing, which pdsolve writes"
    twice = [name for name in names if names.count(name) > 1]
    return f"{twice[0]} is there twice; it must be there once" if twice else None


VIEW = "node_state"
OLDER = {"family_chunk": [("chunk", "INTEGER", 0)]}  # columns that older versions have written


def plain(sql: str) -> str:
    """SQL without comments and redundant blanks."""
    return " ".join(re.sub(r"--[^\n]*", "", sql).split())


@cache
def _master(dimension: int) -> dict[str, str]:
    """The SQL of our tables and our view, by name."""
    with closing(connect(None)) as connection:
        for statement in statements(dimension):
            connection.execute(statement)
        schema = connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
    return {name: plain(sql) for name, sql in schema}


@cache
def _known_columns() -> dict[str, list[tuple[str, str, int]]]:
    with closing(connect(None)) as connection:
        for statement in statements():
            connection.execute(statement)
        return {name: table_columns(connection, name) for name in _master(2)}


def checked_rows(rows: Iterable[Row], columns: Sequence[tuple[str, str, int]]) -> Iterator[Row | str]:
    """The rows of a table; an invalid row is replaced by its error message."""
    kinds = [TYPES.get(kind, ()) for _, kind, _ in columns]
    for row in rows:
        at = next((at for at, value in enumerate(row) if type(value) not in kinds[at]), None)
        if at is not None:
            yield f"{columns[at][0]} is a {type(row[at]).__name__}; it must be {columns[at][1] or 'a value'}"
            continue
        numbers = ((at, value) for at, value in enumerate(row) if type(value) in (float, int))
        # NaN, which is none in SQL, is not between them either
        large = next((at for at, value in numbers if not -1e100 <= value <= 1e100), None)
        yield row if large is None else f"{columns[large][0]} is {row[large]:g}; it must be at most 1e100"


def wrong_nodes(nodes: Nodes, row: NDArray[np.int64], birth: NDArray[np.int64]) -> str | None:
    """Error in the nodes that ever lived (n,), with rows of the table and births (n,)."""
    count = len(row)
    if not count:
        return NO_NODE
    if not np.array_equal(row, np.arange(count)):
        return "rows are not numbered from 0 on, one after the other"
    for name, bad in (
        ("a place", ~(np.abs(nodes.position) <= LARGEST).all(axis=1)),
        ("a spacing", ~((nodes.delta > 0) & (nodes.delta <= LARGEST))),
        ("an area", ~((nodes.area > 0) & (nodes.area <= MOST))),
        ("an id", np.abs(nodes.ids) > LARGEST_INT),
        ("a count of bonds", (nodes.cut < 0) | (nodes.family < nodes.cut) | (nodes.family > MOST_STEPS)),
        ("a birth", (birth < 0) | (birth > MOST_STEPS)),
    ):
        if bad.any():
            return f"{name} of node {nodes.ids[bad.argmax()]} cannot be; it must be finite and positive"
    if count > 1 and not (np.diff(nodes.ids) > 0).all():
        order = np.lexsort((birth, nodes.ids))
        same = (np.diff(nodes.ids[order]) == 0) & (np.diff(birth[order]) == 0)
        if same.any():
            return f"node {nodes.ids[order[same.argmax()]]} is there twice; an id is one node's at a time"
    return None


def wrong_deaths(step: NDArray[np.int64], row: NDArray[np.int64], birth: NDArray[np.int64]) -> str | None:
    """Error in the steps and rows of deaths (d,), for nodes with these births (n,)."""
    if ((row < 0) | (row >= len(birth))).any() or (step <= birth[row]).any() or len(np.unique(row)) < len(row):
        return "a node dies that is not there then; it must be one of those born before"
    return None


def wrong_epochs(rows: Sequence[Row]) -> str | None:
    """Error in the rows of the table `epoch`."""
    steps = [row[0] for row in rows]
    rises = all(earlier < later for earlier, later in pairwise(steps))
    if steps[:1] != [0] or not rises or not all(0 <= number <= 2**53 for row in rows for number in row):
        return f"epochs at steps {str(steps)[:60]} do not rise from 0 on"
    return None


def wrong_frames(steps: NDArray[np.int64], times: NDArray[np.float64]) -> str | None:
    """Error in the steps and times (t,), s, of frames."""
    if (np.diff(steps) <= 0).any() or ((steps < 0) | (steps > MOST_STEPS)).any():
        return "steps of frames do not rise"
    if not (np.abs(times) <= MOST).all() or (np.diff(times) < 0).any():
        return "times of frames do not rise, or are not finite"
    return None


def wrong_breaks(breaks: Breaks, ids: NDArray[np.int64]) -> str | None:
    """Error in broken bonds (b,), for nodes with these ids (n,)."""
    if ((breaks.step < 0) | (breaks.step > MOST_STEPS)).any() or (np.diff(breaks.step) < 0).any():
        return "steps at which bonds break do not rise"
    strange = ~np.isin(np.concatenate(breaks[1:]), ids)
    if strange.any():
        return f"a bond of node {np.concatenate(breaks[1:])[strange.argmax()]} cannot be; there is no such node"
    return None


def wrong_places(places: NDArray[np.float64]) -> str | None:
    """Error in coordinates, m."""
    return None if (np.abs(places) <= LARGEST).all() else f"a place is beyond {LARGEST:g} m; it must be in metres"


def wrong_particles(step: NDArray[np.int64], parent: NDArray[np.int64], number: NDArray[np.int64]) -> str | None:
    """Error in crack particles: steps, parents and numbers (p,)."""
    if not np.array_equal(number, np.arange(len(number))):
        return "particles are not numbered from 0 on, one after the other"
    if ((step < 0) | (step > MOST_STEPS) | (parent < -1) | (parent >= number)).any():
        return "a particle grew from a later one; it must be an earlier one or -1"
    return None


def wrong_meta(key: object, value: object) -> str | None:
    """Error in a row of the table `meta`."""
    if key in WORDS and not isinstance(value, str):
        return f"{key} is {str(value)[:40]!r}; it must be text"
    if key in NUMBERS:
        low, high = NUMBERS[str(key)]
        if not isinstance(value, float | int) or not low < value <= high:
            return f"{key} is {str(value)[:40]!r}; it must be a number above {low:g}, at most {high:g}"
    return None


def wrong_checkpoint(rows: Sequence[Row]) -> str | None:
    """Error in the rows (name, step, type, CRC or None, data) of a checkpoint."""
    for name, step, kind, *_, data in rows:
        if step != rows[0][1] or not 0 <= step <= MOST_STEPS:
            return f"'{name[:40]}' is of step {step}; all must be of one step"
        if kind not in CHECKPOINTED or len(data) % np.dtype(kind).itemsize:
            return f"'{name[:40]}' is {len(data)} bytes of {kind[:20]!r}; it must be an array of numbers"
    return None


def wrong_chunk(first: int, bonds: Any, rows: int) -> str | None:
    """Error in the numbers of bonds (n,) of the nodes from row `first` on, of `rows` in all."""
    if not len(bonds) or len(bonds) > CHUNK or first + len(bonds) > rows or (bonds < 0).any() or (bonds >= rows).any():
        return f"bonds of {len(bonds)} nodes from row {first} on are there; there are {rows} rows"
    return None
