"""Which models can be solved so, and where their nodes are on the lattice."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Acceleration
from pdsolve.adaptive.lattice import BELOW, LEFT, Lattice, lattice_of
from pdsolve.model import Model, ModelError

OFF = 1e-6  # spacings: nodes this far from the lattice are not on it
CLEARANCE = 1e-3  # spacings: a pre-crack this near to a node passes through it
LARGEST = 6.0  # horizon over spacing: half of a family has a bit for each bond


class Plate(NamedTuple):
    """A rectangle of nodes."""

    at: Lattice
    h: float  # m
    origin: NDArray[np.float64]  # (2,) lower left corner, m
    place: NDArray[np.int64]  # (n,) fine place of each row of the grid
    cracks: NDArray[np.float64]  # (k, 4) in spacings from the corner


def plate_of(model: Model, mode: str, precision: str) -> Plate:
    """The lattice of a model's nodes. Raises ModelError for what cannot be solved so, in one sentence."""
    grid, material = model.grid, model.settings.material
    assert material is not None
    for place, found, expected in (
        ("mode", mode, "conservative"),
        ("precision", precision, "float64"),
        ("$.material.law", material.law, "brittle"),
        ("$.regions", len(model.settings.regions), 0),
        ("$.holes", len(grid.holes), 0),
        ("$.area_rule", model.settings.area_rule or "cells", "cells"),
    ):
        if found != expected:
            raise _refused(model, place, f"{found}", f"{expected}")
    ratio = model.settings.horizon.ratio
    if ratio > LARGEST:
        raise _refused(model, "$.horizon.ratio", f"{ratio:g}", f"at most {LARGEST:g}")
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Acceleration):
            raise _refused(model, f"$.conditions[{number}]", "an acceleration", "a load, a displacement or a velocity")
    h, origin = float(grid.delta[0]), grid.position.min(axis=0)
    if (grid.delta != h).any():
        raise _refused(model, "$.nodes", "several spacings", "one, the finest: it is made coarser where it can be")
    return _on_lattice(model, h, origin)


def _on_lattice(model: Model, h: float, origin: NDArray[np.float64]) -> Plate:
    grid = model.grid
    steps = (grid.position - origin) / h
    column, row = np.round(steps).astype(np.int64).T
    nx, ny = int(column.max()), int(row.max())
    off = np.abs(steps - np.column_stack([column, row])).max()
    if off > OFF or len(grid) != (nx + 1) * (ny + 1):
        raise _refused(model, "$.nodes", "nodes that are no full rectangle", "one without holes and notches")
    if nx % 2 or ny % 2 or min(nx, ny) < 4:
        raise _refused(
            model, "$.nodes", f"{nx} by {ny} spacings", "even numbers, at least 4: nodes on all edges of the plate"
        )
    corners = np.array([ring for rings in grid.outline for ring in rings])
    if len(corners):
        ends = np.concatenate([corners.min(axis=0) - origin, corners.max(axis=0) - origin - h * np.array([nx, ny])])
        if len(grid.outline) > 1 or np.abs(ends).max() > OFF * h:
            raise _refused(
                model,
                "$.nodes",
                f"nodes {np.abs(ends).max():.3g} m off the plate's edge",
                "nodes on it: draw pre-cracks half a spacing off the rows of nodes, so that none need be moved",
            )
        inside = (np.abs(corners - origin) < OFF * h) | (np.abs(corners - origin - h * np.array([nx, ny])) < OFF * h)
        if not inside.any(axis=1).all():
            raise _refused(model, "$.outline", "corners inside its box", "a rectangle")
    at = lattice_of(nx, ny)
    cracks = (grid.cracks - np.tile(origin, 2)) / h
    _clear(model, cracks, nx, ny)
    return Plate(at, h, origin, (row + BELOW) * at.stride + LEFT + column, cracks)


def _clear(model: Model, cracks: NDArray[np.float64], nx: int, ny: int) -> None:
    """Raises ModelError where a pre-crack passes through a node."""
    for number, (x0, y0, x1, y1) in enumerate(cracks):
        long = float(np.hypot(x1 - x0, y1 - y0))
        share = np.linspace(0, 1, max(2, int(8 * long)))
        near = np.unique(np.round(np.column_stack([x0 + share * (x1 - x0), y0 + share * (y1 - y0)])), axis=0)
        near = near[((near >= 0) & (near <= (nx, ny))).all(axis=1)]
        way = np.array([x1 - x0, y1 - y0]) / max(long, OFF)
        along = np.clip((near - (x0, y0)) @ way, 0, long)
        away = np.hypot(*(near - (x0, y0) - along[:, None] * way).T)
        if away.min(initial=1.0) < CLEARANCE:
            raise _refused(
                model, f"$.notch[{number}]", "a node on it", "it between nodes, half a spacing off their rows"
            )


def _refused(model: Model, place: str, found: str, expected: str) -> ModelError:
    name = place if place in ("mode", "precision") else f"{model.name}: {place}"
    return ModelError(f"{name}: found {found}, expected {expected}, as run.adapt is hybrid")
