"""Forces of a run's conditions against time and against the displacement of their nodes."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import LoadCell, Run
from pdmesh.model.suggestions import called
from pdpost.reading.embedded_model import read
from pdsolve.results import Results, ResultsError


class _Named(msgspec.Struct):
    """The keys of the grid file that name its conditions and load cells."""

    conditions: list[dict[str, Any]] = []
    run: Run = Run()


CELL = "load cell"


WHAT = ("force", "displacement")


class Reaction(NamedTuple):
    """Force and displacement of one condition at t steps, for a plate per metre of thickness; d is 2 or 3."""

    number: int  # in the model's list of conditions; of a load cell in that of load cells
    name: str  # its name there, or its number
    kind: str  # "load", "displacement", "velocity", "acceleration" or "load cell"
    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    force: NDArray[np.float64]  # (t, d) N/m, of a body N, on the solid
    displacement: NDArray[np.float64]  # (t, d) m, mean of its nodes

    @property
    def axis(self) -> int:
        """The axis (0, 1 or 2) along which the condition acts."""
        return int(np.abs(self.force).max(axis=0).argmax())


def reactions(results: Results) -> list[Reaction]:
    """Reactions of all conditions over the run, then load cells. Raises ResultsError if there are none."""
    rows, ways, model = results.reactions(), "xyz"[: results.dimension], read(results, _Named)
    conditions = model.conditions
    found = []
    wrong = (rows["condition"] < 0) | (rows["condition"] >= len(conditions))
    if wrong.any():
        number = int(rows["condition"][wrong][0])
        raise ResultsError(
            f"{results.name} has forces of condition {number}, which its model lacks: it has {len(conditions)};"
            " solve the model anew"
        )
    for number in np.unique(rows["condition"]).astype(int).tolist():
        mine, condition = rows[rows["condition"] == number], conditions[number]
        force, moved = (np.column_stack([mine[f"{what}_{way}"] for way in ways]) for what in WHAT)
        name = called(condition.get("name"), number)
        found.append(Reaction(number, name, condition["kind"], mine["step"].astype(int), mine["time"], force, moved))
    if not found:
        raise ResultsError(f"{results.name}: no condition acts; use a load or something that is held")
    return found + [_summed(cell, number, found) for number, cell in enumerate(model.run.load_cells)]


def _summed(cell: LoadCell, number: int, found: list[Reaction]) -> Reaction:
    parts = [one for one in found if one.name in cell.of]
    force = np.sum([one.force for one in parts], axis=0)
    moved = np.mean([one.displacement for one in parts], axis=0)
    return Reaction(number, cell.name, CELL, parts[0].step, parts[0].time, force, moved)


def chosen(all_of_them: list[Reaction], names: list[str]) -> list[Reaction]:
    """The reactions with these names or numbers; all if `names` is empty. Raises ResultsError naming the conditions."""
    numbered = {str(one.number): one for one in all_of_them if one.kind != CELL}
    by_name = numbered | {one.name: one for one in all_of_them}
    for name in names:
        if name not in by_name:
            there = ", ".join(one.name if one.kind == CELL else f"{one.number} ({one.name})" for one in all_of_them)
            raise ResultsError(f"--condition: there is no condition '{name}'; use one of {there}")
    return [by_name[name] for name in names] or all_of_them
