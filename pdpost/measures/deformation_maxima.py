"""Largest displacement and bond stretch, which describe a run in which nothing broke."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdpost.measures.strain import bonds_are_broken
from pdpost.reading.frame_steps import frames, last_frame
from pdsolve.results import Results

TOGETHER = 2_000_000  # bonds that are looked at at once


def largest_displacement(results: Results) -> float | None:
    """The largest displacement of any node in all frames, m; None if no frame holds displacements."""
    displacements = (_read_frame_displacements(results, step) for step in frames(results)[0].tolist())
    return max(
        (float(np.linalg.norm(u, axis=1).max(initial=0.0)) for u in displacements if u is not None), default=None
    )


def largest_stretch(results: Results) -> float | None:
    """The largest stretch of a bond that is intact in the last frame; None if it has no displacements."""
    step = last_frame(results)
    u = _read_frame_displacements(results, step)
    if u is None:
        return None
    families, position = results.families(step), results.nodes(step).position
    intact, largest = ~bonds_are_broken(results, families, step), []
    for first in range(0, len(intact), TOGETHER):
        bonds = first + np.flatnonzero(intact[first : first + TOGETHER])
        if len(bonds):
            node, neighbour = np.searchsorted(families.start, bonds, side="right") - 1, families.neighbour[bonds]
            before = position[neighbour] - position[node]
            after = before + u[neighbour] - u[node]
            largest.append(float((np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)).max()) - 1)
    return max(largest, default=None)


def _read_frame_displacements(results: Results, step: int) -> NDArray[np.float64] | None:
    """Displacements (n, d) of a frame, m, or None if it has none."""
    names, stored = ("ux", "uy", "uz")[: results.dimension], results.stored(step)
    if not set(names) <= set(stored):
        return None
    return np.column_stack([results.field(name, step) for name in names]).astype(np.float64)
