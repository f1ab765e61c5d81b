"""Lists of the current nodes of both lattices and of their bonds, and values of nodes in the order of these lists."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.arrays import BorderNode
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.zone.cells import FREE, IDLE, place_on_finer_lattice


class NodeLists(NamedTuple):
    """The current nodes of the fine and the coarse lattice; a coarse node and the fine one it lies on are one row."""

    fine_places: NDArray[np.int64]  # (k,) places on their lattice, in order
    coarse_places: NDArray[np.int32]  # (q,)
    row_of_fine_node: NDArray[np.int64]  # (k,) rows among all n nodes
    row_of_coarse_node: NDArray[np.int32]  # (q,)


@cached_njit(nogil=True, error_model="numpy")
def number_current_nodes(numbering, fine, coarse, fine_rows, coarse_rows):  # type: ignore[no-untyped-def]
    """Set the rows of both kinds of nodes; returns the fine places (n,) of all nodes."""
    places = np.empty(0, np.int64)
    for fills in (False, True):
        i, j, n = 0, 0, 0
        while i < len(fine) or j < len(coarse):
            p, beneath = fine[i] if i < len(fine) else np.int64(2**62), np.int64(2**62)
            if j < len(coarse):
                beneath = place_on_finer_lattice(numbering.coarse, numbering.fine, 2, np.int64(coarse[j]))
            if fills:
                places[n] = min(p, beneath)
            if p <= beneath:
                fine_rows[i] = n
                i += 1
            if beneath <= p:
                coarse_rows[j] = n
                j += 1
            n += 1
        if not fills:
            places = np.empty(n, np.int64)
    return places


@cached_njit(nogil=True, error_model="numpy")
def list_bonds_and_springs(  # type: ignore[no-untyped-def]
    node_kinds,
    stiffness_index,
    row_stiffness,
    coarse_stiffness_index,
    coarse_row_stiffness,
    broken_bond_bits,
    offsets,
    fine_bond_of_spring,
    lists,
    bonds,
    springs,
):
    """Set the mask (k, family) of past and present bonds of fine nodes to nodes that exist, and the bits (q, 1) of the
    springs of coarse nodes, without those that are fine bonds too: `fine_bond_of_spring` (8,) says which, -1: none.

    The first five are columns of the `LatticeNodes` of both lattices.
    """
    fine, coarse, fine_rows, coarse_rows = lists
    half = len(offsets) // 2
    for i in range(len(fine)):
        p, lane = fine[i], fine[i] % ROW
        row = stiffness_index[p // ROW]
        row = -2 - row if row < 0 else row
        for k in range(len(offsets)):
            j = p + offsets[k]
            word = broken_bond_bits[p] >> np.uint64(k) if k < half else broken_bond_bits[j] >> np.uint64(k - half)
            bonds[i, k] = (row_stiffness[row, k, lane] > 0 or word & np.uint64(1) != 0) and node_kinds[j] != IDLE
    i = 0
    for j in range(len(coarse)):
        row, lane, spring_bits = coarse[j] // ROW, coarse[j] % ROW, 0
        while i < len(fine) and fine_rows[i] < coarse_rows[j]:
            i += 1
        twin = i < len(fine) and fine_rows[i] == coarse_rows[j]
        for k in range(8):
            has_spring = coarse_stiffness_index[row] < 0 or coarse_row_stiffness[row, k, lane] > 0
            if has_spring and not (twin and fine_bond_of_spring[k] >= 0 and bonds[i, fine_bond_of_spring[k]]):
                spring_bits |= 128 >> k
        springs[j, 0] = spring_bits


@cached_njit(nogil=True, error_model="numpy")
def gather_node_values(values, inverse_mass, places, rows, out):  # type: ignore[no-untyped-def]
    """Gather values (2, .) of the nodes at these places (k,) in the rows (k,) of out (n, 2), times `inverse_mass` (.,),
    where that is not of length 0."""
    scaled = len(inverse_mass) > 0
    for n in range(len(places)):
        p = places[n]
        for axis in range(2):
            out[rows[n], axis] = values[axis, p] * inverse_mass[p] if scaled else values[axis, p]


@cached_njit(nogil=True, error_model="numpy")
def scatter_node_motion(value, rate, places, rows, u, v, node_kinds):  # type: ignore[no-untyped-def]
    """Set displacements and velocities (2, .) of the free nodes at these places (k,) to the rows (k,) of values and
    rates (n, 2)."""
    for n in range(len(places)):
        p = places[n]
        if node_kinds[p] == FREE:
            for axis in range(2):
                u[axis, p], v[axis, p] = value[rows[n], axis], rate[rows[n], axis]


def interpolate_values_of_border_nodes(
    border: NDArray[BorderNode], values: NDArray[np.floating], inverse_mass: NDArray[np.floating]
) -> NDArray[np.floating]:
    """Values (2, k) of border nodes (k,): means of the `values` (2, .) of the nodes that carry them, times their
    `inverse_mass` (.,), where that is not of length 0."""
    ends = border["first_coarser_node"], border["second_coarser_node"]
    first, second = (values[:, end] * inverse_mass[end] if len(inverse_mass) else values[:, end] for end in ends)
    return np.asarray((1 - border["second_weight"]) * first + border["second_weight"] * second)


@cached_njit(nogil=True, error_model="numpy")
def pack_spring_existence_bits(stiffness_index, row_stiffness, places):  # type: ignore[no-untyped-def]
    """The bits (f, 1) of the springs of nodes of a compact lattice at these places (f,)."""
    spring_bits = np.zeros((len(places), 1), np.uint8)
    for j in range(len(places)):
        row, lane, bits = places[j] // ROW, places[j] % ROW, 0
        for k in range(8):
            if stiffness_index[row] < 0 or row_stiffness[row, k, lane] > 0:
                bits |= 128 >> k
        spring_bits[j, 0] = bits
    return spring_bits
