"""Fields of bodies in space: all components of them, and what nodes have where a plane cuts through their cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import fields as stored
from pdpost.measures.cracked import damage_at
from pdpost.measures.fields import FieldError
from pdsolve.results import Results, ResultsError

AXES = "xyz"
OF_BODIES = ("content", "concentration", "solid", "damage", "energy", "displacement", "velocity", "acceleration")


class Cut(NamedTuple):
    """The k nodes whose cells a plane cuts."""

    rows: NDArray[np.int64]  # (k,)
    place: NDArray[np.float64]  # (k, 2) m, in the plane
    delta: NDArray[np.float64]  # (k,) m
    values: NDArray[np.float64]  # (k,) SI
    axes: str  # the two along the plane
    at: float  # m, along the third


def expect_body(results: Results) -> None:
    """Raises ResultsError for a plate."""
    if results.dimension != 3:
        raise ResultsError(f"{results.name}: found a plate, expected a body in space")


def expect_plate(results: Results) -> None:
    """Raises ResultsError for a body in space."""
    if results.dimension == 3:
        raise ResultsError(f"{results.name}: found a body in space, expected a plate, or a model of diffusion")


def usual(results: Results, step: int) -> str:
    """The field that is shown if none is asked for."""
    return "content" if "h" in results.stored(step) else "damage"


def values(results: Results, name: str, step: int, part: str | None = None) -> NDArray[np.float64]:
    """A field (n,) of a body after `step`, or its `part`: x, y, z or magnitude. Raises FieldError, ResultsError."""
    if name not in OF_BODIES:
        raise FieldError(f"found no field '{name}', expected, of a body, one of {', '.join(OF_BODIES)}")
    if name == "damage":
        return damage_at(results, step)
    columns = (*stored.FIELDS[name].columns, *stored.IN_SPACE.get(name, ()))
    parts = (*AXES[: len(columns)], "magnitude") if len(columns) > 1 else ()
    if part is not None and part not in parts:
        expected = f"one of {', '.join(parts)}" if parts else "none, it is a scalar"
        raise FieldError(f"{name}: found no component '{part}', expected {expected}")
    found = np.column_stack([results.field(column, step).astype(float) for column in columns])
    if part in (None, "magnitude"):
        return found[:, 0] if len(columns) == 1 else np.sqrt((found**2).sum(axis=1))
    return np.asarray(found[:, AXES.index(part)])


def cut(results: Results, shown: NDArray[np.float64], step: int, axis: str, at: float) -> Cut:
    """What nodes have, `shown` (n,), where the plane `axis` = `at` (m) cuts. Raises ResultsError where it cuts none."""
    nodes, number = results.nodes(step), AXES.index(axis)
    along = nodes.position[:, number]
    # a plane between two layers of cells shows one of them
    rows = np.flatnonzero((along - nodes.delta / 2 <= at) & (at < along + nodes.delta / 2))
    if not len(rows):
        low, high = float((along - nodes.delta / 2).min()), float((along + nodes.delta / 2).max())
        raise ResultsError(f"{results.name}: found no node at {axis} = {at:g} m, expected {low:g} to {high:g} m")
    others = [each for each in range(3) if each != number]
    place = nodes.position[rows][:, others]
    return Cut(rows, place, nodes.delta[rows], shown[rows], "".join(AXES[each] for each in others), at)
