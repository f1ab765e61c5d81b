"""Bonds on a fine lattice, and second-order collocation on a coarse one of twice the spacing around it.

Each lattice is extended into the other's region by fictitious nodes, as far as its sums reach. A fictitious coarse node
is the mean of the fine nodes around it. A fictitious fine node is interpolated linearly between coarse ones, so that
linear fields are exact. The two interpolations are not transposes of each other: the flux out of one side equals the
flux into the other only to second order, as the mass balance shows. Within each lattice, mass is conserved.

Source: that of `pdsolve.operators.stencils`. A coarse node's stencil in space has 123 nodes, with weights for which its
symbol is positive.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ON_LATTICE, Pairs, chosen, lengths
from pdsolve.diffusion.families import DiffusionFamilies, place_bonds
from pdsolve.diffusion.walls import Array, parts_of
from pdsolve.lattice.flux_operator import FluxesInTiles
from pdsolve.lattice.tile_bonds import bits_of_pairs
from pdsolve.model import ModelError
from pdsolve.operators.stencils import diffusion, stencil_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Collocated:
    """Exchange between fine nodes by bonds and between coarse nodes by stencils."""

    name = "collocation"

    def __init__(self, families: DiffusionFamilies, volume: Array, free: NDArray[np.bool_], threads: int) -> None:
        """`free` (n,) nodes have no prescribed content."""
        self._model, self._families, self.volume = families.model, families, volume
        self.position, self.delta, self.diffusivity = families.position, families.delta, families.diffusivity
        grid, d = families.model.grid, families.dimension
        self._fine, self._coarse = fine, coarse = _two(families)
        h, D = float(grid.delta[fine[0]]), float(families.diffusivity[0])
        near, far = (
            np.rint((grid.position[rows] - grid.position[fine[0]]) / h * 2).astype(np.int64) for rows in (fine, coarse)
        )  # in halves of the fine spacing
        steps, conductance = families.full_family(h, D)
        stencil = stencil_of(3.0, diffusion(D, d), d)
        # Coarse nodes without a whole stencil are prescribed
        keys = _Keys(np.concatenate([far, near - 1]))
        complete = np.ones(len(far), dtype=bool)
        for step in stencil.xi:
            complete &= keys.rows(far + 4 * step) >= 0
        lost = np.flatnonzero(free[coarse] & ~complete)
        if len(lost):
            place = ", ".join(f"{x:.6g}" for x in self._model.grid.position[self._coarse[lost[0]]])
            raise ModelError(
                f"{self._model.name}: $.run.adapt: {len(lost)} coarse nodes near an edge are not held, the first at"
                f" ({place}) m; use fine nodes or a held layer of {np.abs(stencil.xi).max()} there"
            )
        inner_at, self._inner = _between(_lacking(far, 4 * stencil.xi, near), near, 2)
        every = np.concatenate([far, inner_at])
        missing = _lacking(near, 2 * steps, every)
        outer_at, self._outer = _between(missing, every, 4)
        if len(outer_at) < len(missing):
            raise ModelError(
                f"{self._model.name}: $.run.adapt is collocation with fine nodes at an edge; use coarse ones all around"
            )
        self._bonds = _lattice(np.concatenate([near, outer_at]) / 2, len(near), h, steps, conductance, threads)
        around = (stencil.xi != 0).any(axis=1)
        pulls = stencil.theta[around, 0, 0] / (2 * h) ** 2 / (2 * h) ** d
        self._stencils = _lattice(every / 4, len(far), 2 * h, stencil.xi[around], pulls, threads)
        self._far = np.isin(np.arange(len(volume)), coarse)
        self.reach = np.where(self._far, np.abs(stencil.xi).max() * 2 * h, families.reach)
        self.count, self.total = np.zeros(len(volume), dtype=np.int64), np.zeros(len(volume))
        self.count[fine], self.total[fine] = self._bonds.count[: len(fine)], self._bonds.total[: len(fine)]
        self.count[coarse], self.total[coarse] = self._stencils.count[: len(coarse)], stencil.most / 2 / (2 * h) ** 2
        at_seam = _sees(near, 2 * steps, outer_at), _sees(far, 4 * stencil.xi, inner_at)
        self._seam = np.concatenate([fine[at_seam[0]], coarse[at_seam[1]]])
        self._seam_volume = float(volume[self._seam].sum())
        whole = [rows[-1] - rows[0] < len(rows) for rows in (fine, coarse)]  # which a slice has faster
        self._rows = [slice(at[0], at[-1] + 1) if one else at for at, one in zip((fine, coarse), whole, strict=True)]

    def of(self, rows: NDArray[np.int64]) -> tuple[Pairs, Array]:
        """Bonds (b,) of some increasing rows to nodes of their own lattice, and their conductances (b,)."""
        bonds = []
        for lattice, own in ((self._bonds, self._fine), (self._stencils, self._coarse)):
            which = np.searchsorted(own, rows[np.isin(rows, own)])
            source, target, g = lattice.bonds_of_rows(which)
            real = target < len(own)
            bonds.append((own[source[real]], own[target[real]], g[real]))
        source, target, g = (np.concatenate(column) for column in zip(*bonds, strict=True))
        return Pairs(source, target, lengths(self.position[target] - self.position[source])), g

    def conductance(self, pairs: Pairs) -> Array:
        """Conductance (b,) that bonds of these lengths between fine nodes would have; 0 between coarse ones."""
        return np.where(self._far[pairs.source], 0.0, self._families.conductance(pairs))

    def rates(self, potential: Array, out: Array) -> None:
        """Add the rates of change (n,) of contents, per volume and time, at this `potential` (n,) to `out`."""
        (near, far), both = (potential[rows] for rows in self._rows), np.zeros(len(potential))
        every = np.concatenate([far, self._inner @ near])
        fines = np.concatenate([near, self._outer @ every])
        for lattice, rows, real_values, values in zip(
            (self._bonds, self._stencils), self._rows, (near, far), (fines, every), strict=True
        ):
            rates = np.zeros(len(values))
            lattice.rates(values, rates)
            both[rows] = rates[: len(real_values)]
        both[self._seam] -= (self.volume * both).sum() / self._seam_volume  # what interpolation has created
        out += both

    def tangent(self) -> csr_array:
        """Not available: implicit steps require symmetric bonds."""
        raise ModelError(f"{self._model.name}: $.run.adapt is collocation; use none for implicit steps")

    def contrast(self, share: Array) -> float:
        """Sum over bonds of the differences of `share` (n,), which is 0 on coarse nodes, weighted by conductance,
        m^d/s."""
        return self._bonds.contrast(np.concatenate([share[self._fine], np.zeros(self._outer.shape[0])]))


def _two(families: DiffusionFamilies) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the fine and of the coarse nodes. Raises ModelError for nodes of other spacings."""
    model, delta = families.model, families.model.grid.delta
    levels = np.unique(delta)
    place = f"{model.name}: $.run.adapt is collocation with"
    if len(levels) != 2 or abs(levels[1] / levels[0] - 2) > ON_LATTICE:
        said = ", ".join(f"{level:g}" for level in levels[:4])
        raise ModelError(f"{place} spacings of {said} m; use two, one twice the other")
    fine, coarse = (np.flatnonzero(delta == level) for level in levels)
    sight, is_fine, D = families.sight, delta == levels[0], families.diffusivity
    around = () if sight.clear else (families.neighbours.pairs(rows) for rows in parts_of(fine))
    blocked = not all(sight.inside(chosen(pairs, is_fine[pairs.target])).all() for pairs in around)
    if blocked or (D[0] != D).any() or len(model.grid.cracks):
        raise ModelError(f"{place} several media, or what blocks bonds; use one medium without")
    return fine, coarse


class _Keys:
    """Index of integer places (n, d)."""

    def __init__(self, places: NDArray[np.int64]) -> None:
        self._low = places.min(axis=0) - 64
        self._side = tuple((places.max(axis=0) + 64 - self._low).tolist())
        key = np.ravel_multi_index(tuple((places - self._low).T), self._side)
        self._order = np.argsort(key)
        self._sorted = key[self._order]

    def rows(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows (k,) of these places (k, d), -1 for a missing one."""
        key = np.ravel_multi_index(tuple((places - self._low).T), self._side)
        at = np.searchsorted(self._sorted, key).clip(max=len(self._sorted) - 1)
        return np.where(self._sorted[at] == key, self._order[at], -1)


def _lacking(lattice: NDArray[np.int64], steps: NDArray[np.int64], opposite: NDArray[np.int64]) -> NDArray[np.int64]:
    """Places (f, d) without a node that `lattice` (n, d) needs at offsets `steps` (k, d), within reach of `opposite`
    (m, d)."""
    keys, missing = _Keys(lattice), [np.zeros((0, lattice.shape[1]), dtype=np.int64)]
    low, high = opposite.min(axis=0) - 1, opposite.max(axis=0) + 1
    for step in steps:
        targets = lattice + step
        targets = targets[((targets >= low) & (targets <= high)).all(axis=1)]
        missing.append(targets[keys.rows(targets) < 0])
    return np.unique(np.concatenate(missing), axis=0)


def _sees(lattice: NDArray[np.int64], steps: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of the nodes of `lattice` (n, d) that have one of the others (m, d) at some offsets `steps` (k, d)."""
    keys, has_neighbour = _Keys(lattice), np.zeros(len(lattice), dtype=bool)
    for step in steps:
        rows = keys.rows(others - step)
        has_neighbour[rows[rows >= 0]] = True
    return has_neighbour


def _between(at: NDArray[np.int64], lattice: NDArray[np.int64], apart: int) -> tuple[NDArray[np.int64], csr_array]:
    """Linear interpolation (f, n) of places `at` (k, d) between nodes of a lattice (n, d) that are so far apart, and
    these places (f, d), without those that lack a node."""
    from scipy.sparse import csr_array

    keys, place = _Keys(lattice), (at - lattice[0]) / apart
    low = np.floor(place).astype(np.int64)
    corners = np.array(list(product((0, 1), repeat=at.shape[1])))
    rows = np.column_stack([keys.rows(lattice[0] + apart * (low + corner)) for corner in corners])
    share = (place - low)[:, None]
    weights = np.prod(np.where(corners == 1, share, 1 - share), axis=2)
    complete = (rows >= 0).all(axis=1)
    start = np.arange(complete.sum() + 1) * len(corners)
    values = csr_array((weights[complete].ravel(), rows[complete].ravel(), start), shape=(len(start) - 1, len(lattice)))
    return at[complete], values


def _lattice(
    places: Array, real: int, spacing: float, steps: NDArray[np.int64], conductance: Array, threads: int
) -> FluxesInTiles:
    """Exchange on a lattice of nodes at `places` (n, d), in units of spacing, m, the first `real` of which are real."""
    placed = place_bonds(places * spacing, spacing, steps, conductance)
    assert placed is not None
    sites, conductance = placed
    volume = np.full(len(places), spacing ** places.shape[1])
    return FluxesInTiles(sites, bits_of_pairs(sites), conductance, volume, threads, wanted=real)
