"""State-based laws on a cubic lattice: passes over families in tiles; everything rarely needed is done by the list."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.sums import place_rows
from pdsolve.laws.bond_arrays import Now, Tabled
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.numerics.thread_team import share
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.space_lattice.passes import FamilyTiles, add_rows, exchange_tiles, first_pass_tiles
from pdsolve.operators.space_lattice.sites import Sites, sites_of
from pdsolve.state import Broken

GRAIN = 2.0**20  # of the largest number: lines whose numbers round to the same are compared
SAME = 1e-12  # of the largest number: lines this close are one


class Placed(NamedTuple):
    """Where the bonds of a list are on a lattice."""

    sites: Sites
    slot: NDArray[np.int16]  # (b,)
    volume: NDArray[np.float64]  # (n,) over h^3


def placed(law: Law, model: Model, bonds: Bonds, volume: NDArray[np.float64]) -> Placed | None:
    """Positions of bonds in tiles; None for a law without tuples, or nodes on no lattice. `volume` (n,), m^3."""
    if law.lanes is None or not law.lanes.in_space or model.grid.dimension == 2 or not len(bonds.neighbour):
        return None
    sites = sites_of(model.grid, model.settings.horizon.ratio + 0.5, whole_rows=True)
    if sites is None:
        return None
    source = np.repeat(sites.site, np.diff(bonds.start))
    step = sites.site[bonds.neighbour] - source
    slot = np.searchsorted(sites.steps, step).clip(max=len(sites.ways) - 1)
    if (sites.steps[slot] != step).any():
        return None
    return Placed(sites, slot.astype(np.int16), volume / sites.spacing**3)


class FamiliesInTiles(BondList):
    """The bonds of n nodes of a body on a lattice under a law whose passes are tuples; see `Operator`."""

    name = "blocks"

    def __init__(
        self, law: Law, model: Model, exact: Bonds, symmetric: bool, precision: str, threads: int, placed: Placed
    ) -> None:
        """Arguments are those of `BondList`, and where the bonds are."""
        self._ready = False
        super().__init__(law, model, exact, symmetric, precision, threads)
        assert law.lanes is not None
        assert law.width is not None
        self._lanes, self._sites, self._slot = law.lanes, placed.sites, placed.slot
        kind, room = np.dtype(precision).type, placed.sites.size
        tabled = law.lanes.tabled(self.columns, self._bonds)
        self._watched = tabled.watched
        self.tiles = _tiles(placed, exact, tabled, kind)
        self._whole = self.tiles.bits.copy()
        wide, constants = law.width(self.columns, 3), law.lanes.standing(self.columns, self._every)
        self._u, self._f = (aligned(np.zeros((3, room), dtype=kind)) for _ in range(2))
        self._m, self._own = aligned(np.zeros((wide, room), dtype=kind)), np.repeat(constants[:, :1], room, axis=1)
        self._own[:, self._sites.site] = constants
        self._own, self._over = aligned(self._own.astype(kind)), np.zeros(room, dtype=np.bool_)
        self._likes = (0, 0), (0,) * tabled.nodal_count, (0,) * len(constants), (0,) * 3
        self._found: NDArray[Any] | None = None  # the nodal numbers (n, w) that are at the sites
        self._pulled = False  # whether the forces at the sites are theirs
        self._ready = True

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        self.tiles.bits[:] = self._whole
        super().restore(checkpoint, broken)

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        arrays = *self.tiles, self._whole, self._slot, self._u, self._f, self._m, self._own, self._sites.site
        return super().bytes() + sum(getattr(array, "nbytes", 0) for array in arrays)

    def _between(self, now: Now) -> NDArray[Any]:
        if not self._takes(now):
            return super()._between(now)
        site = self._sites.site
        share(lambda first, last: place_rows(site, now.value, self._u, first, last), self._nodes, self._threads)
        self._share_tiles(first_pass_tiles, self._u, self._own, self._m, self._likes)
        self._found, self._pulled = np.zeros((self._nodes, len(self._m)), dtype=now.value.dtype), False
        self._add_rows(self._m, self._found)
        return self._found

    def _accumulate_bond_forces(self, now: Now, between: NDArray[Any], out: NDArray[Any]) -> None:
        if not self._takes(now):
            return super()._accumulate_bond_forces(now, between, out)
        if between is not self._found:
            self._m[:, self._sites.site] = between.T
            self._pulled = False
        if not self._pulled:
            self._share_tiles(exchange_tiles, self._u, self._m, self._f, None, self._likes)
        self._add_rows(self._f, out)
        return None

    def _near(self, now: Now, between: NDArray[Any]) -> NDArray[np.bool_]:
        if not (self._watched and self._takes(now)):
            return super()._near(now, between)
        likes = (0, 0, 0), *self._likes[1:]
        self._share_tiles(exchange_tiles, self._u, self._m, self._f, self._over, likes)
        self._pulled = True
        return self._over[self._sites.site]

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        super()._lose(bonds, rows)
        source = np.searchsorted(self._bonds.start, bonds, side="right") - 1
        site = self._sites.site[source].astype(np.int64) - self._sites.margin
        bit = np.uint16(1) << (site % ROW).astype(np.uint16)
        np.bitwise_and.at(self.tiles.bits, (site // ROW, self._slot[bonds]), ~bit)
        self._own[:, self._sites.site[rows]] = self._lanes.standing(self.columns, rows)
        self._found = None

    def _takes(self, now: Now) -> bool:
        """Whether a state can be summed in tiles."""
        return self._ready and now.value.dtype == self._u.dtype

    def _add_rows(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Add what nodes have at their sites (w, m) to out (n, w)."""
        share(lambda first, last: add_rows(self._sites.site, values, out, first, last), self._nodes, self._threads)

    def _share_tiles(self, loop: Callable[..., None], *arrays: Any) -> None:
        def work(first: int, last: int) -> None:
            loop(self.tiles, self.columns, *arrays, first, last)

        share(work, self._sites.tiles, self._threads)


def _tiles(placed: Placed, bonds: Bonds, tabled: Tabled, kind: type[np.floating]) -> FamilyTiles:
    """The tiles of bonds with these numbers, in a precision."""
    sites, slot, volume = placed
    (x, y, _), count, reach = sites.sides, len(sites.ways), int(np.abs(sites.ways).max())
    xi = sites.ways * sites.spacing
    squared = (xi**2).sum(axis=1)
    length = np.sqrt(squared)
    vectors = np.column_stack([xi, 2 * xi / squared[:, None], length, 1 / length])
    site = sites.site.astype(np.int64) - sites.margin
    source, bits = np.repeat(site, np.diff(bonds.start)), np.zeros((sites.tiles, count), dtype=np.uint16)
    np.bitwise_or.at(bits, (source // ROW, slot), np.uint16(1) << (source % ROW).astype(np.uint16))
    size, beyond = np.zeros((1, sites.size)), reach * (y + 1)
    size[0, sites.site] = volume
    lines, numbers = _lines(placed, bonds, tabled.columns[::2])
    return FamilyTiles(
        offsets=sites.steps.astype(np.int32),
        rows=(sites.ways[:, 1:] @ np.array([1, y])).astype(np.int32),
        ahead=sites.ways[:, 0].astype(np.int32),
        vectors=vectors.astype(kind),
        inverse=(1 / squared).astype(kind),
        bits=bits,
        filled=np.asarray((sites.node.reshape(-1, ROW) >= 0).any(axis=1)),
        lines=np.pad(lines, beyond),
        numbers=aligned(numbers.astype(kind)),
        volume=aligned(size.astype(kind)),
        wide=x + 2 * ROW,
        pad=ROW,
        across=x // ROW,
        margin=sites.margin,
        beyond=beyond,
    )


def _lines(
    placed: Placed, bonds: Bonds, columns: tuple[NDArray[np.floating], ...]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The line of each row of sites, and the numbers (q, l k w) in lines; the first has no bonds."""
    (x, y, z), count, margin = placed.sites.sides, len(placed.sites.ways), placed.sites.margin
    wide, site = x + 2 * ROW, placed.sites.site.astype(np.int64) - margin
    scale = np.array([np.abs(c[np.isfinite(c)]).max(initial=1e-300) for c in columns])[:, None, None]
    lines, line_values = np.zeros(y * z, dtype=np.int32), [np.zeros((len(columns), count, wide))]
    numbers_by_digest: dict[bytes, list[int]] = {}
    order = np.argsort(site, kind="stable")
    ends = np.searchsorted(site[order], np.arange(z + 1) * x * y)
    for plane in range(z):
        nodes = order[ends[plane] : ends[plane + 1]]
        many = bonds.start[nodes + 1] - bonds.start[nodes]
        first = np.cumsum(many) - many
        which = np.arange(many.sum()) + np.repeat(bonds.start[nodes] - first, many)
        row, along = np.divmod(np.repeat(site[nodes] - plane * x * y, many), x)
        dense = np.zeros((len(columns), y, count, wide))
        for values, column in zip(dense, columns, strict=True):
            values[row, placed.slot[which], ROW + along] = column[which] / placed.volume[bonds.neighbour[which]]
        for at in np.unique(row).tolist():
            lines[plane * y + at] = _number(dense[:, at], scale, numbers_by_digest, line_values)
    return lines, np.stack(line_values, axis=1).reshape(len(columns), -1)


def _number(
    line: NDArray[np.float64],
    scale: NDArray[np.float64],
    numbers_by_digest: dict[bytes, list[int]],
    line_values: list[NDArray[np.float64]],
) -> int:
    """The number of a line (q, k, w) among those `line_values`; a new one is added."""
    alike = numbers_by_digest.setdefault(blake2b((np.rint(line / scale * GRAIN) + 0.0).tobytes()).digest(), [])
    for number in alike:
        with np.errstate(invalid="ignore"):  # of infinite limits
            if ((line == line_values[number]) | (np.abs(line - line_values[number]) <= SAME * scale)).all():
                return number
    alike.append(len(line_values))
    line_values.append(line.copy())
    return alike[-1]
