"""Several operators on the same nodes as one: what they add, hold and resist adds up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import expect_found
from pdsolve.operators.protocol import BondLayout, CheckpointArrays, Motion, Operator
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.stepper import Stepper


class Together:
    """The sum of operators on n nodes; see `Operator`. No pair of nodes may have bonds in two of them."""

    def __init__(self, *parts: Operator) -> None:
        """The last part are the bonds, whose kernel it is called by.

        Raises ValueError for parts of other unknowns than those of the first.
        """
        self.parts, self.name = parts, parts[-1].name
        self.unknowns: tuple[Unknown, ...] = parts[0].unknowns
        self.symmetric = all(part.symmetric for part in parts)
        for part in parts:
            if part.unknowns != self.unknowns:
                raise ValueError(f"{part.name} has unknowns {part.unknowns}; use {self.unknowns}")

    @property
    def bond_layout(self) -> BondLayout:
        """Where the bonds of the last part are."""
        return self.parts[-1].bond_layout

    def to_own_layout(self, state: State) -> State:
        """The state in the layout of the last part; the others copy it."""
        for part in self.parts:
            state = part.to_own_layout(state)
        return state

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w) of all parts to `out`; bonds over their limit break in this `step`."""
        for part in self.parts:
            part.accumulate_force(state, out, step, dt)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        strain_energy, dissipated = zip(*(part.energies(state) for part in self.parts), strict=True)
        return np.sum(strain_energy, axis=0), np.sum(dissipated, axis=0)

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Stored fields (n,) of all parts; of two of one name that of the later part."""
        return {name: values for part in self.parts for name, values in part.fields(state).items()}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4: largest eigenvalues add up at most."""
        return np.asarray(sum(part.stiffness_bound() for part in self.parts))

    def intact_stiffness_bound(self) -> NDArray[np.float64] | None:
        """A bound (n,) of each node's stiffness, N/m^4, with the bonds that are left: that of the last part."""
        return self.parts[-1].intact_stiffness_bound()

    def march(self, motion: Motion) -> Stepper | None:
        """None: Verlet adds up what the parts add."""
        return None

    def update_history(self, state: State) -> None:
        """Update the history of nodes of all parts at an equilibrium."""
        for part in self.parts:
            part.update_history(state)

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the force densities by the values, (n w, n w), N/m^4."""
        first, *others = (part.tangent(state) for part in self.parts)
        matrix: csr_array = sum(others, first).tocsr()
        return matrix

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        end_lists = zip(*(part.bonds(first_row, end_row, at_start) for part in self.parts), strict=True)
        source, target = (np.concatenate(ends) for ends in end_lists)
        order = np.lexsort((target, source))
        return source[order], target[order]

    def broken(self, after_step: int = 0) -> Broken:
        """The bonds broken after a step, part by part."""
        column_lists = zip(*(part.broken(after_step) for part in self.parts), strict=True)
        return Broken(*(np.concatenate(columns) for columns in column_lists))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of all parts for a checkpoint; names begin with the number of the part."""
        return {
            f"{k}_{name}": values
            for k, part in enumerate(self.parts)
            for name, values in part.checkpoint_arrays().items()
        }

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint; each part takes the broken bonds that it began with. Raises CheckpointError."""
        nodes, is_found = len(self.stiffness_bound()), np.zeros(len(broken.step), dtype=np.bool_)
        broken_keys = broken.source * nodes + broken.target
        for k, part in enumerate(self.parts):
            source, target = part.bonds(at_start=True)
            of_part = np.isin(broken_keys, source * nodes + target)
            mine = {
                name.removeprefix(f"{k}_"): values for name, values in checkpoint.items() if name.startswith(f"{k}_")
            }
            part.restore(mine, Broken(*(column[of_part] for column in broken)))
            is_found |= of_part
        expect_found(is_found, broken.source, broken.target)

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        return sum(part.bytes() for part in self.parts)


def unwrap_bond_operator(operator: Operator) -> Operator:
    """The operator of bonds in one to which supports or contact may be added."""
    while isinstance(operator, Together):
        operator = operator.parts[-1]
    return operator
