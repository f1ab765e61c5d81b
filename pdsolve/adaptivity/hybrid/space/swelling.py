"""What swelling does to a body with a fine zone: strains of nodes, and of places between coarse nodes.

A free node is strained by its temperature or content; a spring, or a piece of one, by the mean of its ends, and is
stretched from there. Fine sites have strains where they are idle too, so that cells that become fine have theirs.

Free bodies whose strain e is linear bend: u_i,jk = e_,k d_ij + e_,j d_ik - e_,i d_jk. A place that moves with nodes at
x_m from it by weights w_m is so off by -h bending . grad e, where bending is the sum of w (x x^T - I x.x / 2), in terms
of spacings h. With that, such bodies are free of stress with any zone, as in the plane.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.engine import NegativeHalfSwelling
from pdsolve.zone.cells import LatticeNumbering, lattice_coordinates, place_number_at

if TYPE_CHECKING:
    from pdsolve.adaptivity.hybrid.space.layout import FullBody
    from pdsolve.adaptivity.hybrid.space.march import Seam
    from pdsolve.lattice.operator import TileLattice


class Bending(NamedTuple):
    """How p places move beside the nodes that move them."""

    site: NDArray[np.int64]  # (p,) the nearest fine site
    bending: NDArray[np.float64]  # (p, d, d) squared spacings


def bending_of_places(
    numbering: LatticeNumbering, coordinates: NDArray[np.float64], weights: NDArray[np.float64]
) -> Bending:
    """Bending of places that move with nodes at `coordinates` (p, m, d), in fine spacings, by `weights` (p, m)."""
    middle = np.einsum("pm,pmd->pd", weights, coordinates)
    x = coordinates - middle[:, None]
    bending = np.einsum("pm,pmi,pmj->pij", weights, x, x)
    bending -= np.eye(x.shape[2]) * np.einsum("pm,pmi,pmi->p", weights, x, x)[:, None, None] / 2
    nearest = np.rint(middle).astype(np.int64)
    return Bending(np.asarray(place_number_at(numbering, tuple(nearest.T))), bending)


def offsets_of_places(
    numbering: LatticeNumbering,
    places: Bending,
    strain: NDArray[np.float64],
    has_node: NDArray[np.bool_],
    spacing: float,
) -> NDArray[np.float64]:
    """How far places (p, d) are off, m, at the strains (sites,) of fine nodes."""
    # the smaller change of strain of those on both sides, 0 if they differ in sign: so no leap is one
    gradient = np.zeros((len(places.site), len(numbering.counts)))
    for axis, along in enumerate(lattice_coordinates(numbering, places.site)):
        stride, change, is_there = numbering.strides[axis], [], []
        for side in (-1, 1):
            inside = (along + side >= 0) & (along + side < numbering.counts[axis])
            end = np.where(inside, places.site + side * stride, places.site)
            is_there.append(inside & has_node[end])
            change.append(np.where(is_there[-1], side * (strain[end] - strain[places.site]), 0.0))
        down, up = change
        smaller = np.where(up * down > 0, np.where(np.abs(up) < np.abs(down), up, down), 0.0)
        gradient[:, axis] = np.where(is_there[0] & is_there[1], smaller, down + up)
    return np.asarray(-spacing * np.einsum("pij,pj->pi", places.bending, gradient))


def average_over_neighbours(values: NDArray[np.float64], has_node: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means of values at all sites (z, y, x) and around them: 1/4, 1/2, 1/4 along each axis.

    Along an axis on which there is no node on one side, the middle one alone counts, so that linear values stay exact.
    """
    for axis in range(values.ndim):
        mean = values.copy()
        inner, before, after = (_cut(values, axis, begin) for begin in (1, 0, 2))
        is_amid = _cut(has_node, axis, 0) & _cut(has_node, axis, 2)
        _cut(mean, axis, 1)[is_amid] = (inner / 2 + (before + after) / 4)[is_amid]
        values = mean
    return values


def _cut(values: NDArray[Any], axis: int, begin: int) -> NDArray[Any]:
    """All values but two along an axis, from `begin` on."""
    along = [slice(None)] * values.ndim
    along[axis] = slice(begin, values.shape[axis] - 2 + begin)
    return values[tuple(along)]


class SwellingBody(ABC):
    """What an engine of a body does where it swells."""

    full_body: FullBody
    fine: TileLattice
    coarse: TileLattice
    seam: Seam
    node_kinds: NDArray[np.uint8]  # (sites,)
    swelling_work: float  # J, done on it as it swelled
    _bending: tuple[Bending, Bending]  # of places on the border, and of the ends of pieces

    @abstractmethod
    def energies(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energies (n,), J, of nodes: stored, and dissipated by softening so far."""

    @abstractmethod
    def fine_sites_of_coarse(self, coarse: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fine sites (k,) that coarse sites (k,) lie on."""

    def _locate_seam(self) -> None:
        """Find how places on the border and the ends of pieces move, and set what strains do to them."""
        border, points = self.seam.border, self.seam.pieces.points
        numbering = self.full_body.fine_lattice.numbering.fine
        self._bending = (
            bending_of_places(numbering, self._coordinates(-1 - border.coarse_places), border.weights),
            bending_of_places(numbering, self._coordinates(points.interpolation_nodes), points.interpolation_weights),
        )
        self._set_swelling_of_seam()

    def _coordinates(self, places: NDArray[np.integer]) -> NDArray[np.float64]:
        """Coordinates (p, m, 3), in fine spacings, of nodes at fine places (p, m), or -1 less coarse ones."""
        numbering, sites = self.full_body.fine_lattice.numbering, self.full_body.fine_sites
        fine = lattice_coordinates(numbering.fine, places.clip(sites.margin) - sites.margin)
        margin = self.full_body.coarse_sites.margin
        coarse = lattice_coordinates(numbering.coarse, (-1 - places).clip(margin) - margin)
        along = [np.where(places >= 0, x, 2 * q) for x, q in zip(fine, coarse, strict=True)]
        return np.stack(along, axis=-1).astype(np.float64)

    def offsets_at_places(self, places: Bending) -> NDArray[np.float64]:
        """How far places (p, 3) are off where nodes move them, m."""
        lattice, margin, count = self.full_body.fine_lattice, self.full_body.fine_sites.margin, len(self.node_kinds)
        assert self.fine.tiles.shrink is not None
        strain = -2.0 * self.fine.tiles.shrink[margin : margin + count].astype(np.float64)
        h = self.full_body.fine_sites.spacing
        return offsets_of_places(lattice.numbering.fine, places, strain, lattice.tiles.node >= 0, h)

    def _set_swelling_of_seam(self) -> None:
        """Set what the strains of nodes do to places on the border and to the ends of pieces."""
        border, (fine, coarse) = self.seam.border, (self.fine.tiles.shrink, self.coarse.tiles.shrink)
        points, swelling = self.seam.pieces.points, self.seam.pieces.point_swelling
        assert border.off is not None
        assert swelling is not None
        assert fine is not None
        assert coarse is not None
        border.off[:] = self.offsets_at_places(self._bending[0])
        ends = points.interpolation_nodes
        shrink = np.where(ends >= 0, fine[ends.clip(0)], coarse[(-1 - ends).clip(0)])
        swelling[:, :3] = self.offsets_at_places(self._bending[1])
        swelling[:, 3] = (points.interpolation_weights * shrink).sum(axis=1)

    def set_swelling_strain(self, strain: NDArray[np.float64]) -> None:
        """Let springs stretch from their lengths at these strains (n,) of all nodes of the grid, were they free."""
        sites, lattice, coarse = self.full_body.fine_sites, self.full_body.fine_lattice, self.coarse.tiles.shrink
        assert self.fine.tiles.shrink is not None
        assert coarse is not None
        self.fine.tiles.shrink[sites.site] = strain / -2
        numbering, values = lattice.numbering, np.zeros(lattice.numbering.fine.place_count)
        values[sites.site - sites.margin] = strain / -2
        shape = numbering.fine.shape
        has_node = (lattice.tiles.node[: len(values)] >= 0).reshape(shape)
        mean = average_over_neighbours(values.reshape(shape), has_node).ravel()
        places = np.flatnonzero(self.coarse.tiles.node >= 0)
        coarse[self.full_body.coarse_sites.margin + places] = mean[self.fine_sites_of_coarse(places)]
        self._set_swelling_of_seam()

    def strain_energy(self) -> float:
        """Strain energy of all bonds, springs and pieces, J."""
        return float(self.energies()[0].sum())

    def copy_negative_half_swelling(self) -> NegativeHalfSwelling:
        """A copy of the strains that springs have, as tiles have them."""
        fine, coarse = self.fine.tiles.shrink, self.coarse.tiles.shrink
        assert fine is not None
        assert coarse is not None
        return NegativeHalfSwelling(fine.astype(np.float64), coarse.astype(np.float64))

    def strain_energy_at_swelling(self, negative_half_swelling: NegativeHalfSwelling) -> float:
        """Strain energy, J, that all springs would have at these strains."""
        now = self.copy_negative_half_swelling()
        self._set_negative_half_swelling(negative_half_swelling)
        energy = self.strain_energy()
        self._set_negative_half_swelling(now)
        return energy

    def _set_negative_half_swelling(self, values: NegativeHalfSwelling) -> None:
        for array, each in zip((self.fine.tiles.shrink, self.coarse.tiles.shrink), values, strict=True):
            assert array is not None
            array[:] = each
        self._set_swelling_of_seam()

    def add_work(self, work: float) -> None:
        """Book an energy, J, as work done on the body."""
        self.swelling_work += work
