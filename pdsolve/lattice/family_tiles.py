"""Families of state-based laws on a cubic lattice in tiles: the layout of `pdsolve.lattice.family_operator`."""

from __future__ import annotations

from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.families import FamilyTiles
from pdsolve.lattice.sites import Sites, sites_of
from pdsolve.lattice.tiles import place_rows
from pdsolve.laws.bond_arrays import Tabled
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.numerics.memory import aligned
from pdsolve.numerics.thread_team import share

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


class FamiliesInTiles:
    """Bonds of listed nodes in tiles; a node's place is its site."""

    def __init__(self, placed: Placed, exact: Bonds, threads: int, tabled: Tabled, kind: np.dtype[Any]) -> None:
        """Where the bonds are, and their numbers."""
        self._sites, self._slot, self._threads = placed.sites, placed.slot, threads
        self._start = exact.start
        self.tiles, self.room = placed.sites.tiles, placed.sites.size
        self.bonds = _tiles(placed, exact, tabled, kind)
        self._intact_bits = self.bonds.bits.copy()

    def places(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The places (k,) of these nodes."""
        return self._sites.site[rows].astype(np.int64)

    def place(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Enter nodal values (n, w) at their places in `out` (w, m)."""
        site = self._sites.site
        share(lambda first, last: place_rows(site, values, out, first, last), len(site), self._threads)

    def collect(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values (n, w) of nodes among those of all places (w, m)."""
        out = np.zeros((len(self._sites.site), len(values)), dtype=values.dtype)
        self.add(values, out)
        return out

    def add(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Add the values of nodes among those of all places (w, m) to `out` (n, w)."""
        site = self._sites.site
        share(lambda first, last: _add_rows(site, values, out, first, last), len(site), self._threads)

    def remove(self, bonds: NDArray[np.int64]) -> None:
        """Remove these bonds (b,) of the list."""
        source = np.searchsorted(self._start, bonds, side="right") - 1
        site = self.places(source) - self._sites.margin
        bit = np.uint16(1) << (site % ROW).astype(np.uint16)
        np.bitwise_and.at(self.bonds.bits, (site // ROW, self._slot[bonds]), ~bit)

    def restore(self) -> None:
        """Enter all bonds again."""
        self.bonds.bits[:] = self._intact_bits

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        arrays = *self.bonds, self._intact_bits, self._slot, self._sites.site
        return sum(getattr(array, "nbytes", 0) for array in arrays)


@cached_njit(nogil=True)
def _add_rows(site, values, out, first, last):  # type: ignore[no-untyped-def]
    """Add values (w, m) at the sites of the rows `first` to `last` - 1 to `out` (n, w)."""
    for i in range(first, last):
        for axis in range(len(values)):
            out[i, axis] += values[axis, site[i]]


def _tiles(placed: Placed, bonds: Bonds, tabled: Tabled, kind: np.dtype[Any]) -> FamilyTiles:
    """The tiles of bonds with these numbers, in a precision."""
    sites, slot, volume = placed
    (x, y, z), count, reach = sites.sides, len(sites.ways), int(np.abs(sites.ways).max())
    xi = sites.ways * sites.spacing
    squared = (xi**2).sum(axis=1)
    length = np.sqrt(squared)
    vectors = np.column_stack([xi, 2 * xi / squared[:, None], 1 / squared, length, 1 / length])
    site = sites.site.astype(np.int64) - sites.margin
    source, bits = np.repeat(site, np.diff(bonds.start)), np.zeros((sites.tiles, count), dtype=np.uint16)
    np.bitwise_or.at(bits, (source // ROW, slot), np.uint16(1) << (source % ROW).astype(np.uint16))
    size, beyond = np.zeros((1, sites.size)), reach * (y + 1)
    size[0, sites.site] = volume
    columns = tabled.columns[::2]
    # The line of each row of sites, and the numbers (q, l k w) in lines; the first has no bonds
    scale = np.array([np.abs(c[np.isfinite(c)]).max(initial=1e-300) for c in columns])[:, None, None]
    lines, line_values = np.zeros(y * z, dtype=np.int32), [np.zeros((len(columns), count, x + 2 * ROW))]
    numbers_by_digest: dict[bytes, list[int]] = {}
    order = np.argsort(site, kind="stable")
    ends = np.searchsorted(site[order], np.arange(z + 1) * x * y)
    for plane in range(z):
        nodes = order[ends[plane] : ends[plane + 1]]
        many = bonds.start[nodes + 1] - bonds.start[nodes]
        first = np.cumsum(many) - many
        which = np.arange(many.sum()) + np.repeat(bonds.start[nodes] - first, many)
        row, along = np.divmod(np.repeat(site[nodes] - plane * x * y, many), x)
        dense = np.zeros((len(columns), y, count, x + 2 * ROW))
        for values, column in zip(dense, columns, strict=True):
            values[row, slot[which], ROW + along] = column[which] / volume[bonds.neighbour[which]]
        for at in np.unique(row).tolist():
            lines[plane * y + at] = _number(dense[:, at], scale, numbers_by_digest, line_values)
    numbers = np.stack(line_values, axis=1).reshape(len(columns), -1)
    return FamilyTiles(
        offsets=sites.steps.astype(np.int32),
        rows=(sites.ways[:, 1:] @ np.array([1, y])).astype(np.int32),
        ahead=sites.ways[:, 0].astype(np.int32),
        vectors=vectors.astype(kind),
        bits=bits,
        lines=np.pad(lines, beyond),
        numbers=aligned(numbers.astype(kind)),
        volume=aligned(size.astype(kind)),
        wide=x + 2 * ROW,
        pad=ROW,
        across=x // ROW,
        margin=sites.margin,
        beyond=beyond,
    )


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
