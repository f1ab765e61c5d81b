"""Constants of fine nodes, by rows of 16 places: most rows of a plate are alike and share one entry."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW


class NodeConstants(NamedTuple):
    """Constants of the fine nodes in r different rows of 16 places, the first deep in the plate, the second empty."""

    constants_row: NDArray[np.int32]  # (n / 16,) of each row of fine places
    mass: NDArray[np.float64]  # (r, 16) of the cells of nodes, kg/m; 0 where there is none
    material: NDArray[np.uint8]  # (r, 16)
    irregular_bond_row: NDArray[
        np.int32
    ]  # (r, 16) row in `irregular_bond_stiffness` of a node that is not like those of a full lattice; -1: it is
    no_fail: NDArray[np.bool_]  # (r, 16) nodes whose bonds do not break
    initial_bond_bits: NDArray[np.uint64]  # (r, 16) bonds at the start, of the first half of the family
    damping: NDArray[np.float64] | None  # (r, 16) 1/s; None: nothing is damped


@njit(forceinline=True, **INNER)
def node_constant_at_place(node_constants, values, p):  # type: ignore[no-untyped-def]
    """The value of the fine node at place p, of values (r, 16)."""
    return values[node_constants.constants_row[p // ROW], p % ROW]


def are_bonds_intact(
    node_constants: NodeConstants,
    broken_bond_bits: NDArray[np.uint64],
    owner: NDArray[np.int64],
    bond: NDArray[np.integer],
) -> NDArray[np.bool_]:
    """Whether these bonds (k,) of the first half of the families at places `owner` (k,) were there at the start and are
    not among those `broken_bond_bits` (n,), a bit each."""
    bits = node_constants_at_places(node_constants, node_constants.initial_bond_bits, owner) & ~broken_bond_bits[owner]
    return np.asarray(bits >> bond.astype(np.uint64) & np.uint64(1) != 0)


def node_constants_at_places(
    node_constants: NodeConstants, values: NDArray[Any], places: NDArray[np.int64]
) -> NDArray[Any]:
    """Values (k,) of the fine nodes at places (k,), of values (r, 16)."""
    return np.asarray(values[node_constants.constants_row[places // ROW], places % ROW])
