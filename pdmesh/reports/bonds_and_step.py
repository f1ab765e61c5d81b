"""Bond counts of a finished grid and its stable time step, and the bonds that a run of it has, for pictures.

What the solver refuses, such as a grid without a material, has all pairs within a horizon, as in `pdmesh info`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Settings
from pdmesh.model.lattice_calibration import calibrated_family, has_partial_cells, lattice_ratios
from pdmesh.model.material import Material
from pdmesh.model.neighbours import Neighbours, lengths
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import sight_of

CHUNK = 10_000  # nodes whose bonds are looked at together
SURFACES = 0.84  # of the step of a full family: corrected edges are stiffer along themselves, measured 0.85 to 0.885


@dataclass(frozen=True)
class SeenPairs:
    """Directed bonds of one part of a grid's nodes."""

    source: NDArray[np.int64]  # (b,) row of the node whose horizon reaches the other
    target: NDArray[np.int64]  # (b,)
    inside: NDArray[np.bool_]  # (b,) stays in the plate
    cut: NDArray[np.bool_]  # (b,) crossed by a pre-crack


def bonds(grid: Grid, ratio: float, rows: NDArray[np.int64] | None = None) -> Iterator[SeenPairs]:
    """Directed bonds |xi| <= `ratio` delta of all nodes, or of those in `rows`, a chunk of nodes at a time."""
    neighbours, sight = Neighbours(grid.position, grid.delta, ratio * grid.delta), sight_of(grid)
    wanted = np.arange(len(grid)) if rows is None else rows
    for start in range(0, len(wanted), CHUNK):
        pairs = neighbours.pairs(wanted[start : start + CHUNK])
        yield SeenPairs(pairs.source, pairs.target, sight.inside(pairs), sight.cut(pairs))


def count(grid: Grid, ratio: float, sample: int | None = None) -> tuple[int, int]:
    """Number of directed bonds inside the plate, and how many of them a pre-crack cuts.

    With a `sample` of that many nodes, an estimate.
    """
    rows = None
    if sample is not None and sample < len(grid):
        rows = np.unique(np.linspace(0, len(grid) - 1, sample).astype(np.int64))
    total, cut = 0, 0
    for part in bonds(grid, ratio, rows):
        total += int(part.inside.sum())
        cut += int((part.inside & part.cut).sum())
    scale = 1.0 if rows is None else len(grid) / len(rows)
    return round(total * scale), round(cut * scale)


def stable_step(material: Material, ratio: float, spacing: float) -> float:
    """A time step (s) that is surely stable in the conservative mode for nodes `spacing` (m) apart.

    For a full family it is sqrt(2 rho / lambda_max(sum_j k n n^T)) with k = c(xi) A_j / |xi|, which is sqrt(4 rho /
    sum_j k) on a square lattice, with the solver's partial cells and calibration. The factor SURFACES allows for
    corrected edges, whose bonds are not known here; in plates hardly larger than a horizon these are stiffer still. The
    bound of the thesis mode is shorter.
    """
    if not lattice_ratios(ratio, material.micromodulus, material.plane, has_partial_cells(material)).c11 > 0:
        return float("inf")
    xi, c = calibrated_family(material, ratio)
    total = float((c / lengths(xi)).sum())
    return float(SURFACES * spacing * np.sqrt(4 * material.rho / total))


class DirectedBonds(NamedTuple):
    """Directed bonds of some of a grid's nodes, those that a pre-crack cuts included."""

    source: NDArray[np.int64]  # (b,) row of the node whose bond it is
    target: NDArray[np.int64]  # (b,)
    intact: NDArray[np.bool_]  # (b,) no pre-crack cuts it


def bonds_of_run(grid: Grid, settings: Settings, name: str, rows: NDArray[np.int64]) -> Iterator[DirectedBonds]:
    """Bonds of the nodes in `rows`, which increase, in the conservative mode, a chunk of nodes at a time."""
    pairs_of = None
    if settings.material is not None:
        from pdsolve import Model, ModelError, bond_pairs

        with suppress(ModelError):
            pairs_of = bond_pairs(Model(grid, settings, name))
    if pairs_of is None:
        for part in bonds(grid, settings.horizon.ratio, rows):
            yield DirectedBonds(part.source[part.inside], part.target[part.inside], ~part.cut[part.inside])
        return
    for start in range(0, len(rows), CHUNK):
        pairs, intact, *_ = pairs_of(rows[start : start + CHUNK])
        yield DirectedBonds(pairs.source, pairs.target, intact)
