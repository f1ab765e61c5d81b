"""Forces of a run's conditions against time and against the displacement of their nodes."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Run
from pdmesh.model.suggestions import called
from pdpost.reading.embedded_model import read
from pdsolve.results import Results, ResultsError


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
