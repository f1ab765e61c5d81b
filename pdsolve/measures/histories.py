"""Displacement, velocity and acceleration of nodes against time; NaN while a node does not exist."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import node_arrays
from pdmesh.model.output_fields import of_dimension
from pdsolve.measures.fields import FieldError
from pdsolve.measures.frame_steps import frames, last_frame, vector
from pdsolve.measures.strain import materials_of_nodes
from pdsolve.results import Nodes, Results, ResultsError

OUTSIDE = 1.5  # spacings: a place further from every node is not of the plate


Place = tuple[float, ...]  # x, y and in a body z, m


class NodeHistory(NamedTuple):
    """A quantity of one node, or the mean of several nodes by mass, at t times."""

    label: str
    component: str  # x, y, of a body z, or magnitude
    node_ids: tuple[int, ...]  # ids
    source: str  # "probe" or "frames"
    time: NDArray[np.float64]  # (t,) s
    value: NDArray[np.float64]  # (t,)
    smallest: NDArray[np.float64]  # (t,) smallest of the nodes
    largest: NDArray[np.float64]  # (t,) largest
    place: Place | None  # m, of the one node
    distance_from_place: float  # m, from the place that was asked for


def node_history(
    results: Results, node: int, quantity: str = "displacement", component: str = "magnitude"
) -> NodeHistory:
    """The history of one node, from its probe if there is one, else from the frames. Raises ResultsError."""
    nodes = results.lives().nodes
    (rows,) = np.nonzero(nodes.ids == node)
    if not len(rows):
        raise ResultsError(f"{results.name} has no node {node}; use one of {nodes.ids.min()} to {nodes.ids.max()}")
    place = tuple(nodes.position[rows[-1]].tolist())
    label = f"node {node}"
    probes = results.probes()
    mine = probes[probes["node"] == node]
    is_complete = len(mine) > 0
    if is_complete and len(results.epochs()) > 1:  # a row for each balance row in the node's life
        steps = results.history()["step"].astype(np.int64)
        is_complete = len(mine) == int((results.lives().at(np.full(len(steps), node), steps) >= 0).sum())
    if is_complete:
        columns = of_dimension(quantity, results.dimension)
        value = _vector_component(np.column_stack([mine[column] for column in columns]), component)
        return NodeHistory(label, component, (node,), "probe", mine["time"], value, value, value, place, 0.0)
    time, values = _read_quantity_of_frames(
        results, lambda nodes: np.flatnonzero(nodes.ids == node), quantity, component
    )
    value = np.array([frame_values[0] if len(frame_values) else np.nan for frame_values in values])
    return NodeHistory(label, component, (node,), "frames", time, value, value, value, place, 0.0)


def usual_history_nodes(results: Results) -> list[int]:
    """Ids of the nodes of the default history: the probes, or else the node with the largest final displacement.

    Raises ResultsError.
    """
    probed = np.unique(results.probes()["node"])
    if len(probed):
        return [int(node) for node in probed]
    displacement = reduce(np.hypot, vector(results, "displacement", last_frame(results)).T)
    return [int(results.nodes().ids[int(np.nanargmax(displacement))])]


def nearest_node_history(
    results: Results, place: Place, quantity: str = "displacement", component: str = "magnitude"
) -> NodeHistory:
    """The history of the node nearest to a place, m; where nodes change, the nearest one at each frame.

    Raises ResultsError if the place is not on the plate.
    """
    _expect_coordinate_count(results, "--at", place, 1)
    nodes = results.nodes()
    far = _distances_from_place(nodes, place)
    row = int(far.argmin())
    if not far[row] <= OUTSIDE * nodes.delta[row]:
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        raise ResultsError(
            f"{results.name}: no node is near {_format_place(place)}: node {nodes.ids[row]} is {far[row]:.3g} m away;"
            f" use a place {'on' if len(place) == 2 else 'in'} the {_body_or_plate_word(results)},"
            f" from {_format_place(low)} to {_format_place(high)}"
        )
    if len(results.epochs()) == 1:
        return node_history(results, int(nodes.ids[row]), quantity, component)._replace(
            distance_from_place=float(far[row])
        )
    steps = frames(results)[0].tolist()
    nearest = {step: int(_distances_from_place(results.nodes(step), place).argmin()) for step in steps}
    ids = tuple(dict.fromkeys(int(results.nodes(step).ids[at]) for step, at in nearest.items()))
    time, values = _read_quantity_of_frames(
        results, lambda nodes: np.array([_distances_from_place(nodes, place).argmin()]), quantity, component
    )
    value = np.concatenate(values)
    where = tuple(nodes.position[row].tolist())
    label = f"node {ids[0]}" if len(ids) == 1 else f"nearest of {len(ids)} nodes"
    return NodeHistory(label, component, ids, "frames", time, value, value, value, where, float(far[row]))


def mean_history_in_box(
    results: Results,
    box: tuple[float, ...],
    quantity: str = "displacement",
    component: str = "magnitude",
) -> NodeHistory:
    """The mean, smallest and largest value of all nodes in a box, m: x0, y0, x1, y1 in a plate, six numbers in a body.

    The mean is weighted by the masses of the nodes, so that the mass of a body times its mean acceleration is the force
    on it. Raises ResultsError.
    """
    _expect_coordinate_count(results, "--box", box, 2)
    corners = np.sort(np.reshape(box, (2, -1)), axis=0)
    nodes = results.lives().nodes
    inside = node_arrays.in_box(nodes, corners)
    if not inside.any():
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        raise ResultsError(
            f"{results.name}: no node is in the box {_format_place(box)}; the {_body_or_plate_word(results)} goes from"
            f" {_format_place(low)} to {_format_place(high)}"
        )
    ids = tuple(dict.fromkeys(nodes.ids[inside].tolist()))
    label = f"mean of {len(ids)} nodes" if len(ids) > 1 else f"node {ids[0]}"

    def find_rows_in_box(nodes: Nodes) -> NDArray[np.int64]:
        return np.flatnonzero(node_arrays.in_box(nodes, corners))

    time, values = _read_quantity_of_frames(results, find_rows_in_box, quantity, component)
    spread = []
    for step, frame_values in zip(frames(results)[0].tolist(), values, strict=True):
        if not len(frame_values):
            spread.append((np.nan,) * 3)
            continue
        rows = find_rows_in_box(results.nodes(step))
        mass = (results.nodes(step).area * materials_of_nodes(results, step)[0]("rho"))[rows]
        spread.append((np.average(frame_values, weights=mass), frame_values.min(), frame_values.max()))
    middle, low, high = np.array(spread).T
    return NodeHistory(label, component, ids, "frames", time, middle, low, high, None, 0.0)


def _read_quantity_of_frames(
    results: Results, select_rows: Callable[[Nodes], NDArray[np.int64]], quantity: str, component: str
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Times (t,) of the frames, and for each frame the quantity of the k nodes that `select_rows` selects."""
    steps, times = frames(results)
    frame_vectors = (vector(results, quantity, step)[select_rows(results.nodes(step))] for step in steps.tolist())
    return times, [_vector_component(ways, component) for ways in frame_vectors]


def _distances_from_place(nodes: Nodes, place: Place) -> NDArray[np.float64]:
    return reduce(np.hypot, (nodes.position - place).T)


def _vector_component(vectors: NDArray[np.float64], component: str) -> NDArray[np.float64]:
    """A component (t,), or the magnitude, of vectors (t, d). Raises FieldError for a component they do not have."""
    if component == "magnitude":
        return reduce(np.hypot, vectors.T)
    if component not in "xyz"[: vectors.shape[1]]:
        raise FieldError(f"a plate has no component '{component}'; use x, y or magnitude")
    return np.asarray(vectors[:, "xyz".index(component)])


def _expect_coordinate_count(results: Results, option: str, coordinates: tuple[float, ...], place_count: int) -> None:
    """Raise ResultsError if a place has not as many coordinates as the nodes."""
    expected = place_count * results.dimension
    if len(coordinates) != expected:
        raise ResultsError(
            f"{option} has {len(coordinates)} numbers; use {expected} in a {_body_or_plate_word(results)}"
        )


def _body_or_plate_word(results: Results) -> str:
    return "plate" if results.dimension == 2 else "body"


def _format_place(place: Iterable[float]) -> str:
    return ",".join(f"{number:g}" for number in place)
