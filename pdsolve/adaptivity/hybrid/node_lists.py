"""Lists of the current nodes of both lattices and of their bonds, and values of nodes in the order of these lists."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.lattice import BELOW, BELOW_COARSE, FREE, IDLE, LEFT
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.kernel import INNER


class NodeLists(NamedTuple):
    """The current nodes of the fine and the coarse lattice; a coarse node and the fine one it lies on are one row."""

    fine: NDArray[np.int64]  # (k,) places on their lattice, in order
    coarse: NDArray[np.int32]  # (q,)
    fine_rows: NDArray[np.int64]  # (k,) rows among all n nodes
    coarse_rows: NDArray[np.int32]  # (q,)


@njit(forceinline=True, **INNER)
def _fine_place_of_coarse(at, q):  # type: ignore[no-untyped-def]
    """The fine place that a coarse node lies on."""
    y, x = q // at.coarse_stride, q % at.coarse_stride
    return (2 * (y - BELOW_COARSE) + BELOW) * at.stride + LEFT + 2 * (x - LEFT)


@cached_njit(nogil=True, error_model="numpy")
def number_nodes(at, fine, coarse, fine_rows, coarse_rows):  # type: ignore[no-untyped-def]
    """Set the rows of both kinds of nodes; returns the fine places (n,) of all nodes."""
    places = np.empty(0, np.int64)
    for fills in (False, True):
        i, j, n = 0, 0, 0
        while i < len(fine) or j < len(coarse):
            beneath = _fine_place_of_coarse(at, np.int64(coarse[j])) if j < len(coarse) else np.int64(2**62)
            p = fine[i] if i < len(fine) else np.int64(2**62)
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
def list_bonds_and_springs(kind, entry, own, coarse_entry, coarse_own, lost, ways, same, lists, bonds, springs):  # type: ignore[no-untyped-def]
    """Set the mask (k, family) of past and present bonds of fine nodes to nodes that exist, and the bits (q, 1) of the
    springs of coarse nodes, without those that are fine bonds too: `same` (8,) says which, -1: none.

    The first five are columns of the `LatticeNodes` of both lattices.
    """
    fine, coarse, at_fine, at_coarse = lists
    half = len(ways) // 2
    for i in range(len(fine)):
        p, lane = fine[i], fine[i] % ROW
        row = entry[p // ROW]
        row = -2 - row if row < 0 else row
        for k in range(len(ways)):
            j = p + ways[k]
            word = lost[p] >> np.uint64(k) if k < half else lost[j] >> np.uint64(k - half)
            bonds[i, k] = (own[row, k, lane] > 0 or word & np.uint64(1) != 0) and kind[j] != IDLE
    i = 0
    for j in range(len(coarse)):
        row, lane, spring_bits = coarse[j] // ROW, coarse[j] % ROW, 0
        while i < len(fine) and at_fine[i] < at_coarse[j]:
            i += 1
        twin = i < len(fine) and at_fine[i] == at_coarse[j]
        for k in range(8):
            has_spring = coarse_entry[row] < 0 or coarse_own[row, k, lane] > 0
            if has_spring and not (twin and same[k] >= 0 and bonds[i, same[k]]):
                spring_bits |= 128 >> k
        springs[j, 0] = spring_bits


@cached_njit(nogil=True, error_model="numpy")
def gather_values(values, coarse_values, light, coarse_light, border, lists, out):  # type: ignore[no-untyped-def]
    """Gather values (2, .) of both lattices in out (n, 2), times `light` (.,), where that is not of length 0; those of
    border nodes are means of the coarse nodes they lie between."""
    fine, coarse, at_fine, at_coarse = lists
    node, end, w, _ = border
    scaled, b = len(light) > 0, 0
    for i in range(len(fine)):
        p, n = fine[i], at_fine[i]
        on = b < len(node) and node[b] == p
        for axis in range(2):
            if on:
                first, second = coarse_values[axis, end[b, 0]], coarse_values[axis, end[b, 1]]
                if scaled:
                    first, second = first * coarse_light[end[b, 0]], second * coarse_light[end[b, 1]]
                out[n, axis] = (1 - w[b]) * first + w[b] * second
            else:
                out[n, axis] = values[axis, p] * light[p] if scaled else values[axis, p]
        b += on
    for j in range(len(coarse)):
        q, n = coarse[j], at_coarse[j]
        for axis in range(2):
            out[n, axis] = coarse_values[axis, q] * coarse_light[q] if scaled else coarse_values[axis, q]


@cached_njit(nogil=True, error_model="numpy")
def scatter_values(value, rate, u, v, kind, coarse_u, coarse_v, coarse_kind, border, lists):  # type: ignore[no-untyped-def]
    """Set displacements and velocities (2, .) of both lattices to values and rates (n, 2); border nodes follow."""
    fine, coarse, at_fine, at_coarse = lists
    node, end, w, off = border
    for j in range(len(coarse)):
        q, n = coarse[j], at_coarse[j]
        if coarse_kind[q] == FREE:
            for axis in range(2):
                coarse_u[axis, q], coarse_v[axis, q] = value[n, axis], rate[n, axis]
    for i in range(len(fine)):
        p = fine[i]
        for axis in range(2):
            if kind[p] == FREE:
                u[axis, p], v[axis, p] = value[at_fine[i], axis], rate[at_fine[i], axis]
    for b in range(len(node)):
        for axis in range(2):
            between = (1 - w[b]) * coarse_u[axis, end[b, 0]] + w[b] * coarse_u[axis, end[b, 1]]
            u[axis, node[b]] = between + off[b, axis]


@cached_njit(nogil=True, error_model="numpy")
def gather_far_values(values, light, tied, far, at_far, out):  # type: ignore[no-untyped-def]
    """Gather values (2, .) of far nodes, and of coarse ones tied to them, in out (n, 2); `light` as in `gather_values`.

    Nodes of `tied` and `at_far` are rows of out.
    """
    rows, end, w, _ = tied
    scaled = len(light) > 0
    for axis in range(2):
        for n in range(len(rows)):
            a, b = end[n, 0], end[n, 1]
            first, second = values[axis, a], values[axis, b]
            out[rows[n], axis] = (1 - w[n]) * (first * light[a] if scaled else first) + w[n] * (
                second * light[b] if scaled else second
            )
        for j in range(len(far)):
            out[at_far[j], axis] = values[axis, far[j]] * light[far[j]] if scaled else values[axis, far[j]]


@cached_njit(nogil=True, error_model="numpy")
def scatter_far_values(value, rate, u, v, coarse_u, tied, far, at_far):  # type: ignore[no-untyped-def]
    """Set displacements and velocities (2, .) of far nodes to values and rates (n, 2); tied coarse nodes follow."""
    node, end, w, _ = tied
    for axis in range(2):
        for j in range(len(far)):
            u[axis, far[j]], v[axis, far[j]] = value[at_far[j], axis], rate[at_far[j], axis]
        for n in range(len(node)):
            coarse_u[axis, node[n]] = (1 - w[n]) * u[axis, end[n, 0]] + w[n] * u[axis, end[n, 1]]


@cached_njit(nogil=True, error_model="numpy")
def pack_spring_bits(entry, row_stiffness, places):  # type: ignore[no-untyped-def]
    """The bits (f, 1) of the springs of nodes of a compact lattice at these places (f,)."""
    spring_bits = np.zeros((len(places), 1), np.uint8)
    for j in range(len(places)):
        row, lane, bits = places[j] // ROW, places[j] % ROW, 0
        for k in range(8):
            if entry[row] < 0 or row_stiffness[row, k, lane] > 0:
                bits |= 128 >> k
        spring_bits[j, 0] = bits
    return spring_bits
