"""What became of a crack: when it started, branched, split the plate, and at which angle it left its notch.

A crack runs along a direction, x unless told otherwise: its tip is the furthest cracked node along it, or, of cracks
that are particles, the furthest of these. Where all tips were, and when, is in `tips`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdmesh.model.fields import CRACKED
from pdmesh.model.graphs import connected
from pdpost.measures.cracked import LINKED, ROUND_OFF, cracked_since, pre_crack_tips
from pdpost.measures.regions import grown
from pdpost.measures.segments import distances
from pdpost.measures.tips import forks, tips
from pdsolve.results import Nodes, Results

ADVANCE = 1.5  # of the finest spacing: a crack this far from what was cracked at first has started
COLUMNS = 3  # that hold two clusters of cracked nodes make a branch
APART = 2.0  # spacings between two clusters
BESIDE = 3.0  # spacings: how far the flanks of a pre-crack reach
OFF_LINE = 3.0  # of the finest spacing: how far from the line of its notch a crack's direction is measured
PIECE = 0.02  # of all nodes: smaller parts are crumbs
FIT = 5  # nodes that a direction needs at least

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
    nodes: int  # that the line was fitted to; of cracks that are particles, these


def growth(results: Results, direction: tuple[float, float] = (1.0, 0.0), threshold: float = CRACKED) -> Growth:
    """Follow the cracks of a run through all its steps; damage above `threshold` is cracked, places are `direction`'s.

    Start: a node is cracked that is 1.5 of the finest spacings away from all that were at first, or, where none was,
    the first. Branching: at least three columns across the direction hold two arms of a crack, see `branch_place`; the
    flanks of pre-cracks do not count. Of cracks that are particles these are the first that grows, and the first fork.
    Split: see `is_split`.
    """
    nodes, breaks, since = results.nodes(), results.breaks(), cracked_since(results, threshold)
    time_step = float(results.meta()["time_step"])
    along = nodes.position @ np.array(direction)
    across = nodes.position @ np.array([-direction[1], direction[0]])
    first = int(breaks.step[0]) if len(breaks.step) else None
    start = _start(nodes, since)
    branching = None
    ahead = np.flatnonzero((since > 0) & ~_flanks(nodes, results.cracks()))
    for step in np.unique(since[ahead]).tolist() if start is not None else ():
        rows = ahead[since[ahead] <= step]
        place = branch_place(along[rows], across[rows], nodes.delta[rows])
        if place is not None and step >= start:
            branching = Event(step, step * time_step, place)
            break
    found = Growth(
        None if first is None else Event(first, first * time_step),
        _furthest(along[since == 0]),
        None if start is None else Event(start, start * time_step, _furthest(along[since == start])),
        branching,
        _split(nodes, since, time_step),
        _furthest(along[since >= 0]),
    )
    return _of_particles(results, found, np.array(direction)) if len(results.particles().place) else found


def _of_particles(results: Results, found: Growth, direction: NDArray[np.float64]) -> Growth:
    """What became of cracks that are particles."""
    place, _, _, step = results.particles()
    time_step, along = float(results.meta()["time_step"]), place @ direction
    start = branching = None
    if step.any():
        first = int(step[step > 0].min())
        start = Event(first, first * time_step, _furthest(along[step == first]))
    for fork in forks(tips(results))[:1]:
        branching = Event(round(fork.time / time_step), fork.time, float(np.array(fork.place) @ direction))
    ends = _furthest(along[step == 0]), _furthest(along)
    return replace(found, initial_tip=ends[0], start=start, branching=branching, final_tip=ends[1])


def _start(nodes: Nodes, since: NDArray[np.int64]) -> int | None:
    """The step in which a crack starts, of nodes (n,) that are cracked since a step, -1 if they are not."""
    grown = since > 0
    if (since == 0).any():
        away, _ = cKDTree(nodes.position[since == 0]).query(nodes.position)
        grown &= away >= (ADVANCE - ROUND_OFF) * nodes.delta.min()
    return int(since[grown].min()) if grown.any() else None


def _flanks(nodes: Nodes, cracks: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which nodes (n,) are beside a pre-crack and not ahead of its tips."""
    away = distances(nodes.position, cracks[:, :2], cracks[:, 2:])
    tips = np.array([tip for tip, _ in pre_crack_tips(cracks)]).reshape(-1, 2)
    return (away < BESIDE * nodes.delta) & (away < distances(nodes.position, tips, tips) - ROUND_OFF * nodes.delta)


def _furthest(along: NDArray[np.float64]) -> float | None:
    return float(along.max()) if len(along) else None


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
    return connected(len(position), *near.T)


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


def _split(nodes: Nodes, since: NDArray[np.int64], time_step: float) -> Event | None:
    """The first step at which the plate is split, by bisection: what is cracked stays so."""
    steps = np.unique(since[since >= 0])
    low, high = 0, len(steps)
    while low < high:
        middle = (low + high) // 2
        if is_split(nodes, (since >= 0) & (since <= steps[middle])):
            high = middle
        else:
            low = middle + 1
    return None if low == len(steps) else Event(int(steps[low]), int(steps[low]) * time_step)


def directions(results: Results, step: int, threshold: float = CRACKED) -> list[Direction]:
    """The directions of the cracks from each inner tip of a pre-crack, after `step`.

    A straight line through the nodes of the crack at the tip, weighted by damage, as far as they are more than three
    spacings to one side of the line of the pre-crack. Sides without such a crack are left out. Of cracks that are
    particles: their first arms.
    """
    if len(results.particles().place):
        return _first_arms(results, step)
    nodes, here = results.nodes(step), grown(results, step, threshold)
    if not len(here.position):
        return []
    finest = float(nodes.delta.min())
    low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
    found = []
    for tip, heading in pre_crack_tips(results.cracks()):
        if (tip < low + finest).any() or (tip > high - finest).any():
            continue
        distance, nearest = cKDTree(here.position).query(tip)
        if distance > 3 * finest or here.level[nearest] > 3:  # a crack that came here began elsewhere
            continue
        along, across = (here.position - tip) @ heading, (here.position - tip) @ np.array([-heading[1], heading[0]])
        mine = (here.crack == here.crack[nearest]) & (np.abs(across) > OFF_LINE * finest) & (along > -finest)
        for side in (1.0, -1.0):
            used = mine & (side * across > 0)
            if used.sum() >= FIT:
                slope, _ = np.polyfit(side * across[used], along[used], 1, w=np.sqrt(here.damage[used]))
                angle = side * float(np.degrees(np.arctan2(1.0, slope)))
                found.append(Direction((float(tip[0]), float(tip[1])), angle, int(used.sum())))
    return found


def _first_arms(results: Results, step: int) -> list[Direction]:
    """The directions in which cracks that are particles left the tips of pre-cracks."""
    found = []
    branches = tips(results, step)
    for tip, heading in pre_crack_tips(results.cracks()):
        for branch in branches:
            if np.hypot(*(branch.place[0] - tip)) <= ROUND_OFF * branch.spacing[0]:
                along, across = branch.direction[0] @ heading, branch.direction[0] @ [-heading[1], heading[0]]
                angle = float(np.degrees(np.arctan2(across, along)))
                found.append(Direction((float(tip[0]), float(tip[1])), angle, len(branch.place) - 1))
    return found
