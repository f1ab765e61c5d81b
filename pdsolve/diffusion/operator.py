"""Fick's law as an operator: the rate of a node is the sum over its bonds, however they are stored; solids dissolve.

Enthalpy method, as in phase change: the conserved quantity is the content H of a node, its potential is min(H, C_sat),
and all bonds are equal. The solid share of a node is (H - C_sat) / (C_solid - C_sat). This is the limit in which
diffusion determines the rate.

Kinetic method, after S. Jafarzadeh, Z. Chen, F. Bobaru and others (Z. Chen, F. Bobaru, J. Mech. Phys. Solids 78 (2015)
352-381): a node is solid until its concentration has fallen to C_sat. A bond between solid and liquid has its own
dissolvability, k_diss times the micro-diffusivity; a bond between two solid nodes has none. With `capped`, nothing
dissolves into liquid at C_sat; otherwise the liquid at the front exceeds saturation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.medium import Medium
from pdsolve.checkpoint_validation import entry
from pdsolve.diffusion.collocation import Collocated
from pdsolve.diffusion.walls import Array, Bonds
from pdsolve.lattice.flux_operator import FluxesInList, FluxesInTiles
from pdsolve.laws.fluxes import Dissolution
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.unbreakable import UnbreakableOperator
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array


BondStorage = FluxesInList | FluxesInTiles | Collocated


class Fick(UnbreakableOperator):
    """Diffusion of the content of n nodes, mol/m^3, along bonds; see `pdsolve.operators.protocol.Operator`.

    A node in kinetic dissolution remembers that it is solid until its content has fallen to C_sat.
    """

    unknowns: tuple[Unknown, ...] = (Unknown("h", 1, 1),)
    symmetric = True  # what leaves a node comes to others

    def __init__(
        self,
        exchange: BondStorage,
        families: Callable[[], Bonds] | None,
        medium: Medium,
        outside: Array | None = None,
        change: FluxesInList | None = None,
    ) -> None:
        """`change` is what a surface correction adds to the fluxes of `exchange`; `families` list the bonds, which a
        part lacks.

        `outside` (n,), 1/s, is what leaves the body per volume for each mol/m^3 of potential.
        """
        self.exchange, self.medium, self._families = exchange, medium, families
        self.change = change
        self.torn: FluxesInList | None = None  # what is added to the fluxes of bonds that broke
        self.total = sum((part.total for part in self._parts), np.zeros(len(exchange.volume)))  # (n,) 1/s, inside
        self.outside = np.zeros(len(exchange.volume)) if outside is None else outside
        self._open = bool(self.outside.any())
        self.name, self.volume, self.count = exchange.name, exchange.volume, exchange.count
        self.kinetic = medium.dissolution == "kinetic"
        self.solid = np.zeros(len(self.volume), dtype=np.uint8)  # (n,) whether a node is solid; kinetic alone

    @property
    def _parts(self) -> tuple[BondStorage, ...]:
        return (self.exchange, *(part for part in (self.change, self.torn) if part is not None))

    def part(self, first: int, last: int, begin: int, end: int) -> Fick:
        """The operator of the rows `begin` to `end` - 1, of which `first` to `last` - 1 have bonds, all of them among
        these nodes."""
        rows, change = (first, last, begin, end), self.change
        assert isinstance(self.exchange, FluxesInList | FluxesInTiles)
        outside = np.zeros(end - begin)
        outside[first - begin : last - begin] = self.outside[first:last]
        bonds = self.exchange.part(*rows)
        part = Fick(bonds, None, self.medium, outside, None if change is None else change.part(*rows))
        part.solid = self.solid[begin:end].copy()
        return part

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the fluxes into each node to `out` (n, 1), mol/(m^3 s); those from outside are booked as supplied."""
        content = state.value[:, 0]
        potential = self.potential(content)
        if self.kinetic:
            self.solid = self._solid(content)
            C_sat = (self.medium.C_sat or 0.0) if self.medium.capped else np.inf
            for part in self._parts:
                assert isinstance(part, FluxesInList)  # as `system` has it
                law = Dissolution(part.conductance, C_sat, self.medium.k_diss)
                part.add(law, out[:, 0], self.volume, content, self.solid)
        else:
            for exchange in self._parts:
                exchange.rates(potential, out[:, 0])
        if self._open:
            inflow = -self.outside * potential
            state.work[:] += dt * inflow
            out[:, 0] += inflow

    def potential(self, value: Array) -> Array:
        """Potential (n,), mol/m^3, at these contents (n,)."""
        C_sat = None if self.kinetic else self.medium.C_sat
        return value if C_sat is None else np.minimum(value, C_sat)

    def follows(self, value: Array) -> NDArray[np.bool_]:
        """Mask (n,) of nodes that are not saturated at these contents (n,)."""
        C_sat = self.medium.C_sat
        return np.ones(len(value), dtype=np.bool_) if C_sat is None else value < C_sat

    def rates(self, potential: Array, out: Array) -> None:
        """Add the fluxes (n,) into each node at this `potential` (n,) to `out` (n,), mol/(m^3 s)."""
        for part in self._parts:
            part.rates(potential, out)
        if self._open:
            out -= self.outside * potential

    def _solid(self, content: Array) -> NDArray[np.uint8]:
        """Mask (n,) of the solid nodes that are still solid at this content."""
        return self.solid & (content > (self.medium.C_sat or 0.0)).astype(np.uint8)

    def share(self, state: State) -> Array:
        """Solid share of each node (n,), from 0 to 1."""
        content, C_sat, C_solid = state.value[:, 0], self.medium.C_sat, self.medium.C_solid
        if C_sat is None or C_solid is None:
            return np.zeros(len(content))
        if self.kinetic:
            return self._solid(content).astype(float)
        return np.clip((content - C_sat) / (C_solid - C_sat), 0.0, 1.0)

    def energies(self, state: State) -> tuple[Array, Array]:
        """Zero energy densities (n,), J/m^3: diffusion stores and dissipates no energy."""
        return np.zeros(len(self.volume)), np.zeros(len(self.volume))

    def fields(self, state: State) -> dict[str, Array]:
        """Concentration and content, mol/m^3, and solid share, or temperature, K, (n,) each."""
        content = state.value[:, 0]
        if self.medium.carries == "heat":
            return {"T": content}
        return {"c": self.potential(content), "h": content, "solid": self.share(state)}

    def stiffness_bound(self) -> Array:
        """A bound (n,) of the rates' eigenvalues, 1/s: forward Euler is stable up to 2 over it."""
        faster = max(1.0, self.medium.k_diss) if self.kinetic else 1.0
        return 2 * (faster * self.total + self.outside)

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the rates by the contents, (n, n), 1/s, without a kinetic solid, whose rates jump."""
        from scipy.sparse import csr_array, diags_array

        liquid = diags_array(self.follows(state.value[:, 0]).astype(float))
        rates = sum((part.tangent() for part in self._parts), -diags_array(self.outside))
        return csr_array(-rates @ liquid)

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of both ends of the bonds of the nodes `first_row` to `end_row` - 1, or of all, in order."""
        assert self._families is not None
        pairs, _ = self._families().of(np.arange(first_row, len(self.volume) if end_row is None else end_row))
        order = np.lexsort((pairs.target, pairs.source))
        return pairs.source[order], pairs.target[order]

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The solid nodes of a kinetic dissolution, for a checkpoint."""
        return {"solid": self.solid.copy()} if self.kinetic else {}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint."""
        if self.kinetic:
            self.solid = entry(checkpoint, "solid", self.solid.shape, self.solid.dtype, 0, 1).copy()

    def bytes(self) -> int:
        """Memory of the nodes' arrays, bytes, without that of bonds."""
        return sum(array.nbytes for array in (self.volume, self.count, self.total, self.solid))
