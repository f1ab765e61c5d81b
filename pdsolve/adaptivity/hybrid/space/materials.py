"""Bodies of several materials of one micromodulus: what coarse cells are made of.

A coarse cell has the mean stiffness of its fine nodes, a coarse node the mean density of those that it stands for, and
springs make cells fine by the weakest material around them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.space.arrangement import FineLattice
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tiles import MODULUS, VOLUME, Tiles
from pdsolve.model import Model
from pdsolve.zone.bond_law import stretch_that_makes_cells_fine
from pdsolve.zone.cells import ZoneNumbering

BESIDE = 2  # spacings from a coarse node to the farthest fine nodes of its cells


@dataclass(frozen=True)
class ModelWithMeanDensities(Model):
    """A model whose nodes have densities (n,), kg/m^3, beside those of materials."""

    mean_densities: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def rho(self) -> NDArray[np.float64]:
        """Each node's density (n,), kg/m^3."""
        return self.mean_densities


def fine_node_masses(model: Model, sites: Sites, fine: FineLattice) -> NDArray[np.float64]:
    """The mass (sites,), kg, of fine nodes."""
    mass = np.zeros(len(sites.node))
    mass[sites.site - sites.margin] = fine.node_volume * fine.tiles.cells[VOLUME, sites.site] * model.rho
    return mass


def limit_strain_ratios_of_pairs(tiles: Tiles) -> NDArray[np.float64]:
    """The least e at which bonds soften or break over that (p,) of pairs of materials; 0 of those that never break."""
    e = tiles.peak.min(axis=1) * (2 + tiles.peak.min(axis=1))
    return np.asarray(np.divide(e.min(), e, out=np.zeros(len(e)), where=np.isfinite(e)))


def relative_cell_moduli(numbering: ZoneNumbering, tiles: Tiles) -> NDArray[np.float64]:
    """Stiffness (c,) of coarse cells over that of the first material."""
    inside = tiles.cells[MODULUS, tiles.margin :][: numbering.fine.place_count]
    modulus = (2.0 * inside.astype(np.float64)).reshape(numbering.fine.shape)
    for axis, cells in enumerate(numbering.cells.counts[::-1]):
        first, middle, last = (_every_second_value(modulus, axis, step, cells, 1.0) for step in range(3))
        modulus = (first + 2 * middle + last) / 4
    return np.pad(modulus, numbering.cells.margins[0], constant_values=1.0).ravel()


def least_stretches_that_make_cells_fine(numbering: ZoneNumbering, tiles: Tiles, kappa: float) -> NDArray[np.float64]:
    """The stretch (sites,) of springs of each coarse node beyond which cells around become fine: that of the weakest
    bond in its cells; infinite without a node."""
    nodes = tiles.node[: numbering.fine.place_count]
    count = int(np.sqrt(len(tiles.peak)) + 0.5)
    ends = zip(tiles.peak[:: count + 1], tiles.limit[:: count + 1], strict=True)
    of_materials = np.array([stretch_that_makes_cells_fine(tiles.law, *each, kappa) for each in ends])
    # a bond between two materials has one between theirs
    least = np.where(nodes < 0, np.inf, of_materials[tiles.material[nodes]]).reshape(numbering.fine.shape)
    for axis, count in enumerate(numbering.coarse.counts[::-1]):
        near = (_every_second_value(least, axis, step, count, np.inf) for step in range(-BESIDE, BESIDE + 1))
        least = np.minimum.reduce(list(near))
    return least.ravel()


def _every_second_value(
    values: NDArray[np.float64], axis: int, first: int, count: int, outside: float
) -> NDArray[np.float64]:
    """So many of every second entry along an axis, from `first` on."""
    at = first + 2 * np.arange(count)
    inside = (at >= 0) & (at < values.shape[axis])
    entries = np.take(values, np.where(inside, at, 0), axis=axis)
    shape = np.ones(values.ndim, dtype=int)
    shape[axis] = count
    return np.where(inside.reshape(shape), entries, outside)
