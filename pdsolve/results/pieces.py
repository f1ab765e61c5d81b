"""Results of so many nodes that each rank writes a database of its own: an index names them, and all are read as one.

The index is the database of the run. What goes by node is in the others: nodes, families, fields and the checkpoint.
Each time that a run begins or goes on, its ranks write a new set of them, and the fields of a step are in the set that
was written then.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.checksums import Row
from pdsolve.results.errors import ResultsError
from pdsolve.results.tables import Tables

OF_RANK = r"\.\d+-\d+"  # behind the name of an index: the databases of ranks, as `files_of` names them
NAME = re.compile(r"[^/\\\0]+" + OF_RANK)
KEY = "pieces"  # of the table meta
OF_NODES = ("node", "family_chunk", "field_chunk", "checkpoint")  # tables that the index does not have


class Pieces(NamedTuple):
    """Databases that ranks wrote in one go."""

    after: int  # the step that it began after
    files: tuple[str, ...]  # names, in the order of their rows; none where the run went on in one process


def files_of(path: Path, number: int, ranks: int) -> tuple[str, ...]:
    """The names of the databases of a set of ranks beside the index at `path`."""
    return tuple(f"{path.name}.{number}-{rank}" for rank in range(ranks))


def pieces_of(text: str, name: str) -> tuple[Pieces, ...]:
    """The sets of databases that an index called `name` has. Raises ResultsError."""
    try:
        pieces = tuple(Pieces(int(after), tuple(map(str, files))) for after, files in json.loads(text))
    except (ValueError, TypeError, RecursionError):
        pieces = ()
    steps = [piece.after for piece in pieces]
    ours = all(NAME.fullmatch(file) for piece in pieces for file in piece.files)
    if not pieces or not pieces[0].files or sorted(steps) != steps or not ours:
        raise ResultsError(f"{name}: table meta: pieces are missing, the names of the files of all ranks")
    return pieces


def beside(index: Path, file: str) -> Path:
    """Where a database of a rank is. Raises ResultsError if it is not beside the index."""
    path = index.parent / Path(file).name
    if path.is_symlink() or not path.is_file():
        raise ResultsError(f"{index}: {path.name} is missing beside it; put the files of all its ranks there")
    return path


class TablesInPieces(Tables):
    """The tables of an index and of the databases of its ranks, as those of one database."""

    def __init__(self, index: Tables, sets: Sequence[tuple[Pieces, Sequence[Tables]]]) -> None:
        """`sets` has the tables of all databases; those of no rank are those of the index."""
        super().__init__(index.connection, index.name, index.path)
        self._index = index
        self._sets = [(pieces.after, list(tables) or [index]) for pieces, tables in sets]

    def _at(self, step: int) -> list[Tables]:
        """The databases that hold what was written after `step`."""
        return [tables for number, (after, tables) in enumerate(self._sets) if number == 0 or after < step][-1]

    def each(self, table: str, where: str = "", values: Row = ()) -> Iterator[Row]:
        """Rows of a table in order; see `Tables`."""
        if table == "checkpoint":
            yield from (row for row in self._checkpoint() if not values or row[0] == values[0])
        elif table == "field_chunk" and values:
            for tables in self._at(int(values[0])):
                yield from tables.each(table, where, values)
        elif table in OF_NODES:
            for tables in self._sets[0][1]:
                yield from tables.each(table, where, values)
        else:
            yield from super().each(table, where, values)

    def _checkpoint(self) -> Iterator[Row]:
        """The rows of the last checkpoint, some of which each rank has: several rows of one name follow each other."""
        of_index = self._index.all("checkpoint")
        yield from of_index
        step = of_index[0][1] if of_index else 0
        tables = self._at(step)
        if tables == [self._index]:
            return
        end = f"@{step}"
        ranks = [
            rank_tables.rows("SELECT name FROM checkpoint WHERE step = ? ORDER BY name", (step,))
            for rank_tables in tables
        ]
        for (name,) in ranks[0]:
            for rank_tables in tables:
                for row in rank_tables.each("checkpoint", "WHERE name = ?", (name,)):
                    yield name.removesuffix(end), *row[1:]

    def all(self, table: str) -> list[Row]:
        """All rows of a table in their order."""
        if table == "checkpoint":
            joined_rows: list[Row] = []  # the data of those of one name in one
            for row in self._checkpoint():
                if joined_rows and joined_rows[-1][0] == row[0]:
                    joined_rows[-1] = (*joined_rows[-1][:-1], joined_rows[-1][-1] + row[-1])
                else:
                    joined_rows.append(row)
            return joined_rows
        if table not in OF_NODES:
            return super().all(table)
        return [row for tables in self._sets[0][1] for row in tables.all(table)]

    def records(self, table: str) -> NDArray[np.void]:
        """All rows of a table of many rows; see `Tables`."""
        if table not in OF_NODES:
            return super().records(table)
        return np.concatenate([tables.records(table) for tables in self._sets[0][1]])

    def count(self, table: str) -> int | None:
        """Number of rows written to a table; None if unknown."""
        if table not in OF_NODES or table == "checkpoint":
            return super().count(table)
        return sum(tables.count(table) or 0 for tables in self._sets[0][1])

    def verify(self) -> None:
        """Read everything, of all ranks, and compare it with the checksums."""
        for tables in dict.fromkeys([self._index, *(rank_tables for _, every in self._sets for rank_tables in every)]):
            tables.verify()
