"""Fields of bodies in space on plane sections: values of the nodes whose cells a plane cuts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.measures import fields
from pdsolve.results import Results, ResultsError

AXES = "xyz"
ROUND_OFF = 1e-6  # of a spacing


class FieldSlice(NamedTuple):
    """The k nodes whose cells a plane cuts."""

    node_rows: NDArray[np.int64]  # (k,)
    plane_coordinates: NDArray[np.float64]  # (k, 2) m, in the plane
    spacing: NDArray[np.float64]  # (k,) m
    values: NDArray[np.float64]  # (k,) SI
    plane_axes: str  # the two along the plane
    plane_position: float  # m, along the third


def expect_3d_body(results: Results) -> None:
    """Raise ResultsError for a plate."""
    if results.dimension != 3:
        raise ResultsError(f"{results.name} is a plate; use a body in space")


def reliable_field_values(
    results: Results, field_name: str, step: int, component: str | None = None
) -> NDArray[np.float64]:
    """A component (n,) of a field after `step`, NaN where it is unreliable. Raises FieldError, ResultsError."""
    component = fields.choose_component(field_name, component, results.dimension)
    return np.where(
        fields.find_unreliable_nodes(results, field_name, step),
        np.nan,
        fields.field_values(results, field_name, step, component or None),
    )


def default_slice_point(results: Results) -> NDArray[np.float64]:
    """The centre (3,) of the bounding box of the nodes at the start, m.

    Where no node lies at that coordinate along an axis, it is the nearest node's.
    """
    nodes = results.nodes(0)
    centre = (nodes.position.min(axis=0) + nodes.position.max(axis=0)) / 2
    away = np.abs(nodes.position - centre)
    nearest = nodes.position[away.argmin(axis=0), np.arange(3)]
    has_node = (away <= (0.5 + ROUND_OFF) * nodes.delta[:, None]).any(axis=0)
    return np.asarray(np.where(has_node, centre, nearest))


def slice_field_values_by_plane(
    results: Results, values: NDArray[np.float64], step: int, axis: str, plane_position: float
) -> FieldSlice:
    """The values `values` (n,) of the nodes cut by the plane `axis` = `plane_position` (m). Raises ResultsError if it
    cuts none."""
    nodes, number = results.nodes(step), AXES.index(axis)
    along = nodes.position[:, number]
    # a plane between two layers of cells shows the upper one, whatever places were rounded to
    above = (plane_position - along) / nodes.delta + ROUND_OFF
    rows = np.flatnonzero((above >= -0.5) & (above < 0.5))
    if not len(rows):
        low, high = float((along - nodes.delta / 2).min()), float((along + nodes.delta / 2).max())
        raise ResultsError(f"{results.name} has no node at {axis} = {plane_position:g} m; use {low:g} to {high:g} m")
    others = [other_axis for other_axis in range(3) if other_axis != number]
    place = nodes.position[rows][:, others]
    return FieldSlice(
        rows, place, nodes.delta[rows], values[rows], "".join(AXES[other_axis] for other_axis in others), plane_position
    )
