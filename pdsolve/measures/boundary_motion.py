"""The motion of a frame of nodes in the results of a larger model, which the boundary of a part of it follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.values_at_places import MOST_ROWS
from pdmesh.model.values_of_place import Table
from pdsolve.measures.frame_steps import vector
from pdsolve.results import Results, ResultsError

Array = NDArray[np.float64]


class BoundaryMotion(NamedTuple):
    """Displacements of k nodes at t times."""

    position: Array  # (k, d) m
    times: Array  # (t,) s
    displacement: Array  # (t, k, d) m

    @property
    def tables(self) -> tuple[Table, ...]:
        """The displacement along each axis as a value over place and time."""
        places, times = tuple(map(tuple, self.position.tolist())), tuple(self.times.tolist())
        axes = "xyz"[: self.position.shape[1]]
        return tuple(
            Table(places, tuple(self.displacement[..., axis].ravel().tolist()), axes, times)
            for axis in range(len(axes))
        )

    @property
    def csv(self) -> str:
        """The displacements as CSV: x, y, in a body z, t, ux, uy and uz, a row for each node and time."""
        axes = "xyz"[: self.position.shape[1]]
        lines = [",".join((*axes, "t", *(f"u{axis}" for axis in axes)))]
        for time, displacement in zip(self.times.tolist(), self.displacement, strict=True):
            for place, moved in zip(self.position.tolist(), displacement.tolist(), strict=True):
                lines.append(",".join(map(repr, (*place, time, *moved))))
        return "\n".join([*lines, ""])


def boundary_motion(results: Results, box: Sequence[float], depth: float) -> BoundaryMotion:
    """The motion of the nodes around the border of a box, at all frames of a run.

    Parameters
    ----------
    results
        Those of the larger model, which has the same nodes at all frames.
    box
        Outline of the smaller model, m: x0, y0, x1, y1, in a body x0, y0, z0, x1, y1, z1.
    depth
        Of its nodes that shall follow, m: the horizon. Nodes up to one spacing beyond are included.

    Raises
    ------
    ResultsError
        For a box without such nodes, too many values, and a run whose nodes come and go.
    """
    dimension = results.dimension
    if len(box) != 2 * dimension:
        raise ResultsError(f"{results.name}: the box has {len(box)} numbers; give {2 * dimension}")
    low, high = np.array(box[:dimension]), np.array(box[dimension:])
    if not (low < high).all() or not depth > 0:
        raise ResultsError(f"{results.name}: the box or its depth {depth:g} m has no extent; give its low corner first")
    steps, times = results.frames()
    nodes = results.nodes(int(steps[0]))
    if len({int(results.epoch(int(step))) for step in steps}) > 1:
        raise ResultsError(f"{results.name}: nodes come and go; use a run with --adapt none")
    inward = np.minimum(nodes.position - low, high - nodes.position).min(axis=1)
    beyond = nodes.delta * (1 + 1e-6)
    rows = np.flatnonzero((inward >= -beyond) & (inward <= depth + beyond))
    if not len(rows):
        raise ResultsError(f"{results.name}: no node is around the border of the box; use one within the model")
    if len(rows) * len(steps) > MOST_ROWS:
        raise ResultsError(
            f"{results.name}: {len(rows)} nodes at {len(steps)} frames are more than {MOST_ROWS} rows; use a smaller"
            " box or depth, or fewer frames (run.every)"
        )
    displacement = np.array([vector(results, "displacement", int(step))[rows] for step in steps])
    return BoundaryMotion(nodes.position[rows], np.asarray(times, dtype=float), displacement)
