"""What a laboratory reads off a test: openings between two places, and load cells that sum forces."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pdmesh.model.plain_numbers import PlainStruct
from pdmesh.model.timed_selection import Vector

if TYPE_CHECKING:
    from pdmesh.model.document import Run

CRACK, ARC = "crack", "arc"  # controls: the length of cracks of particles; that of the path of an elastic body


class Gap(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A monitored opening: how much longer the distance between the nodes nearest to two places has become."""

    name: str
    ends: tuple[Vector, Vector]  # m


class LoadCell(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The sum of the forces of some conditions."""

    name: str
    of: tuple[str, ...]  # names of conditions


def contradiction(run: Run, conditions: Sequence[str]) -> str | None:
    """What is wrong with the monitors of a run whose `conditions` have these names; None if nothing is.

    The place below ``run``, what was found and expected.
    """
    gaps = [gap.name for gap in run.gaps]
    for key, names in (("gaps", gaps), ("load_cells", [cell.name for cell in run.load_cells])):
        for number, name in enumerate(names):
            if not name or Counter(names)[name] > 1:
                return f"{key}[{number}].name: '{name}' is used {Counter(names)[name]} times; use a name of its own"
    for number, gap in enumerate(run.gaps):
        if gap.ends[0] == gap.ends[1]:
            return f"gaps[{number}].ends: both are one place; use two places"
    for number, cell in enumerate(run.load_cells):
        missing = [name for name in cell.of if name not in conditions]
        if missing or not cell.of:
            actual = f"'{missing[0]}'" if missing else "none"
            condition_names = ", ".join(filter(None, conditions)) or "a name"
            return f"load_cells[{number}].of has {actual}; use names of conditions: {condition_names}"
    return _of_control(run, gaps)


def _of_control(run: Run, gaps: list[str]) -> str | None:
    """What is wrong with the control of a path."""
    static, length = run.static, CRACK if run.cracks == "particles" else ARC
    if static.control == length:
        if length in gaps:
            return f"gaps[{gaps.index(length)}].name is '{length}', which is a control by a length; use another"
        unused = "none, as a length is the control"
        return (
            None
            if static.opening is None
            else f"static.opening ({static.opening:g}) cannot be used; leave it out: {unused}"
        )
    if static.control is not None and static.control not in gaps:
        gap_names = ", ".join(gaps) or "a gap (run.gaps has none)"
        return f"static.control is '{static.control}'; use {gap_names}, or {length}"
    if (static.control is None) != (static.opening is None):
        present_key, missing_key = ("opening", "control") if static.control is None else ("control", "opening")
        return f"static.{missing_key} is missing; give it, as there is a static.{present_key}"
    return None
