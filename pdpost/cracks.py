"""Where the crack is: cracked nodes, tips, start, branching, angle, split; from the breaks, to the step.

Damage is 1 - intact / initial bonds, bonds cut by a pre-crack counted as broken; a node is cracked above `CRACKED`.
A crack runs along a direction, x unless told otherwise: its tip is the furthest cracked node along it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pdsolve.results import Nodes, Results

CRACKED = 0.35
ADVANCE = 1.5  # of the finest spacing: a tip this far from its first place has started
COLUMNS = 3  # that hold two clusters of cracked nodes make a branch
APART = 2.0  # spacings between two clusters
LINKED = 1.5  # spacings between two nodes of a chain
OFF_LINE = 3.0  # of the finest spacing: how far from the line of its notch a crack's direction is measured
PIECE = 0.02  # of all nodes: smaller parts are crumbs
FIT = 5  # nodes that a direction needs at least
ROUND_OFF = 1e-6

DIRECTIONS = {"right": (1.0, 0.0), "left": (-1.0, 0.0), "up": (0.0, 1.0), "down": (0.0, -1.0)}


@dataclass(frozen=True)
class Event:
    """Something that happened to a crack, and how far along its direction; no place where none has a meaning."""

    step: int
    time: float  # s
    along: float | None = None  # m


@dataclass(frozen=True)
class Growth:
    """What became of a crack. Events that did not happen are None."""

    first_break: Event | None
    initial_tip: float | None  # m; None where nothing was cracked before
    start: Event | None
    branching: Event | None
    split: Event | None
    final_tip: float | None  # m


@dataclass(frozen=True)
class Direction:
    """Where a crack from the tip of a pre-crack went, to the left (positive) or right of its line."""

    tip: tuple[float, float]  # m
    angle: float  # degrees from the line of the pre-crack
    nodes: int  # that the line was fitted to


def growth(results: Results, direction: tuple[float, float] = (1.0, 0.0), threshold: float = CRACKED) -> Growth:
    """Follow the crack of a run along a direction through all its steps; damage above `threshold` is cracked.

    Start: the tip is 1.5 of the finest spacings further than at first, or, where nothing was cracked, the first
    node is. Branching: ahead of the first tip, at least three columns across the direction hold two arms of a
    crack, see `branch_place`. Split: see `is_split`.
    """
    nodes = results.nodes()
    time_step = float(results.meta()["time_step"])
    along = nodes.position @ np.array(direction)
    across = nodes.position @ np.array([-direction[1], direction[0]])
    events: dict[str, Event] = {}
    initial = tip = None
    for step, damage in damage_by_step(results, nodes):
        cracked = damage > threshold
        tip = float(along[cracked].max()) if cracked.any() else None
        if step == 0:
            initial = tip
            continue
        events.setdefault("first break", Event(step, step * time_step))
        needed = -np.inf if initial is None else initial + (ADVANCE - ROUND_OFF) * nodes.delta.min()
        if "start" not in events and tip is not None and tip >= needed:
            events["start"] = Event(step, step * time_step, tip)
        if "start" in events and "branching" not in events:
            ahead = cracked if initial is None else cracked & (along >= initial)
            place = branch_place(along[ahead], across[ahead], nodes.delta[ahead])
            if place is not None:
                events["branching"] = Event(step, step * time_step, place)
    return Growth(
        events.get("first break"),
        initial,
        events.get("start"),
        events.get("branching"),
        _split(results, nodes, time_step, threshold),
        tip,
    )


def damage_by_step(results: Results, nodes: Nodes) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Step and damage (n,), for step 0 and then for each step in which a bond broke."""
    breaks = results.breaks()
    row = _rows(nodes, breaks.node)
    gone = nodes.cut.copy()
    family = np.maximum(nodes.family, 1)
    yield 0, gone / family
    steps, starts = np.unique(breaks.step, return_index=True)
    for step, rows in zip(steps.tolist(), np.split(row, starts[1:]), strict=True) if len(steps) else ():
        gone += np.bincount(rows, minlength=len(gone))
        yield step, gone / family


def damage_at(results: Results, step: int) -> NDArray[np.float64]:
    """Damage (n,) after any step, between frames as well."""
    nodes, breaks = results.nodes(), results.breaks()
    row = _rows(nodes, breaks.node[breaks.step <= step])
    gone: NDArray[np.int64] = nodes.cut + np.bincount(row, minlength=len(nodes.ids))
    return gone / np.maximum(nodes.family, 1)


def branch_place(along: NDArray[np.float64], across: NDArray[np.float64], delta: NDArray[np.float64]) -> float | None:
    """The first column of cracked nodes (c,), m along, that holds two arms of one crack, if there are enough.

    Arms are clusters of a column more than two spacings apart; they belong to one crack if a chain of cracked
    nodes links them, so that cracks growing side by side are no branch.
    """
    if not len(along):
        return None
    crack = clusters(np.column_stack([along, across]), delta)
    column = np.round(along / delta.min()).astype(np.int64)
    order = np.lexsort((across, column, crack))
    crack, column, along, across, delta = crack[order], column[order], along[order], across[order], delta[order]
    together = (np.diff(column) == 0) & (np.diff(crack) == 0)
    gap = (np.diff(across) > (APART + ROUND_OFF) * delta[1:]) & together
    for number in np.unique(crack[1:][gap]):
        double, where = np.unique(column[1:][gap & (crack[1:] == number)], return_index=True)
        if len(double) >= COLUMNS:
            return float(along[1:][gap & (crack[1:] == number)][where[0]])
    return None


def clusters(position: NDArray[np.float64], delta: NDArray[np.float64], link: float = LINKED) -> NDArray[np.int64]:
    """The number (c,) of each node's cluster; nodes within `link` of the larger spacing are linked."""
    tree = cKDTree(position)
    reach = (link + ROUND_OFF) * float(delta.max(initial=0.0))
    near = tree.query_pairs(reach, output_type="ndarray")
    far = np.hypot(*(position[near[:, 0]] - position[near[:, 1]]).T)
    near = near[far <= (link + ROUND_OFF) * delta[near].max(axis=1, initial=0.0)]
    graph = coo_matrix((np.ones(len(near), dtype=np.int8), near.T), (len(position),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def is_split(nodes: Nodes, cracked: NDArray[np.bool_]) -> bool:
    """Whether cracked nodes, with the holes between them, part the plate.

    A chain of cracked nodes no more than 1.5 spacings from link to link leads from side to side just where no
    path of neighbours along rows and columns leads around it: sound nodes are then in more than one piece.
    """
    sound = ~cracked
    if sound.all() or not sound.any():
        return False
    piece = np.bincount(clusters(nodes.position[sound], nodes.delta[sound], link=1.0))
    return int((piece > PIECE * len(cracked)).sum()) > 1


def _split(results: Results, nodes: Nodes, time_step: float, threshold: float) -> Event | None:
    """The first step at which the plate is split, by bisection: what is cracked stays so."""
    since = cracked_since(results, threshold)
    steps = np.unique(since[since >= 0])
    low, high = 0, len(steps)
    while low < high:
        middle = (low + high) // 2
        if is_split(nodes, (since >= 0) & (since <= steps[middle])):
            high = middle
        else:
            low = middle + 1
    return None if low == len(steps) else Event(int(steps[low]), int(steps[low]) * time_step)


def cracked_since(results: Results, threshold: float = CRACKED) -> NDArray[np.int64]:
    """The step (n,) from which on each node's damage is above `threshold`; -1 for nodes that stay sound."""
    nodes, breaks = results.nodes(), results.breaks()
    family = np.maximum(nodes.family, 1)
    most = np.floor(threshold * family).astype(np.int64)  # bonds a node may lose, but for a rounding
    most += ((most + 1) / family <= threshold).astype(np.int64) - (most / family > threshold)
    further = most + 1 - nodes.cut  # breaks that a node needs
    row = _rows(nodes, breaks.node)
    order = np.lexsort((breaks.step, row))
    count = np.bincount(row, minlength=len(family))
    first = np.cumsum(count) - count
    since = np.where(further <= 0, 0, -1)
    broke = (further > 0) & (further <= count)
    since[broke] = breaks.step[order][(first + further - 1)[broke]]
    return since


def _rows(nodes: Nodes, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows of nodes with these ids."""
    order = np.argsort(nodes.ids)
    return np.asarray(order[np.searchsorted(nodes.ids, ids, sorter=order)], dtype=np.int64)


def directions(results: Results, step: int, threshold: float = CRACKED) -> list[Direction]:
    """The directions of the cracks from each inner tip of a pre-crack, after `step`.

    A straight line through the cluster of cracked nodes at the tip, weighted by damage, as far as they are more
    than three spacings to one side of the line of the pre-crack. Sides without such a crack are left out.
    """
    nodes, damage = results.nodes(), damage_at(results, step)
    grown = damage > threshold
    if not grown.any():
        return []
    finest = float(nodes.delta.min())
    position, weight = nodes.position[grown], damage[grown]
    cluster = clusters(position, nodes.delta[grown])
    low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
    found = []
    for tip, heading in tips(results.cracks()):
        if (tip < low + finest).any() or (tip > high - finest).any():
            continue
        distance, nearest = cKDTree(position).query(tip)
        if distance > 3 * finest:
            continue
        along, across = (position - tip) @ heading, (position - tip) @ np.array([-heading[1], heading[0]])
        mine = (cluster == cluster[nearest]) & (np.abs(across) > OFF_LINE * finest) & (along > -finest)
        for side in (1.0, -1.0):
            used = mine & (side * across > 0)
            if used.sum() >= FIT:
                slope, _ = np.polyfit(side * across[used], along[used], 1, w=np.sqrt(weight[used]))
                angle = side * float(np.degrees(np.arctan2(1.0, slope)))
                found.append(Direction((float(tip[0]), float(tip[1])), angle, int(used.sum())))
    return found


def tips(cracks: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Ends of pre-cracks that no other segment touches, with the unit vector the crack arrives with."""
    ends = np.concatenate([cracks[:, :2], cracks[:, 2:]])
    starts = np.concatenate([cracks[:, 2:], cracks[:, :2]])
    for tip, start in zip(ends, starts, strict=True):
        if (np.abs(ends - tip).max(axis=1) < 1e-12).sum() == 1:
            yield tip, (tip - start) / np.hypot(*(tip - start))
