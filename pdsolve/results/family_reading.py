"""Bonds of all nodes as written, checked while decompressing."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.schema import CHUNK, Nodes
from pdsolve.results.tables import Tables
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
