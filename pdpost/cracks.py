"""Where the crack is: cracked nodes, tip, start of propagation, branching; from the breaks, to the step.

The definitions: damage is 1 - intact / initial bonds, bonds cut by a pre-crack counted as broken; a node is
cracked above `CRACKED`. The crack of these functions runs towards larger x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pdsolve.results import Nodes, Results

CRACKED = 0.35
ADVANCE = 1.5  # of the finest spacing: a tip this far from its first place has started
COLUMNS = 3  # that hold two clusters of cracked nodes make a branch
APART = 2.0  # spacings between two clusters
ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Event:
    """Something that happened to a crack; x is None where a place means nothing."""

    step: int
    time: float  # s
    x: float  # m


@dataclass(frozen=True)
class Growth:
    """What became of a crack: its first tip, when it started to grow, and when and where it branched."""

    initial_tip: float  # m
    start: Event | None
    branching: Event | None
    final_tip: float  # m


def growth(results: Results) -> Growth:
    """Follow the crack of a run through all its steps. O(steps with breaks * nodes)."""
    nodes = results.nodes()
    time_step = float(results.meta()["time_step"])
    x = nodes.position[:, 0]
    first = tip = float("-inf")
    start: Event | None = None
    branching: Event | None = None
    for step, damage in damage_by_step(results, nodes):
        cracked = damage > CRACKED
        tip = float(x[cracked].max(initial=float("-inf")))
        if step == 0:
            first = tip
        if start is None and tip >= first + (ADVANCE - ROUND_OFF) * nodes.delta.min():
            start = Event(step, step * time_step, tip)
        if start is not None and branching is None:
            place = branch_place(nodes, cracked)
            branching = None if place is None else Event(step, step * time_step, place)
    return Growth(first, start, branching, tip)


def damage_by_step(results: Results, nodes: Nodes) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Step and damage (n,), for step 0 and then for each step in which a bond broke."""
    breaks = results.breaks()
    order = np.argsort(nodes.ids)
    row = order[np.searchsorted(nodes.ids, breaks.node, sorter=order)]
    gone = nodes.cut.copy()
    yield 0, _damage(gone, nodes.family)
    steps, starts = np.unique(breaks.step, return_index=True)
    for step, rows in zip(steps.tolist(), np.split(row, starts[1:]), strict=True) if len(steps) else ():
        gone += np.bincount(rows, minlength=len(gone))
        yield step, _damage(gone, nodes.family)


def _damage(gone: NDArray[np.int64], family: NDArray[np.int64]) -> NDArray[np.float64]:
    return gone / np.maximum(family, 1)


def branch_place(nodes: Nodes, cracked: NDArray[np.bool_]) -> float | None:
    """The smallest x (m) of the columns that hold two clusters of cracked nodes, if there are enough of them."""
    x, y = nodes.position[cracked].T
    delta = nodes.delta[cracked]
    column = np.round(x / nodes.delta.min()).astype(np.int64)
    order = np.lexsort((y, column))
    column, x, y, delta = column[order], x[order], y[order], delta[order]
    gap = (np.diff(y) > (APART + ROUND_OFF) * delta[1:]) & (np.diff(column) == 0)
    double, where = np.unique(column[1:][gap], return_index=True)
    return float(x[1:][gap][where[0]]) if len(double) >= COLUMNS else None
