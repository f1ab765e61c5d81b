"""State-based laws on lattices, fast: passes over families in lanes; everything rarely needed is done by the list."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.lattice.families import FamilySlots, FamilyTiles, sum_bond_forces, sum_first_pass
from pdsolve.laws.bond_arrays import Now, Tabled
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.numerics.memory import aligned
from pdsolve.numerics.thread_team import share
from pdsolve.operators import bond_list_loops as loops
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import BondLayout, CheckpointArrays
from pdsolve.state import Broken


class FamilyLayout(Protocol):
    """Where the bonds of n listed nodes are in lanes."""

    tiles: int
    room: int  # places m of nodes, idle ones included

    @property
    def bonds(self) -> FamilySlots | FamilyTiles:
        """The bonds for the kernels."""

    def places(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The places (k,) of these nodes."""

    def place(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Enter nodal values (n, w) at their places in `out` (w, m)."""

    def collect(self, values: NDArray[Any]) -> NDArray[Any]:
        """The values (n, w) of nodes among those of all places (w, m)."""

    def add(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Add the values of nodes among those of all places (w, m) to `out` (n, w)."""

    def remove(self, bonds: NDArray[np.int64]) -> None:
        """Remove these bonds (b,) of the list."""

    def restore(self) -> None:
        """Enter all bonds again."""

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""


class FamilyLattice(BondList):
    """The bonds of n nodes on lattices under a law whose passes are tuples; see `Operator`."""

    name = "blocks"
    bond_layout: BondLayout = "families"

    def __init__(
        self,
        law: Law,
        model: Model,
        exact: Bonds,
        symmetric: bool,
        precision: str,
        threads: int,
        make_layout: Callable[[Tabled, np.dtype[Any]], FamilyLayout],
    ) -> None:
        """Arguments are those of `BondList`, and what lays out bonds with the numbers of this law."""
        self._ready = False
        super().__init__(law, model, exact, symmetric, precision, threads)
        assert law.lanes is not None
        assert law.width is not None
        kind, d = np.dtype(precision), exact.xi.shape[1]
        self._lanes, self._tabled = law.lanes, law.lanes.tabled(self.columns, self._bonds)
        self.layout = make_layout(self._tabled, kind)
        room = self.layout.room
        self._u, self._f = (aligned(np.zeros((d, room), dtype=kind)) for _ in range(2))
        self._m = aligned(np.zeros((law.width(self.columns, d), room), dtype=kind))
        constants = law.lanes.standing(self.columns, self._every)
        self._own = aligned(np.repeat(constants[:, :1], room, axis=1).astype(kind))  # idle ones as good as any, not 0
        self._own[:, self.layout.places(self._every)] = constants
        self._near_limit = np.zeros(room, dtype=np.bool_) if self._tabled.watched else None
        self._likes = (0,) * len(self._tabled.columns), (0,) * self._tabled.nodal_count, (0,) * len(constants), (0,) * d
        self._by_lanes = law.lanes.by_lanes(self.columns)
        self._placed_numbers: NDArray[Any] | None = None  # the nodal numbers (n, w) that are at the places
        self._has_forces = False  # whether the forces at the places are theirs
        self._ready = True

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        self.layout.restore()
        super().restore(checkpoint, broken)

    def bytes(self) -> int:
        """Memory of all arrays, bytes, without the rows that slots get as their bonds break."""
        return super().bytes() + self.layout.bytes() + sum(a.nbytes for a in (self._u, self._f, self._m, self._own))

    def _between(self, now: Now) -> NDArray[Any]:
        if not self._takes(now):
            return super()._between(now)
        self.layout.place(now.value, self._u)
        self._share_tiles(sum_first_pass, self._u, self._own, self._m, self._likes, self._by_lanes)
        between = self.layout.collect(self._m)
        if not self._by_lanes:
            self._share(loops.finish_pass_rows, now, between)
            self.layout.place(between, self._m)
        self._placed_numbers, self._has_forces = between, False
        return between

    def _accumulate_bond_forces(self, now: Now, between: NDArray[Any], out: NDArray[Any]) -> None:
        """Add the forces of all bonds at the displacements of the latest first pass."""
        if not self._takes(now):
            return super()._accumulate_bond_forces(now, between, out)
        if between is not self._placed_numbers:
            self.layout.place(between, self._m)
        if between is not self._placed_numbers or not self._has_forces:
            self._sum_bond_forces()
        self.layout.add(self._f, out)
        return None

    def _near(self, now: Now, between: NDArray[Any]) -> NDArray[np.bool_]:
        if self._near_limit is None or not self._takes(now):
            return super()._near(now, between)
        self._sum_bond_forces()
        return self._near_limit[self.layout.places(self._every)]

    def _sum_bond_forces(self) -> None:
        self._share_tiles(sum_bond_forces, self._u, self._m, self._f, self._near_limit, self._likes)
        self._has_forces = True

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        super()._lose(bonds, rows)
        self.layout.remove(bonds)
        self._own[:, self.layout.places(rows)] = self._lanes.standing(self.columns, rows)
        self._placed_numbers = None

    def _takes(self, now: Now) -> bool:
        """Whether a state can be summed in lanes."""
        return self._ready and now.value.dtype == self._u.dtype

    def _share_tiles(self, loop: Callable[..., None], *arrays: Any) -> None:
        share(
            lambda first, last: loop(self.layout.bonds, self.columns, *arrays, first, last),
            self.layout.tiles,
            self._threads,
        )
