"""Position of each crack tip at a time, and the undisturbed room around it.

A tip moves as in `tips`. Until a crack grows from a pre-crack, the tip stays at the pre-crack's end. The room around a
tip reaches to the first obstacle: anything that is not elastic plate with one straight crack.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.node_arrays import selected
from pdsolve.measures.cracked_nodes import find_free_pre_crack_tips
from pdsolve.measures.embedded_model import read
from pdsolve.measures.plate_geometry import read_plate_geometry
from pdsolve.measures.strain import elastic_constants_of_nodes
from pdsolve.measures.tips import ARM, BEGINS, CrackBranch, crack_branches
from pdsolve.results import Nodes, Results

TOUCHES = 1e-3  # spacings: a crack that ends so near to another ends on it
BESIDE, SLANT = 1.5, 0.1  # spacings beside a tip's line, and of the way back: what is nearer to it is its own crack
FREE = ("initial velocity", "initial displacement")  # conditions that leave their nodes alone


@dataclass(frozen=True)
class TipHistory:
    """A tip through a run: the end of a pre-crack, the branch that grows from it, or both."""

    name: str
    branch_number: int  # of its branch; pre-cracks that have none come after all branches
    pre_crack_tip: NDArray[np.float64] | None  # (2,) m: the tip of the pre-crack
    initial_heading: NDArray[np.float64]  # (2,) unit vector at the pre-crack tip, or the first of a branch alone
    branch: CrackBranch | None
    last_time: float  # s: up to when it was there, before it forked or met another crack or an edge; inf if it still is

    def tip_at(self, time: float) -> TipPosition | None:
        """The tip at a time, s; None before it exists and after it ends."""
        branch = self.branch
        if branch is None or time < branch.passing_time[0]:
            return None if self.pre_crack_tip is None else TipPosition(self.pre_crack_tip, self.initial_heading)
        if time > self.last_time:
            return None
        place = branch_points_until(branch, time)
        if branch.is_of_particles:
            return TipPosition(place[-1], branch.direction[len(place) - 1])
        back = (
            branch.length_along_crack[min(len(place), len(branch.length_along_crack)) - 1]
            - branch.length_along_crack[: len(place)]
        )
        near = place[back <= ARM * branch.node_spacing[min(len(place), len(branch.length_along_crack)) - 1]]
        if len(near) < 2:
            return TipPosition(place[-1], self.initial_heading)
        way = near[-1] - near[0]
        return TipPosition(place[-1], way / np.hypot(*way))


class TipPosition(NamedTuple):
    """Position of a tip and the direction in which it arrived."""

    place: NDArray[np.float64]  # (2,) m
    direction: NDArray[np.float64]  # (2,) unit vector


class UndisturbedRoom(NamedTuple):
    """Radius around a tip that holds only elastic plate and the tip's own straight crack."""

    radius: float  # m
    nearest_obstacle: str  # what is there


def tip_histories(results: Results, step: int) -> list[TipHistory]:
    """Tips of all cracks until `step`: branches, the longest first, then pre-cracks that do not grow.

    Ends of pre-cracks on the edge of the plate or off it are no tips.
    """
    branches, spacing = crack_branches(results, step), float(results.nodes(0).delta.min())
    edge = read_plate_geometry(results).plate_shape.boundary
    starts = [
        (tip, heading)
        for tip, heading in find_free_pre_crack_tips(results.cracks())
        if place_is_on_plate(results, tip) and edge.distance(shapely.Point(tip)) > spacing / 2
    ]
    tip_fronts, carried = [], set()
    for number, branch in enumerate(branches):
        near = [k for k, (tip, _) in enumerate(starts) if np.hypot(*(tip - branch.points[0])) < BEGINS * spacing]
        carried |= set(near)
        start, heading = starts[near[0]] if near else (None, branch.direction[0])
        tip_fronts.append(
            TipHistory(f"branch {number}", number, start, heading, branch, _last_time_of_tip(results, branch, branches))
        )
    for k, (tip, heading) in enumerate(starts):
        if k not in carried:
            tip_fronts.append(TipHistory(f"pre-crack {k}", len(branches) + k, tip, heading, None, np.inf))
    return tip_fronts


def _last_time_of_tip(results: Results, branch: CrackBranch, branches: Sequence[CrackBranch]) -> float:
    """The last time, s, at which the tip of a branch existed."""
    arms = [other_branch for other_branch in branches if other_branch.begin_joint == branch.end_joint]
    if not branch.is_of_particles:
        met = any(other_branch.end_joint == branch.end_joint for other_branch in branches if other_branch is not branch)
        return float(branch.passing_time[-1]) if arms or met else np.inf
    if arms:
        return float(np.nextafter(arms[0].passing_time[0], 0))
    end = shapely.Point(branch.points[-1])
    spacing = branch.node_spacing[-1]
    shape = read_plate_geometry(results).plate_shape
    arm_segments = (np.stack([any_branch.points[:-1], any_branch.points[1:]], axis=1) for any_branch in branches)
    every = shapely.linestrings(np.concatenate([results.cracks().reshape(-1, 2, 2), *arm_segments]))
    on_another = shapely.dwithin(every, end, TOUCHES * spacing).sum() > 1  # its own last arm is one
    on_edge = not shapely.intersects(shape, end) or shape.boundary.distance(end) <= spacing / 2
    return float(np.nextafter(branch.passing_time[-1], 0)) if on_another or on_edge else np.inf


def nearest_node_row(nodes: Nodes, place: NDArray[np.float64]) -> int:
    """The row of the node nearest to a place (2,), m."""
    return int(np.hypot(*(nodes.position - place).T).argmin())


def place_is_on_plate(results: Results, place: NDArray[np.float64]) -> bool:
    """Whether a place is on the plate."""
    return bool(shapely.intersects_xy(read_plate_geometry(results).plate_shape, *place))


def branch_points_until(branch: CrackBranch, time: float) -> NDArray[np.float64]:
    """Points (k, 2) of a branch up to its tip's position at a time, s, and at least the first."""
    count = int(np.searchsorted(branch.passing_time, time, side="right"))
    place = branch.points[:count]
    if count < len(branch.passing_time) and not branch.is_of_particles:
        share = (time - branch.passing_time[count - 1]) / (branch.passing_time[count] - branch.passing_time[count - 1])
        if share > 0:
            place = np.vstack([place, place[-1] + share * (branch.points[count] - place[-1])])
    return place


class TipObstacles:
    """Obstacles to the fields around a tip, in one run."""

    def __init__(self, results: Results, tips: Sequence[TipHistory]) -> None:
        self._results, self._fronts = results, tips
        self._edge = read_plate_geometry(results).plate_shape.boundary

    def find_undisturbed_room(self, tip: TipPosition, step: int, time: float) -> UndisturbedRoom:
        """The room around a tip after a step."""
        nodes = self._results.nodes(step)
        elastic = elastic_constants_of_nodes(self._results, step)
        near = nearest_node_row(nodes, tip.place)
        other_material = elastic.differs_from(near)
        tips = [at.place for front in self._fronts if (at := front.tip_at(time)) is not None]
        other_tips = np.array([place for place in tips if not np.array_equal(place, tip.place)]).reshape(-1, 2)
        rooms = [UndisturbedRoom(float(self._edge.distance(shapely.Point(tip.place))), "the edge of the plate")]
        # points of all cracks except those on the line behind the tip
        spacing = float(nodes.delta[near])
        segments = [self._results.cracks().reshape(-1, 2, 2)]
        for front in self._fronts:
            if front.branch is not None and time >= front.branch.passing_time[0]:
                line = branch_points_until(front.branch, time)
                segments.append(np.stack([line[:-1], line[1:]], axis=1))
        every = np.concatenate(segments)
        count = np.ceil(2 * np.hypot(*(every[:, 1] - every[:, 0]).T) / spacing).astype(int) + 1
        share = np.concatenate([np.linspace(0, 1, number) for number in count]) if len(count) else np.zeros(0)
        start, end = (np.repeat(every[:, side], count, axis=0) for side in (0, 1))
        away = start + share[:, None] * (end - start) - tip.place
        along, across = away @ tip.direction, away @ np.array([-tip.direction[1], tip.direction[0]])
        behind_tip = (along < spacing) & (np.abs(across) <= np.maximum(BESIDE * spacing, SLANT * np.abs(along)))
        for places, what in (
            (other_tips, "another tip"),
            ((away + tip.place)[~behind_tip], "another crack or a bend of this one"),
            (nodes.position[nodes_of_loads_and_grips(self._results, nodes)], "nodes of a load or grip"),
            (nodes.position[other_material], "another material"),
        ):
            if len(places):
                rooms.append(UndisturbedRoom(float(np.hypot(*(places - tip.place).T).min()), what))
        return min(rooms)


class _ConditionGridFileKeys(msgspec.Struct):
    """The keys of the grid file that hold its conditions."""

    conditions: list[dict[str, Any]] = []


def nodes_of_loads_and_grips(results: Results, nodes: Nodes) -> NDArray[np.bool_]:
    """Mask (n,) of the nodes on which conditions act after the start, but for dead pressure in cracks, whose part in
    the integrals is known."""
    acted_on = np.zeros(len(nodes.ids), dtype=bool)
    for condition in read(results, _ConditionGridFileKeys).conditions:
        if condition["kind"] not in FREE and (not condition.get("faces") or condition.get("following")):
            acted_on |= selected(nodes, condition.get("nodes"), condition.get("box"))
    return acted_on
