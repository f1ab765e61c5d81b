"""Forces of a run's conditions against time and against the displacement of their nodes.

A force is also drawn against the opening between two places.
"""

from __future__ import annotations

from functools import reduce
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Run
from pdmesh.model.suggestions import called
from pdsolve.measures.embedded_model import read
from pdsolve.measures.histories import nearest_node_history
from pdsolve.results import Results, ResultsError

Place = tuple[float, ...]  # x, y and in a body z, m


class _ConditionGridFileKeys(msgspec.Struct):
    """The keys of the grid file that name its conditions and load cells."""

    conditions: list[dict[str, Any]] = []
    run: Run = Run()


CELL = "load cell"


WHAT = ("force", "displacement")


class ConditionForceHistory(NamedTuple):
    """Force and displacement of one condition at t steps, for a plate per metre of thickness; d is 2 or 3."""

    number: int  # in the model's list of conditions; of a load cell in that of load cells
    name: str  # its name there, or its number
    kind: str  # "load", "displacement", "velocity", "acceleration" or "load cell"
    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    force: NDArray[np.float64]  # (t, d) N/m, of a body N, on the solid
    displacement: NDArray[np.float64]  # (t, d) m, mean of its nodes

    @property
    def main_axis(self) -> int:
        """The axis (0, 1 or 2) along which the condition acts."""
        return int(np.abs(self.force).max(axis=0).argmax())

    @property
    def force_along_axis(self) -> NDArray[np.float64]:
        """Force (t,) along the main axis, positive at the peak."""
        force = self.force[:, self.main_axis]
        return force * (np.sign(force[self.peak_index]) or 1.0)

    @property
    def displacement_along_axis(self) -> NDArray[np.float64]:
        """Displacement (t,) along the main axis, positive where it goes with the force at the peak."""
        return self.displacement[:, self.main_axis] * (np.sign(self.force[self.peak_index, self.main_axis]) or 1.0)

    @property
    def peak_index(self) -> int:
        """The row with the largest force along the main axis, by its size."""
        return int(np.abs(self.force[:, self.main_axis]).argmax())

    @property
    def peak_resultant(self) -> float:
        """The largest size of the force, all components together."""
        return float(reduce(np.hypot, self.force.T).max())

    def is_oblique(self, axis: int) -> bool:
        """Whether the largest force has other components than that along an axis."""
        return self.peak_resultant > OBLIQUE * float(np.abs(self.force[:, axis]).max())


OBLIQUE = 1.02  # of a component: the largest force is larger, so that another component has a fifth of it
STILL = 1e-3  # of the largest displacement: a condition that moves less is fixed


def moving_conditions(histories: list[ConditionForceHistory]) -> list[ConditionForceHistory]:
    """Those whose nodes move along their main axis and that exert a force."""
    ways = [float(np.ptp(history.displacement[:, history.main_axis])) for history in histories]
    least = max(STILL * max(ways, default=0.0), np.finfo(float).tiny)
    return [history for history, way in zip(histories, ways, strict=True) if way >= least and history.force.any()]


def strongest(histories: list[ConditionForceHistory], most: int) -> list[ConditionForceHistory]:
    """At most `most` of the histories, those with the largest forces, in their order."""
    sizes = [float(np.abs(history.force).max()) for history in histories]
    rows = sorted(np.argsort(sizes, kind="stable")[::-1][:most].tolist())
    return [histories[row] for row in rows]


def read_condition_force_histories(results: Results) -> list[ConditionForceHistory]:
    """Reactions of all conditions over the run, then load cells. Raises ResultsError if there are none."""
    rows, ways, model = results.reactions(), "xyz"[: results.dimension], read(results, _ConditionGridFileKeys)
    conditions = model.conditions
    all_reactions = []
    wrong = (rows["condition"] < 0) | (rows["condition"] >= len(conditions))
    if wrong.any():
        number = int(rows["condition"][wrong][0])
        raise ResultsError(
            f"{results.name} has forces of condition {number}, which its model lacks: it has {len(conditions)};"
            " solve the model anew"
        )
    for number in np.unique(rows["condition"]).astype(int).tolist():
        mine, condition = rows[rows["condition"] == number], conditions[number]
        force, displacement = (np.column_stack([mine[f"{what}_{way}"] for way in ways]) for what in WHAT)
        name = called(condition.get("name"), number)
        all_reactions.append(
            ConditionForceHistory(
                number, name, condition["kind"], mine["step"].astype(int), mine["time"], force, displacement
            )
        )
    if not all_reactions:
        raise ResultsError(f"{results.name}: no condition acts; use a load or something that is held")
    cells = []
    for number, cell in enumerate(model.run.load_cells):
        parts = [reaction for reaction in all_reactions if reaction.name in cell.of]
        force = np.sum([reaction.force for reaction in parts], axis=0)
        displacement = np.mean([reaction.displacement for reaction in parts], axis=0)
        cells.append(ConditionForceHistory(number, cell.name, CELL, parts[0].step, parts[0].time, force, displacement))
    return all_reactions + cells


def select_condition_force_histories(
    all_reactions: list[ConditionForceHistory], names: list[str]
) -> list[ConditionForceHistory]:
    """The reactions with these names or numbers; all if `names` is empty. Raises ResultsError naming the conditions."""
    numbered = {str(reaction.number): reaction for reaction in all_reactions if reaction.kind != CELL}
    by_name = numbered | {reaction.name: reaction for reaction in all_reactions}
    for name in names:
        if name not in by_name:
            available = ", ".join(
                reaction.name if reaction.kind == CELL else f"{reaction.number} ({reaction.name})"
                for reaction in all_reactions
            )
            raise ResultsError(f"--condition: there is no condition '{name}'; use one of {available}")
    return [by_name[name] for name in names] or all_reactions


class GapOpeningHistory(NamedTuple):
    """The opening between two nodes at t steps."""

    node_ids: tuple[int, int]  # ids
    time: NDArray[np.float64]  # (t,) s
    opening: NDArray[np.float64]  # (t,) m, how much longer the way between them has become


class ForceOpeningCurve(NamedTuple):
    """A force against a gap, at the t times at which both are recorded."""

    condition_name: str  # of the condition
    axis: int  # 0, 1 or 2
    opening: NDArray[np.float64]  # (t,) m
    force: NDArray[np.float64]  # (t,) N/m, of a body N

    @property
    def peak_force_index(self) -> int:
        """The step with the largest force, by its size."""
        return int(np.abs(self.force).argmax())

    @property
    def work_under_curve(self) -> float:
        """The area under the curve, J/m, of a body J: the work of a force that acts where the gap opens."""
        return float(np.sum(np.diff(self.opening) * (self.force[1:] + self.force[:-1])) / 2)


class _GapGridFileKeys(msgspec.Struct):
    """The key of the grid file that has its gaps."""

    run: Run = Run()


def read_named_gap(results: Results, name: str) -> GapOpeningHistory:
    """The gap of this name in the model. Raises ResultsError naming those that there are."""
    gaps = {gap_settings.name: gap_settings for gap_settings in read(results, _GapGridFileKeys).run.gaps}
    if name not in gaps:
        raise ResultsError(f"--gap: there is no gap '{name}'; use {', '.join(gaps) or 'two places: it has no gap'}")
    first_place, second_place = gaps[name].ends
    return measure_gap_between_places(results, first_place, second_place)


def measure_gap_between_places(results: Results, first_place: Place, second_place: Place) -> GapOpeningHistory:
    """The gap between the nodes nearest to two places, m, from probes if there are any, else from frames.

    Raises ResultsError for places off the plate, for places with the same nearest node, and where nothing is recorded.
    """
    ways = "xyz"[: results.dimension]
    ends = [
        [nearest_node_history(results, place, "displacement", component) for component in ways]
        for place in (first_place, second_place)
    ]
    nodes = ends[0][0].node_ids[0], ends[1][0].node_ids[0]
    if nodes[0] == nodes[1]:
        raise ResultsError(f"--gap: node {nodes[0]} is nearest to both places; use places nearest to two nodes")
    first, second = (np.array(end[0].place) for end in ends)
    times = [end[0].time for end in ends]
    time = times[0][np.isin(times[0], times[1])]
    u = [np.column_stack([part.value[np.isin(part.time, time)] for part in end]) for end in ends]
    way = reduce(np.hypot, (second - first + u[1].astype(float) - u[0]).T)
    return GapOpeningHistory(nodes, time, way - float(reduce(np.hypot, second - first)))


def force_over_gap_opening(
    gap: GapOpeningHistory, reaction: ConditionForceHistory, axis: int, averaged_steps: int = 1
) -> ForceOpeningCurve:
    """The force of a condition along an axis against a gap; `averaged_steps` is the number of steps in a running mean.

    Raises ResultsError where fewer than two steps are left.
    """
    both = np.intersect1d(gap.time, reaction.time)
    opening = gap.opening[np.isin(gap.time, both)]
    force = reaction.force[np.isin(reaction.time, both), axis]
    if len(both) < max(2, averaged_steps):
        raise ResultsError(
            f"--gap: the force and the gap are both known at {len(both)} times; {max(2, averaged_steps)} or more are"
            " needed (pdsolve --probe X,Y records places as often as forces)"
        )
    mean = np.ones(averaged_steps) / averaged_steps
    return ForceOpeningCurve(reaction.name, axis, *(np.convolve(column, mean, "valid") for column in (opening, force)))
