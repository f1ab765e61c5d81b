"""Amounts of a diffusing substance over time: inside, passed through the boundary, supplied."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.results import Results, ResultsError


class Masses(NamedTuple):
    """Mass balance of a diffusion run at t times; for a plate, per unit thickness."""

    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    inside: NDArray[np.float64]  # (t,) mol in nodes that are not held, what is solid counted
    through: NDArray[np.float64]  # (t,) mol gone out through held nodes
    supplied: NDArray[np.float64]  # (t,) mol
    solid: NDArray[np.float64]  # (t,) m^d
    dissolved: NDArray[np.float64]  # (t,) mol that was solid
    surface: NDArray[np.float64]  # (t,) m^(d - 1) of what is solid
    left: NDArray[np.float64]  # (t,) of the solid there was; NaN without any
    error: NDArray[np.float64]  # (t,) of the balance, over what there was or was supplied


def unit(results: Results) -> str:
    """Of the amounts: mol, or of heat temperatures times areas or volumes."""
    steps, _ = results.frames()
    return f"K m^{results.dimension}" if len(steps) and "T" in results.stored(int(steps[0])) else "mol"


def masses(results: Results) -> Masses:
    """The mass balance of a run. Raises ResultsError for a run of mechanics."""
    table = results.masses()
    if not len(table):
        raise ResultsError(f"{results.name}: found no masses, expected results of a model of diffusion")
    columns = {name: np.ascontiguousarray(table[name]) for name in table.dtype.names or ()}
    columns["step"] = columns["step"].astype(np.int64)
    inside, through, supplied, solid = (columns[name] for name in ("inside", "through", "supplied", "solid"))
    missing = inside + through - supplied - inside[0]
    scale = np.maximum(inside[0], np.maximum(np.abs(supplied), np.abs(through)))
    left = solid / solid[0] if solid[0] > 0 else np.full(len(solid), np.nan)
    return Masses(**columns, left=left, error=missing / np.where(scale > 0, scale, 1.0))
