"""Displacement, velocity and acceleration of nodes against time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import selection
from pdmesh.model.fields import FIELDS
from pdpost.reading.frames import frames
from pdpost.reading.stored import vector
from pdsolve.results import Results, ResultsError

QUANTITIES = ("displacement", "velocity", "acceleration")
COMPONENTS = ("x", "y", "magnitude")
OUTSIDE = 1.5  # spacings: a place further from every node is not of the plate


class History(NamedTuple):
    """A quantity of a node, or the mean of several, at t times."""

    label: str
    component: str  # x, y or magnitude
    nodes: tuple[int, ...]  # ids
    source: str  # "probe" or "frames"
    time: NDArray[np.float64]  # (t,) s
    value: NDArray[np.float64]  # (t,)
    low: NDArray[np.float64]  # (t,) smallest of the nodes
    high: NDArray[np.float64]  # (t,) largest
    place: tuple[float, float] | None  # m, of the one node
    off: float  # m, from the place that was asked for


def of_node(results: Results, node: int, quantity: str = "displacement", component: str = "magnitude") -> History:
    """The history of one node: from its probe if there is one, else from the frames. Raises ResultsError."""
    nodes = results.nodes()
    (rows,) = np.nonzero(nodes.ids == node)
    if not len(rows):
        raise ResultsError(
            f"{results.name}: found no node {node}, expected one of {nodes.ids.min()} to {nodes.ids.max()}"
        )
    x, y = nodes.position[rows[0]].tolist()
    label = f"node {node}"
    probes = results.probes()
    mine = probes[probes["node"] == node]
    if len(mine):
        x_column, y_column = FIELDS[quantity].columns
        value = _component(mine[x_column], mine[y_column], component)
        return History(label, component, (node,), "probe", mine["time"], value, value, value, (x, y), 0.0)
    time, values = _of_frames(results, rows, quantity, component)
    return History(label, component, (node,), "frames", time, values[:, 0], values[:, 0], values[:, 0], (x, y), 0.0)


def at_place(
    results: Results, place: tuple[float, float], quantity: str = "displacement", component: str = "magnitude"
) -> History:
    """The history of the node nearest to a place, m. Raises ResultsError where that is not on the plate."""
    nodes = results.nodes()
    far = np.hypot(*(nodes.position - place).T)
    row = int(far.argmin())
    if not far[row] <= OUTSIDE * nodes.delta[row]:
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        raise ResultsError(
            f"{results.name}: found no node near {place[0]:g},{place[1]:g}: node {nodes.ids[row]} is {far[row]:.3g} m"
            f" away; expected a place on the plate, from {low[0]:g},{low[1]:g} to {high[0]:g},{high[1]:g}"
        )
    return of_node(results, int(nodes.ids[row]), quantity, component)._replace(off=float(far[row]))


def in_box(
    results: Results,
    box: tuple[float, float, float, float],
    quantity: str = "displacement",
    component: str = "magnitude",
) -> History:
    """The mean of all nodes in a box x0, y0, x1, y1, m, with the smallest and the largest. Raises ResultsError."""
    nodes = results.nodes()
    inside = selection.in_box(nodes, np.sort(np.reshape(box, (2, 2)), axis=0))
    if not inside.any():
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        raise ResultsError(
            f"{results.name}: found no node in the box {','.join(f'{side:g}' for side in box)}, expected some; the"
            f" plate goes from {low[0]:g},{low[1]:g} to {high[0]:g},{high[1]:g}"
        )
    rows = np.flatnonzero(inside)
    time, values = _of_frames(results, rows, quantity, component)
    ids = tuple(nodes.ids[rows].tolist())
    label = f"mean of {len(ids)} nodes" if len(ids) > 1 else f"node {ids[0]}"
    middle = values.mean(axis=1)
    return History(label, component, ids, "frames", time, middle, values.min(axis=1), values.max(axis=1), None, 0.0)


def _of_frames(
    results: Results, rows: NDArray[np.int64], quantity: str, component: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (t,) of the frames and the quantity (t, rows) there."""
    steps, times = frames(results)
    found = (vector(results, quantity, int(step))[rows] for step in steps)
    return times, np.array([_component(both[:, 0], both[:, 1], component) for both in found])


def _component(x: NDArray[np.float64], y: NDArray[np.float64], component: str) -> NDArray[np.float64]:
    return {"x": x, "y": y}.get(component, np.hypot(x, y))
