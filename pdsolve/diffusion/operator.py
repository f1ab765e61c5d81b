"""Fick's law as an operator: what comes to a node is what its links bring, whatever they are stored in."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.medium import Medium
from pdmesh.model.neighbours import Pairs
from pdsolve.checkpoint import entry
from pdsolve.diffusion.dissolution import potential, solid_share
from pdsolve.model import ModelError
from pdsolve.operators.protocol import Kept
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Exchange(Protocol):
    """Links of n nodes: what they bring is linear in the potentials."""

    @property
    def name(self) -> str:
        """How links are stored: the name of the kernel, for the record."""

    @property
    def volume(self) -> NDArray[np.float64]:
        """The volume of each node (n,), m^d."""

    @property
    def total(self) -> NDArray[np.float64]:
        """(n,) 1/s: what leaves a node for each mol/m^3."""

    @property
    def count(self) -> NDArray[np.int64]:
        """The number of links of each node, (n,)."""

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add to `out` (n,) what comes to each node, per volume and time, at this `potential` (n,)."""

    def tangent(self) -> csr_array:
        """The rates (n, n) by the potentials, 1/s."""

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Sum over links of what the `share` (n,) differs by, conductances and both volumes counted, m^d/s."""


class Dissolving(Exchange, Protocol):
    """Links that ask both of their ends whether they are solid."""

    def dissolve(
        self,
        concentration: NDArray[np.float64],
        solid: NDArray[np.uint8],
        C_sat: float,
        k_diss: float,
        out: NDArray[np.float64],
    ) -> None:
        """Add the rates (n,) of a kinetic dissolution to `out`."""


class Pull(Protocol):
    """Gives links of some rows, which increase, with their conductances (b,)."""

    def linked(self, rows: NDArray[np.int64]) -> tuple[Pairs, NDArray[np.float64]]:
        """The links (b,) of these rows and their conductances (b,), 1/(s m^d)."""


class Fick:
    """The content of n nodes, mol/m^3, that links make even; see `pdsolve.operators.protocol.Operator`.

    A node that dissolves kinetically remembers whether it is solid: until its content has fallen to C_sat.
    """

    unknowns: tuple[Unknown, ...] = (Unknown("h", 1, 1),)
    symmetric = True  # what leaves a node comes to others

    def __init__(self, exchange: Exchange, links: Callable[[], Pull], medium: Medium) -> None:
        self.exchange, self.medium, self._links = exchange, medium, links
        self.name, self.volume, self.count = exchange.name, exchange.volume, exchange.count
        self.kinetic = medium.dissolution == "kinetic"
        self.solid = np.zeros(len(self.volume), dtype=np.uint8)  # (n,) whether a node is solid; kinetic alone

    def place(self, state: State) -> State:
        """The state, which has the layout of this operator."""
        return state

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add what comes to each node along links to `out` (n, 1), mol/(m^3 s)."""
        content = state.value[:, 0]
        if not self.kinetic:
            self.exchange.rates(potential(self.medium, content), out[:, 0])
            return
        self.solid = self._solid(content)
        exchange: Dissolving = self.exchange  # type: ignore[assignment]  # which `system` lists for a kinetic solid
        C_sat = (self.medium.C_sat or 0.0) if self.medium.capped else np.inf
        exchange.dissolve(content, self.solid, C_sat, self.medium.k_diss, out[:, 0])

    def _solid(self, content: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Which nodes (n,) of this content are solid, of those that were."""
        return self.solid & (content > (self.medium.C_sat or 0.0)).astype(np.uint8)

    def share(self, state: State) -> NDArray[np.float64]:
        """How much of each node (n,) is solid, from 0 to 1."""
        if self.kinetic:
            return self._solid(state.value[:, 0]).astype(float)
        return solid_share(self.medium, state.value[:, 0])

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Densities (n,), J/m^3: a content holds no energy, and links spend none."""
        return np.zeros(len(self.volume)), np.zeros(len(self.volume))

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """What is dissolved and all there is, mol/m^3, and the share that is solid, (n,) each."""
        content = state.value[:, 0]
        return {"c": potential(self.medium, content), "h": content, "solid": self.share(state)}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of the rates' eigenvalues, 1/s: forward Euler is stable up to 2 over it."""
        faster = max(1.0, self.medium.k_diss) if self.kinetic else 1.0
        return 2 * faster * self.exchange.total

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the rates by the contents, (n, n), 1/s. Raises ModelError for a kinetic solid."""
        from scipy.sparse import csr_array, diags_array

        if self.kinetic:
            raise ModelError("medium.dissolution: found kinetic, whose rates jump, expected enthalpy for a tangent")
        C_sat = np.inf if self.medium.C_sat is None else self.medium.C_sat
        liquid = (state.value[:, 0] < C_sat).astype(float)
        return csr_array(-self.exchange.tangent() @ diags_array(liquid))

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of both ends of the links of the nodes `first` to `last` - 1, or of all, in order."""
        pairs, _ = self._links().linked(np.arange(first, len(self.volume) if last is None else last))
        order = np.lexsort((pairs.target, pairs.source))
        return pairs.source[order], pairs.target[order]

    def broken(self, after: int = 0) -> Broken:
        """None: links do not break."""
        return Broken(*np.zeros((3, 0), dtype=np.int64))

    def keep(self) -> Kept:
        """Which nodes are solid, of a kinetic dissolution."""
        return {"solid": self.solid.copy()} if self.kinetic else {}

    def back(self, kept: Kept, broken: Broken) -> None:
        """Go back to what was kept."""
        if self.kinetic:
            self.solid = entry(kept, "solid", self.solid.shape, self.solid.dtype, 0, 1).copy()

    def bytes(self) -> int:
        """Memory of the arrays of nodes; links know theirs."""
        return sum(array.nbytes for array in (self.volume, self.count, self.exchange.total, self.solid))
