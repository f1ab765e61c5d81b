"""Cracks drawn by hand: results in which chosen nodes lose four of their ten bonds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from new_databases import create_writer

from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Results
from pdsolve.run.measures import EnergyBalanceRow

NOTCH = np.array([[0.0, 0.0, 4.5e-3, 0.0]])  # of `lattice`


def lattice(columns: int = 20, rows: int = 9, below: int | None = None) -> Nodes:
    """Nodes 1 mm apart with ten bonds each, those of the first five columns of the row y = 0 cut.

    That row is the middle one, or has `below` rows below it.
    """
    y, x = np.mgrid[0:rows, 0:columns]
    position = 1e-3 * np.column_stack([x.ravel(), y.ravel() - (rows // 2 if below is None else below)])
    count = columns * rows
    cut = np.where((position[:, 1] == 0) & (position[:, 0] < 4.5e-3), 4, 0)
    ids = np.arange(1, count + 1)
    return Nodes(ids, position, np.full(count, 1e-3), np.full(count, 1e-6), np.full(count, 10), cut)


def at(nodes: Nodes, x: int, y: int) -> int:
    """The id of a node by its place in mm."""
    return int(nodes.ids[np.isclose(nodes.position, [1e-3 * x, 1e-3 * y]).all(axis=1)].item())


def alone(first: int, last: int) -> Families:
    """Nodes without bonds."""
    return Families(np.zeros(last - first + 1, dtype=np.int64), np.zeros(0, dtype=np.int64))


def run(
    nodes: Nodes,
    cracked: list[tuple[int, int, int]],
    notch: np.ndarray = NOTCH,
    model: str = "{}",
    particles: Sequence[tuple[int, int, float, float]] = (),
) -> Results:
    """Results in which nodes (step, x, y) lose four of their ten bonds; steps of 1 us. Cracks may be particles: the
    step of each, who it grew from, and where it is, mm."""
    writer = create_writer(None, nodes, alone, notch, {"time_step": 1e-6, "model": model})
    rows = [(step, at(nodes, x, y), 1) for step, x, y in cracked for _ in range(4)]
    breaks = Breaks(*np.array(sorted(rows), dtype=np.int64).reshape(-1, 3).T)
    grown = [(at, step, parent, 1e-3 * x, 1e-3 * y, 0.0, 0.0) for at, (step, parent, x, y) in enumerate(particles)]
    books = [EnergyBalanceRow(100, 1e-4, *[0.0] * 6, len(rows))]
    writer.write(FrameRecord(100, 1e-4, None, breaks, books, [], {}, particles=grown))
    return Results(writer.connection, "memory")


def at_steps(nodes: Nodes, steps: np.ndarray, time_step: float = 1e-6) -> Results:
    """Results in which each node (n,) loses four of its ten bonds in its step; those below 1 keep theirs."""
    writer = create_writer(None, nodes, alone, np.empty((0, 4)), {"time_step": time_step, "model": "{}"})
    cracked = np.flatnonzero(steps > 0)
    order = np.repeat(cracked[np.argsort(steps[cracked], kind="stable")], 4)
    step, node = steps[order].astype(np.int64), nodes.ids[order]
    last = int(step.max(initial=0))
    books = [EnergyBalanceRow(last, last * time_step, *[0.0] * 6, len(step))]
    writer.write(FrameRecord(last, last * time_step, None, Breaks(step, node, np.ones_like(node)), books, [], {}))
    return Results(writer.connection, "memory")
