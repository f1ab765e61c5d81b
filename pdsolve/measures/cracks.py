"""Events in the life of a crack: when it started, branched and split the plate.

A crack runs along a direction, by default x. Its tip is the cracked node (or crack particle) furthest along it. The
module `tips` has the positions of all tips over time, `directions` the direction in which a crack left its notch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdmesh.model.neighbours import connected
from pdsolve.measures.cracked_nodes import LINKED, ROUND_OFF, first_cracked_step_of_nodes
from pdsolve.measures.tips import CrackBranch, crack_branches, find_forks
from pdsolve.results import Nodes, Results

ADVANCE = 1.5  # of the finest spacing: a crack this far from what was cracked at first has started
PIECE = 0.02  # of all nodes: smaller parts are crumbs

DIRECTIONS = {"right": (1.0, 0.0), "left": (-1.0, 0.0), "up": (0.0, 1.0), "down": (0.0, -1.0)}


@dataclass(frozen=True)
class CrackEvent:
    """Something that happened to a crack, and how far along its direction; None where a place has no meaning."""

    step: int
    time: float  # s
    along: float | None = None  # m


@dataclass(frozen=True)
class CrackEvents:
    """Events of a crack; those that did not happen are None."""

    first_break: CrackEvent | None
    initial_tip: float | None  # m; None where nothing was cracked before
    start: CrackEvent | None
    branching: CrackEvent | None
    split: CrackEvent | None
    final_tip: float | None  # m


def find_crack_events(
    results: Results,
    direction: tuple[float, float] = (1.0, 0.0),
    threshold: float | None = None,
    step: int | None = None,
    branches: Sequence[CrackBranch] | None = None,
) -> CrackEvents:
    """Events of the cracks of a run until `step` (default: its end), along the unit vector `direction`.

    A node is cracked above the damage `threshold`. Start: the first cracked node at least 1.5 of the finest spacings
    away from all that were cracked at first, or the first cracked node of all if none was; for cracks of particles, the
    first growth. Branching: the first fork of `branches`, by default of `crack_branches`. Split: see `plate_is_split`.
    """
    nodes, breaks, since = results.nodes(step), results.breaks(), first_cracked_step_of_nodes(results, threshold, step)
    until = np.inf if step is None else step
    since = np.where(since <= until, since, -1)
    time_step = float(results.meta()["time_step"])
    axis = np.array(direction)
    along = nodes.position @ axis
    begins = since > 0
    if (since == 0).any():
        away, _ = cKDTree(nodes.position[since == 0]).query(nodes.position)
        begins &= away >= (ADVANCE - ROUND_OFF) * nodes.delta.min()
    when = since
    grown = since[begins]
    ends = (_largest_value_or_none(along[since == 0]), _largest_value_or_none(along[since >= 0]))
    particles = results.particles()
    if len(particles.place):
        along, when = particles.place @ axis, particles.step
        grown = when[(when > 0) & (when <= until)]
        ends = _largest_value_or_none(along[when == 0]), _largest_value_or_none(along[when <= until])
    start = None
    if len(grown):
        begun = int(grown.min())
        start = CrackEvent(begun, begun * time_step, _largest_value_or_none(along[when == begun]))
    branches = crack_branches(results, step, threshold) if branches is None else branches
    forked = [
        CrackEvent(round(fork.time / time_step), fork.time, float(axis @ fork.place))
        for fork in find_forks(branches)[:1]
    ]
    first = breaks.step[:1][breaks.step[:1] <= until].tolist()
    # the first step at which the plate is split, by bisection, as a cracked node stays cracked
    steps = np.unique(since[since >= 0])
    low, high = 0, len(steps)
    while low < high:
        middle = (low + high) // 2
        if plate_is_split(nodes, (since >= 0) & (since <= steps[middle])):
            high = middle
        else:
            low = middle + 1
    return CrackEvents(
        first_break=CrackEvent(first[0], first[0] * time_step) if first else None,
        initial_tip=ends[0],
        start=start,
        branching=forked[0] if forked else None,
        split=None if low == len(steps) else CrackEvent(int(steps[low]), int(steps[low]) * time_step),
        final_tip=ends[1],
    )


def _largest_value_or_none(values: NDArray[np.float64]) -> float | None:
    return float(values.max()) if len(values) else None


def cluster_nodes(
    position: NDArray[np.float64], spacing: NDArray[np.float64], link_distance: float = LINKED
) -> NDArray[np.int64]:
    """Cluster number (c,) of each node; nodes within `link_distance` times the larger spacing of each other are
    linked."""
    tree = cKDTree(position)
    reach = (link_distance + ROUND_OFF) * float(spacing.max(initial=0.0))
    near = tree.query_pairs(reach, output_type="ndarray")
    far = np.hypot(*(position[near[:, 0]] - position[near[:, 1]]).T)
    near = near[far <= (link_distance + ROUND_OFF) * spacing[near].max(axis=1, initial=0.0)]
    return connected(len(position), *near.T)


def plate_is_split(nodes: Nodes, cracked: NDArray[np.bool_]) -> bool:
    """Whether cracked nodes, with the holes between them, part the plate.

    A chain of cracked nodes with links of at most 1.5 spacings leads from side to side exactly if no path of neighbours
    along rows and columns leads around it. The sound nodes are then in more than one piece.
    """
    sound = ~cracked
    if sound.all() or not sound.any():
        return False
    piece = np.bincount(cluster_nodes(nodes.position[sound], nodes.delta[sound], link_distance=1.0))
    return int((piece > PIECE * len(cracked)).sum()) > 1
