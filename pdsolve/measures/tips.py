"""Positions of crack tips over time: one branch a tip, and their forks.

    for branch in tips(results):
        branch.time, branch.place, branch.direction, branch.speed

A tip reaches a place when the nodes there crack or, where they cracked ahead of it, when the crack joins them (see
`crack_labels`). Time therefore never decreases along a branch. The path of a tip is the skeleton of the cracked nodes
(see `skeleton`). Nodes that a pre-crack cracked from the start are left out: a crack begins at the tip of its
pre-crack. The arms of cracks of particles are branches directly; their tips are at particles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.document import Horizon
from pdmesh.model.neighbours import tree_of
from pdsolve.fracture.crack_particles import Particles, until
from pdsolve.measures.crack_labels import CrackedNodes, label_cracked_nodes
from pdsolve.measures.cracked_nodes import ROUND_OFF, find_free_pre_crack_tips
from pdsolve.measures.embedded_model import read
from pdsolve.measures.plate_geometry import read_plate_geometry
from pdsolve.measures.skeleton import SLAB, Chain, CrackSkeleton
from pdsolve.measures.speed import WINDOW, TipSpeeds, estimate_tip_speeds, window_for_mean_speed
from pdsolve.results import Results

NEAR_TIP = 3.0  # spacings within which a crack begins or ends at the tip of a pre-crack
BEGINS = 0.2  # spacings: a branch that begins so near to the tip of a pre-crack carries it on
ARM = 10.0  # local spacings of an arm that its direction is measured over
WIDE = 8.0  # local spacings: what is cracked over a greater width is crushed, and no line


@dataclass(frozen=True)
class CrackBranch:
    """The path of a tip from the crack's origin or a fork to where it ends, forks or meets another; k points."""

    points: NDArray[np.float64]  # (k, 2) m
    passing_time: NDArray[np.float64]  # (k,) s, never falling, when the tip came past or left that of a pre-crack
    direction: NDArray[np.float64]  # (k, 2) unit vectors, of some ten spacings around
    length_along_crack: NDArray[np.float64]  # (k,) length from the beginning of the crack, m, over its parents
    speed: TipSpeeds  # (k,) m/s
    node_spacing: NDArray[np.float64]  # (k,) m, of the nodes there
    is_narrow: NDArray[np.bool_]  # (k,) False where so much is cracked that there is no line to tell
    begin_joint: int  # number of the joint it begins at
    end_joint: int  # number of the joint it ends at
    is_of_particles: bool = False  # whether these are particles, so that the tip was at each, and nowhere between
    point_count_before_edge: int | None = (
        None  # how many points come before the edge that the crack runs into; None: all
    )

    @property
    def length(self) -> float:
        """The length of this branch alone, m, without those before it."""
        return float(self.length_along_crack[-1] - self.length_along_crack[0])

    @property
    def mean_speed(self) -> float | None:
        """Length over time, m/s; None if no time passes or it is not a line.

        A crack that runs into an edge has arrived when its tip is a horizon away. The last nodes, whose families the
        edge cuts, come off later, as the two sides part.
        """
        along, time, line = (
            column[: self.point_count_before_edge]
            for column in (self.length_along_crack, self.passing_time, self.is_narrow)
        )
        took = float(time[-1] - time[0])
        return float(along[-1] - along[0]) / took if took > 0 and line.all() else None


@dataclass(frozen=True)
class CrackFork:
    """A place where a crack becomes several."""

    place: tuple[float, float]  # m
    time: float  # s, when the crack came there
    angle_between_outer_arms: float  # degrees between the outer arms
    arm_angles: tuple[float, ...]  # degrees of each arm from the direction the crack came with, to the left positive


class _HorizonGridFileKeys(msgspec.Struct):
    """The key of the grid file that says how far bonds reach."""

    horizon: Horizon = Horizon()


class _PathPoint(NamedTuple):
    """Some cracked nodes, merged to one point of a line."""

    place: NDArray[np.float64]  # (2,) m
    passing_step: float  # a mean, when the tip came past
    spacing: float  # m
    is_narrow: bool


def crack_branches(results: Results, step: int | None = None, threshold: float | None = None) -> list[CrackBranch]:
    """All branches of the cracks after `step` (default: the last), the longest first.

    A node is cracked above the damage `threshold`, which cracks of particles do not use. Mirrored cracks have mirrored
    branches.
    """
    particles = results.particles()
    if len(particles.place):
        return _branches_of_crack_particles(results, particles if step is None else until(particles, step))
    last = int(results.breaks().step.max(initial=0)) if step is None else step
    cracked = label_cracked_nodes(results, last, threshold)
    skeleton = CrackSkeleton(cracked)
    skeleton.remove_short_chains()
    time_step = float(results.meta()["time_step"])
    pre_cracks = np.array([tip for tip, _ in find_free_pre_crack_tips(results.cracks())]).reshape(-1, 2)
    reached: dict[int, tuple[float, float]] = {}  # time and length at joints
    branches = []
    for chain in sorted(skeleton.find_chains_between_joints(), key=lambda chain: (skeleton.slab[chain[0]], chain)):
        points = _path_points_of_chain(skeleton, cracked, chain, pre_cracks)
        branch = _branch_from_chain(chain, points, *reached.get(chain[0], (0.0, 0.0)), time_step)
        branches.append(branch)
        arrival = float(branch.passing_time[-1]), float(branch.length_along_crack[-1])
        reached[chain[-1]] = min(arrival, reached.get(chain[-1], arrival))
    if branches:
        edges = read_plate_geometry(results).plate_shape.boundary
        ratio = read(results, _HorizonGridFileKeys).horizon.ratio
        for number, branch in enumerate(branches):
            # points before its tip is a horizon, `ratio` spacings, from the edge it runs into
            distance = shapely.distance(edges, shapely.points(branch.points))
            away = distance > ratio * branch.node_spacing * (1 - ROUND_OFF)
            before = int(np.flatnonzero(away).max(initial=0)) + 1
            if before < len(away) and branch.passing_time[before - 1] > branch.passing_time[0]:
                branches[number] = replace(branch, point_count_before_edge=before)
    return sorted(branches, key=lambda branch: -branch.length)


def find_forks(branches: Sequence[CrackBranch]) -> list[CrackFork]:
    """Forks, where one of the `branches` ends and two or more begin, in the order of time.

    Directions are those of straight lines through the ten spacings next to the fork.
    """
    fork_list = []
    for joint in sorted({branch.begin_joint for branch in branches}):
        arms = [branch for branch in branches if branch.begin_joint == joint]
        stems = [branch for branch in branches if branch.end_joint == joint]
        if len(arms) < 2 or not stems:
            continue
        came = -np.sum(
            [_initial_direction_of_line(stem.points[::-1], ARM * stem.node_spacing[-1]) for stem in stems], axis=0
        )
        ways = [_initial_direction_of_line(arm.points, ARM * arm.node_spacing[0]) for arm in arms]
        angles = sorted(float(np.degrees(np.arctan2(came[0] * w[1] - came[1] * w[0], came @ w))) for w in ways)
        x, y = arms[0].points[0].tolist()
        fork_list.append(CrackFork((x, y), float(arms[0].passing_time[0]), angles[-1] - angles[0], tuple(angles)))
    return sorted(fork_list, key=lambda fork: fork.time)


def _branches_of_crack_particles(results: Results, particles: Particles) -> list[CrackBranch]:
    """The grown arms of cracks of particles, from the tip of a pre-crack or a fork to an end or the next fork."""
    place, _, parent, step = particles
    after: list[list[int]] = [[] for _ in parent]
    for number in np.flatnonzero(step > 0).tolist():
        after[parent[number]].append(number)
    nodes, time_step = results.nodes(), float(results.meta()["time_step"])
    spacing = nodes.delta[tree_of(nodes.position).query(place)[1]]
    length, branches = np.zeros(len(place)), []
    for first in np.flatnonzero(step > 0).tolist():
        begin = int(parent[first])
        if step[begin] > 0 and len(after[begin]) == 1:
            continue
        chain = [begin, first]
        while len(after[chain[-1]]) == 1:
            chain += after[chain[-1]]
        arms = np.diff(place[chain], axis=0)
        far = np.hypot(*arms.T)
        along = np.asarray(length[begin] + np.concatenate([[0.0], np.cumsum(far)]), dtype=float)
        time = np.asarray(step[[first, *chain[1:]]] * time_step, dtype=float)
        length[chain[-1]] = along[-1]
        line, ways = np.ones(len(chain), dtype=bool), (arms / far[:, None])[[0, *range(len(arms))]]
        fast = estimate_tip_speeds(along, time, spacing[chain], line, time_step)
        points = place[chain], time, ways, along, fast, spacing[chain], line
        branches.append(CrackBranch(*points, begin, chain[-1], is_of_particles=True))
    return sorted(branches, key=lambda branch: -branch.length)


def _branch_from_chain(
    chain: Chain, points: list[_PathPoint], start_time: float, start_length: float, time_step: float
) -> CrackBranch:
    """A chain as a branch; time and length continue from the end of its parent."""
    place, step, spacing, line = (np.array(column) for column in zip(*points, strict=True))
    smooth = place.copy()  # the lattice's zigzag is no way that the tip went
    smooth[1:-1] = (place[:-2] + 2 * place[1:-1] + place[2:]) / 4
    along = start_length + np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(smooth, axis=0).T))])
    time = np.maximum.accumulate(np.maximum(step * time_step, start_time))
    fast = estimate_tip_speeds(along, time, spacing, line, time_step)
    stretches = (
        window_for_mean_speed(along, at, WINDOW * spacing[at]) or slice(None) for at in range(len(place))
    )  # as of its speeds
    direction = np.array([fit_line_direction(place[points]) for points in stretches])
    return CrackBranch(place, time, direction, along, fast, spacing, line, chain[0], chain[-1])


def _path_points_of_chain(
    skeleton: CrackSkeleton, cracked: CrackedNodes, chain: Chain, pre_cracks: NDArray[np.float64]
) -> list[_PathPoint]:
    """The points of a chain, extended to its first and last nodes and to adjacent tips of pre-cracks."""
    points = [_create_path_point_of_nodes(cracked, skeleton.members[at]) for at in chain]
    level, first, last = cracked.spacings_from_origin, skeleton.members[chain[0]], skeleton.members[chain[-1]]
    if chain[0] in skeleton.begins:
        if len(skeleton.links[chain[0]]) == 1 and level[first].mean() >= 0.25:
            points.insert(
                0,
                _create_path_point_of_nodes(cracked, first[level[first] < 0.5])._replace(is_narrow=points[0].is_narrow),
            )
        points[:0] = _pre_crack_tip_near(points[0], pre_cracks)
    if skeleton.is_dead_end(chain[-1]):
        far = level[last].max()
        if far - level[last].mean() >= 0.25:
            points.append(
                _create_path_point_of_nodes(cracked, last[level[last] >= far - 0.5])._replace(
                    is_narrow=points[-1].is_narrow
                )
            )
        points += _pre_crack_tip_near(points[-1], pre_cracks)
    return points


def _create_path_point_of_nodes(cracked: CrackedNodes, rows: NDArray[np.int64]) -> _PathPoint:
    """The centre of nodes; the time is the mean over spacings of length of the first node in each."""
    layer, delta = np.floor(cracked.spacings_from_origin[rows] + ROUND_OFF), cracked.spacing[rows]
    steps = [int(cracked.crack_arrival_step[rows][layer == number].min()) for number in np.unique(layer)]
    place = np.average(cracked.position[rows], axis=0, weights=cracked.damage_with_pre_cracks[rows])
    width = float((delta**2).sum() / delta.mean() ** 2) / SLAB
    return _PathPoint(place, float(np.mean(steps)), float(delta.mean()), width <= WIDE)


def _pre_crack_tip_near(point: _PathPoint, pre_cracks: NDArray[np.float64]) -> list[_PathPoint]:
    """The tip of a pre-crack near a point but not at it, reached at the same time; empty without one."""
    far = np.hypot(*(pre_cracks - point.place).T)
    near = len(far) > 0 and 0.1 * point.spacing < far.min() <= NEAR_TIP * point.spacing
    return [point._replace(place=pre_cracks[far.argmin()])] if near else []


def _initial_direction_of_line(points: NDArray[np.float64], fitted_length: float) -> NDArray[np.float64]:
    """The unit vector along which a line leaves its first point, over its first `fitted_length`, m."""
    far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    near = points[far <= max(fitted_length, far[1] * (1 + ROUND_OFF))]
    return fit_line_direction(near[1:] if len(near) > 3 else near)  # the fork itself lies between its arms


def fit_line_direction(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit vector (2,) of a straight line fitted to points, from the first to the last."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    axis: NDArray[np.float64] = axes[0]
    return axis if axis @ (points[-1] - points[0]) >= 0 else -axis
