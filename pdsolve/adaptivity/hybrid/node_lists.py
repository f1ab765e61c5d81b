"""Lists of the current nodes of both lattices and of their bonds, and values of nodes in the order of these lists."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    twin_bonds,
    lists,
    bonds,
    springs,
):
    """Set the mask (k, family) of past and present bonds of fine nodes to nodes that exist, and the bits (q, 1) of the
    springs of coarse nodes, without those that are fine bonds too: `twin_bonds` (8,) says which, -1: none.

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
            if has_spring and not (twin and twin_bonds[k] >= 0 and bonds[i, twin_bonds[k]]):
                spring_bits |= 128 >> k
        springs[j, 0] = spring_bits


@cached_njit(nogil=True, error_model="numpy")
def gather_node_values(values, coarse_values, inverse_mass, coarse_inverse_mass, border, lists, out):  # type: ignore[no-untyped-def]
    """Gather values (2, .) of both lattices in out (n, 2), times `inverse_mass` (.,), where that is not of length
    0; those of border nodes are means of the coarse nodes they lie between."""
    fine, coarse, fine_rows, coarse_rows = lists
    node, end, w, _ = border
    scaled, b = len(inverse_mass) > 0, 0
    for i in range(len(fine)):
        p, n = fine[i], fine_rows[i]
        on = b < len(node) and node[b] == p
        for axis in range(2):
            if on:
                first, second = coarse_values[axis, end[b, 0]], coarse_values[axis, end[b, 1]]
                if scaled:
                    first, second = first * coarse_inverse_mass[end[b, 0]], second * coarse_inverse_mass[end[b, 1]]
                out[n, axis] = (1 - w[b]) * first + w[b] * second
            else:
                out[n, axis] = values[axis, p] * inverse_mass[p] if scaled else values[axis, p]
        b += on
    for j in range(len(coarse)):
        q, n = coarse[j], coarse_rows[j]
        for axis in range(2):
            out[n, axis] = coarse_values[axis, q] * coarse_inverse_mass[q] if scaled else coarse_values[axis, q]


@cached_njit(nogil=True, error_model="numpy")
def scatter_node_motion(value, rate, u, v, node_kinds, coarse_u, coarse_v, coarse_node_kinds, border, lists):  # type: ignore[no-untyped-def]
    """Set displacements and velocities (2, .) of both lattices to values and rates (n, 2); border nodes follow."""
    fine, coarse, fine_rows, coarse_rows = lists
    node, end, w, off = border
    for j in range(len(coarse)):
        q, n = coarse[j], coarse_rows[j]
        if coarse_node_kinds[q] == FREE:
            for axis in range(2):
                coarse_u[axis, q], coarse_v[axis, q] = value[n, axis], rate[n, axis]
    for i in range(len(fine)):
        p = fine[i]
        for axis in range(2):
            if node_kinds[p] == FREE:
                u[axis, p], v[axis, p] = value[fine_rows[i], axis], rate[fine_rows[i], axis]
    for b in range(len(node)):
        for axis in range(2):
            between = (1 - w[b]) * coarse_u[axis, end[b, 0]] + w[b] * coarse_u[axis, end[b, 1]]
            u[axis, node[b]] = between + off[b, axis]


@cached_njit(nogil=True, error_model="numpy")
def gather_far_and_tied_values(values, inverse_mass, tied, far, far_rows, out):  # type: ignore[no-untyped-def]
    """Gather values (2, .) of far nodes, and of coarse ones tied to them, in out (n, 2); see `gather_node_values`.

    Nodes of `tied` and `far_rows` are rows of out.
    """
    rows, end, w, _ = tied
    scaled = len(inverse_mass) > 0
    for axis in range(2):
        for n in range(len(rows)):
            a, b = end[n, 0], end[n, 1]
            first, second = values[axis, a], values[axis, b]
            out[rows[n], axis] = (1 - w[n]) * (first * inverse_mass[a] if scaled else first) + w[n] * (
                second * inverse_mass[b] if scaled else second
            )
        for j in range(len(far)):
            out[far_rows[j], axis] = values[axis, far[j]] * inverse_mass[far[j]] if scaled else values[axis, far[j]]


@cached_njit(nogil=True, error_model="numpy")
def scatter_far_and_tied_motion(value, rate, u, v, coarse_u, tied, far, far_rows):  # type: ignore[no-untyped-def]
    """Set displacements and velocities (2, .) of far nodes to values and rates (n, 2); tied coarse nodes follow."""
    node, end, w, _ = tied
    for axis in range(2):
        for j in range(len(far)):
            u[axis, far[j]], v[axis, far[j]] = value[far_rows[j], axis], rate[far_rows[j], axis]
        for n in range(len(node)):
            coarse_u[axis, node[n]] = (1 - w[n]) * u[axis, end[n, 0]] + w[n] * u[axis, end[n, 1]]


@cached_njit(nogil=True, error_model="numpy")
def pack_spring_bits(stiffness_index, row_stiffness, places):  # type: ignore[no-untyped-def]
    """The bits (f, 1) of the springs of nodes of a compact lattice at these places (f,)."""
    spring_bits = np.zeros((len(places), 1), np.uint8)
    for j in range(len(places)):
        row, lane, bits = places[j] // ROW, places[j] % ROW, 0
        for k in range(8):
            if stiffness_index[row] < 0 or row_stiffness[row, k, lane] > 0:
                bits |= 128 >> k
        spring_bits[j, 0] = bits
    return spring_bits
