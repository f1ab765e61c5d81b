"""Effects of pre-cracks: cut coarse bonds, edges of cells, visibility; and properties of single bonds."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.node_constants import node_constant_at_place
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.zone.cells import place_number_at

SLACK = 1e-6  # of a spacing: pre-cracks are that much longer at both ends, as in pdmesh.model.visibility


def lengthen_cracks(cracks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Segments (k, 4) in spacings, slightly extended at both ends."""
    way = cracks[:, 2:] - cracks[:, :2]
    more = SLACK * way / np.maximum(np.hypot(*way.T), SLACK)[:, None]
    return np.ascontiguousarray(cracks + np.column_stack([-more, more]))


@njit(**INNER)
def doubled_triangle_area(ax, ay, bx, by, cx, cy):  # type: ignore[no-untyped-def]
    """Twice the signed area of the triangle a, b, c."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@njit(**INNER)
def crosses_crack(cracks, j, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Whether pre-crack j crosses the segment from a to b, in fine spacings."""
    px, py, qx, qy = cracks[j, 0], cracks[j, 1], cracks[j, 2], cracks[j, 3]
    side_a, side_b = doubled_triangle_area(px, py, qx, qy, ax, ay), doubled_triangle_area(px, py, qx, qy, bx, by)
    if side_a * side_b > 0:
        return False
    return doubled_triangle_area(ax, ay, bx, by, px, py) * doubled_triangle_area(ax, ay, bx, by, qx, qy) <= 0


@njit(**INNER)
def is_visible(cracks, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Whether no pre-crack separates two places."""
    visible = True
    for j in range(len(cracks)):
        visible &= not crosses_crack(cracks, j, ax, ay, bx, by)
    return visible


@njit(**INNER)
def _box_around_crack(lattice, j, margin):  # type: ignore[no-untyped-def]
    """Range of columns and rows around pre-crack j, clipped to the plate."""
    cracks = lattice.precrack_segments
    px, py, qx, qy = cracks[j, 0], cracks[j, 1], cracks[j, 2], cracks[j, 3]
    count_x, count_y = lattice.numbering.fine.counts
    x0, x1 = max(0, int(np.floor(min(px, qx))) - margin), min(count_x - 1, int(np.ceil(max(px, qx))) + margin)
    y0, y1 = max(0, int(np.floor(min(py, qy))) - margin), min(count_y - 1, int(np.ceil(max(py, qy))) + margin)
    return x0, y0, x1, y1


@cached_njit(error_model="numpy")
def record_precrack_cuts(lattice):  # type: ignore[no-untyped-def]
    """Record the coarse bonds and edges of cells that pre-cracks cut, and the cells they cross."""
    numbering, cracks = lattice.numbering, lattice.precrack_segments
    for j in range(len(cracks)):
        x0, y0, x1, y1 = _box_around_crack(lattice, j, 3)
        px, py, qx, qy = cracks[j, 0], cracks[j, 1], cracks[j, 2], cracks[j, 3]
        for y in range(y0 // 2, y1 // 2 + 1):
            for x in range(x0 // 2, x1 // 2 + 1):
                q, ax, ay = place_number_at(numbering.coarse, (x, y)), 2.0 * x, 2.0 * y
                for k in range(4):
                    bx, by = ax + 2 * lattice.coarse_dx[k], ay + 2 * lattice.coarse_dy[k]
                    if not crosses_crack(cracks, j, ax, ay, bx, by):
                        continue
                    lattice.cut_coarse_spring_bits[q] |= np.uint8(1 << k)
                    if k in (0, 2):
                        side_a = doubled_triangle_area(px, py, qx, qy, ax, ay)
                        side_b = doubled_triangle_area(px, py, qx, qy, bx, by)
                        lattice.edge_cut_position[k // 2, q] = side_a / (side_a - side_b) if side_a != side_b else 0.5
                if x >= numbering.cells.counts[0] or y >= numbering.cells.counts[1]:
                    continue
                is_cut = crosses_crack(cracks, j, ax, ay, ax + 2, ay + 2)
                is_cut |= crosses_crack(cracks, j, ax + 2, ay, ax, ay + 2)
                is_cut |= ax <= px <= ax + 2 and ay <= py <= ay + 2
                is_cut |= ax <= qx <= ax + 2 and ay <= qy <= ay + 2
                if is_cut:
                    lattice.is_cell_cut[place_number_at(numbering.cells, (x, y))] = True


@njit(forceinline=True, **INNER)
def is_bond_intact(lattice, broken_bond_bits, p, k):  # type: ignore[no-untyped-def]
    """Whether bond k of fine node p is intact."""
    half = len(lattice.neighbour_offsets) // 2
    if k >= half:
        p, k = p + lattice.neighbour_offsets[k], k - half
    initial_bits = node_constant_at_place(lattice.node_constants, lattice.node_constants.initial_bond_bits, p)
    return ((initial_bits & ~broken_bond_bits[p]) >> np.uint64(k)) & np.uint64(1) != 0


@njit(forceinline=True, **INNER)
def full_bond_stiffness(lattice, p, k):  # type: ignore[no-untyped-def]
    """Stiffness of the whole bond k of node p, including both cells' shares and the surface correction."""
    row = node_constant_at_place(lattice.node_constants, lattice.node_constants.irregular_bond_row, p)
    if row >= 0:
        return lattice.irregular_bond_stiffness[row, k]
    return lattice.material_bond_stiffness[
        node_constant_at_place(lattice.node_constants, lattice.node_constants.material, p), k
    ]


@njit(forceinline=True, **INNER)
def peak_and_limit_strain(lattice, p, k):  # type: ignore[no-untyped-def]
    """The e of a bond's peak, and the e at which it breaks."""
    row = node_constant_at_place(lattice.node_constants, lattice.node_constants.irregular_bond_row, p)
    if row >= 0:
        kind = lattice.irregular_limit_row[row]
        return lattice.irregular_peak_strain[kind, k], lattice.irregular_limit_strain[kind, k]
    material = node_constant_at_place(lattice.node_constants, lattice.node_constants.material, p)
    return lattice.material_peak_strain[material, k], lattice.material_limit_strain[material, k]


@njit(forceinline=True, **INNER)
def is_unbreakable(lattice, p):  # type: ignore[no-untyped-def]
    """Whether the bonds of fine node p do not break."""
    return node_constant_at_place(lattice.node_constants, lattice.node_constants.no_fail, p)
