"""Results that hold displacements which were never solved for, to ask questions of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from new_databases import create_writer
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Results
from pdsolve.run.measures import EnergyBalanceRow


def plate(side: int = 13, spacing: float = 1e-3, horizon: float = 3.01, jitter: float = 0.0) -> tuple[Nodes, Families]:
    """A square of nodes, moved off their lattice by up to `jitter` spacings, each bonded to those near it."""
    y, x = np.mgrid[0:side, 0:side]
    position = spacing * np.column_stack([x.ravel(), y.ravel()]).astype(float)
    position += jitter * spacing * np.random.default_rng(3).uniform(-1, 1, position.shape)
    near = np.hypot(*(position[:, None] - position).transpose(2, 0, 1)) <= horizon * spacing
    np.fill_diagonal(near, False)
    count = len(position)
    start = np.concatenate([[0], np.cumsum(near.sum(axis=1))])
    delta, area = np.full(count, spacing), np.random.default_rng(1).uniform(0.5, 1.0, count) * spacing**2
    family = near.sum(axis=1)
    nodes = Nodes(np.arange(1, count + 1) * 3, position, delta, area, family, np.zeros(count, dtype=np.int64))
    return nodes, Families(start, np.nonzero(near)[1])


def block(
    sides: tuple[int, int, int] = (9, 8, 7), spacing: float = 1e-3, horizon: float = 3.01
) -> tuple[Nodes, Families]:
    """A block of cubes with a corner at the origin, each bonded to those near it."""
    along = [(np.arange(side) + 0.5) * spacing for side in sides]
    position = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    tree, count = cKDTree(position), len(position)
    near = tree.query_pairs(horizon * spacing, output_type="ndarray")
    own, other = np.concatenate([near, near[:, ::-1]]).T
    order = np.lexsort((other, own))
    family = np.bincount(own, minlength=count)
    start = np.concatenate([[0], np.cumsum(family)])
    delta, volume = np.full(count, spacing), np.full(count, spacing**3)
    nodes = Nodes(np.arange(1, count + 1), position, delta, volume, family, np.zeros(count, dtype=np.int64))
    return nodes, Families(start, other[order])


MODEL = {"notch": [], "nodes": [], "material": {"E": 70e9, "rho": 2000.0, "G0": 10.0}}


def results_of(
    nodes: Nodes,
    families: Families,
    u: NDArray[np.float64],
    broken: list[tuple[int, int, int]],
    model: object = MODEL,
    cracks: NDArray[np.float64] | None = None,
    path: Path | None = None,
    ledger: Sequence[EnergyBalanceRow] = (),
    *,
    fields: Mapping[str, NDArray[np.float64]] | None = None,
    reactions: Sequence[tuple[Any, ...]] = (),
) -> Results:
    """Results, in memory or at `path`: a frame, at step 10, of displacements (n, d) or of the `fields` (n,), and bonds
    (step, node, neighbour) broken."""

    def part(first: int, last: int) -> Families:
        start = families.start[first : last + 1]
        return Families(start - start[0], families.neighbour[start[0] : start[-1]])

    d = u.shape[1]
    cracks = np.empty((0, {2: 4, 3: 9}[d])) if cracks is None else cracks
    meta = {"time_step": 1e-6, "model": json.dumps(model)} | ({"dimension": 3} if d == 3 else {})
    writer = create_writer(path, nodes, part, cracks, meta)
    breaks = Breaks(*np.array(broken, dtype=np.int64).reshape(-1, 3).T)
    fields = dict(zip(("ux", "uy", "uz"), u.T, strict=False)) if fields is None else fields
    writer.write(FrameRecord(10, 1e-5, fields, breaks, ledger, [], {}, reactions))
    if path is not None:
        writer.close("finished")
        return Results.open(path)
    return Results(writer.connection, "memory")
