"""Columns of a study's table for measured quantities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from pdmesh.model.material import DECLARED

if TYPE_CHECKING:
    from pdsolve.study.description import RunMeasure

OWN = ("number", "key", "status", "error", "file", "repetition")


class Measure(NamedTuple):
    """A quantity measured in each run."""

    unit: str
    meaning: str
    in_space: bool = False  # whether it is one of bodies too


MEASURES = {
    "nodes": Measure("", "nodes", True),
    "bonds": Measure("", "bonds at the start", True),
    "steps": Measure("", "steps, or load steps", True),
    "time": Measure("s", "time that was reached", True),
    "time_step": Measure("s", "time step", True),
    "wall_time": Measure("s", "time that solving took", True),
    "broken_bonds": Measure("", "bonds that broke", True),
    "kinetic": Measure("J/m", "kinetic energy at the end", True),
    "strain": Measure("J/m", "strain energy at the end", True),
    "dissipated": Measure("J/m", "energy that broken bonds took", True),
    "work": Measure("J/m", "work from outside", True),
    "balance": Measure("", "error of the balance of energy over what was put in", True),
    "largest_displacement": Measure("m", "largest displacement of a node, in all frames", True),
    "largest_stretch": Measure("", "largest stretch of a whole bond, in the last frame", True),
    "first_break": Measure("s", "when the first bond broke", True),
    "start": Measure("s", "when a crack started"),
    "branching": Measure("s", "when a crack came to its first fork"),
    "branching_at": Measure("m", "where that is, along its direction"),
    "split": Measure("s", "when the plate was in two"),
    "length": Measure("m", "length of all cracks together"),
    "longest": Measure("m", "length of the longest branch"),
    "speed": Measure("m/s", "mean speed of the longest branch"),
    "branches": Measure("", "branches of cracks"),
    "forks": Measure("", "forks of cracks"),
    "fork_angle": Measure("degrees", "angle of the first fork, between its outer arms"),
    "fork_x": Measure("m", "place of the first fork"),
    "fork_y": Measure("m", "place of the first fork"),
    "direction": Measure("degrees", "angle from the notch over the first straight stretch, the largest of all cracks"),
    "spent": Measure("J/m^2", "energy dissipated per crack area, the median"),
    "pieces": Measure("", "pieces of the plate at the end"),
}


def measures_of(dimension: int) -> dict[str, Measure]:
    """The measures of plates, or of bodies in space, whose energies are in J instead of J/m and which have no crack
    measures."""
    if dimension == 2:
        return MEASURES
    in_space = {"J/m": "J"}
    return {
        name: measure._replace(unit=in_space.get(measure.unit, measure.unit))
        for name, measure in MEASURES.items()
        if measure.in_space
    }


# Of what a study may measure in addition: unit in the plane, unit in space, and meaning
FURTHER = {
    "peak_force": ("N/m", "N", "largest force of"),
    "displacement_at_peak": ("m", "m", "displacement at the largest force of"),
    "J": ("J/m^2", "J/m^2", "J integral of the first tip"),
    "K1": ("Pa m^0.5", "Pa m^0.5", "stress intensity factor of the first tip"),
    "K2": ("Pa m^0.5", "Pa m^0.5", "stress intensity factor of the first tip"),
    "T": ("Pa", "Pa", "T-stress of the first tip"),
    "total": ("", "", "load cycles"),
    "first_break": ("", "", "load cycles until the first bonds broke"),
}


def further_measures(further: Mapping[str, RunMeasure], dimension: int) -> dict[str, Measure]:
    """The measures that a study describes, by their names."""
    measures = {}
    for name, measure in further.items():
        field, value = measure.quantity
        if field == "sql":
            measures[name] = Measure(measure.unit, value)
            continue
        of_condition = field in FURTHER
        *units, meaning = FURTHER[field if of_condition else value]
        meaning = f"{meaning} '{value}'" if of_condition else meaning
        if measure.thickness is None:
            measures[name] = Measure(units[dimension - 2], meaning)
        else:
            measures[name] = Measure("N", f"{meaning}, of a plate {measure.thickness:g} m thick")
    return measures


UNITS = {f"material.{name}": declared.unit for name, declared in DECLARED.items()} | {
    "run.time_step": "s", "run.quiet": "s", "run.damping": "1/s", "run.duration": "s",
}  # of settings of a model  # fmt: skip


def column_of(kind: str, name: str) -> str:
    """Table column of a parameter: its name, with its kind appended if a measure has that name. SQLite ignores case."""
    reserved = {*OWN, *MEASURES}
    return f"{kind} {name}" if name.lower() in reserved else name
