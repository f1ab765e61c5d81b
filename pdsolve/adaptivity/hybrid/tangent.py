"""Tangent of the forces on all lattices: fine bonds, springs of coarse and far nodes, pieces of clipped bonds.

All of them are springs between points: fine, coarse and far nodes and ends of pieces, in this order.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, eye_array, kron, vstack

from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.row_histories import secants_or_numbers
from pdsolve.operators.tangent import of_followers
from pdsolve.zone.tangent import BondCurves, SpringsBetweenPoints, tangent_of_springs


class PointInterpolationWeights(NamedTuple):
    """Weights by which p points move with n nodes."""

    node_weights: csr_array  # (n, n): of the nodes that are tied to others, by those
    point_weights: csr_array  # (p, n)
    point_at_fine_place: NDArray[np.int64]  # (places,) point of a fine place, -1 without one
    point_at_coarse_place: NDArray[np.int64]  # (coarse places,)
    point_at_coarsest_place: NDArray[np.int64]  # (far places,)
    piece_end_points: NDArray[np.int64]  # (2, pieces)


def create_point_interpolation_weights(
    hybrid: HybridEngine,
    row_at_place: NDArray[np.int32],
    fine: NDArray[np.int64],
    coarse: NDArray[np.int64],
    far: NDArray[np.int64],
) -> PointInterpolationWeights:
    """The points of the current nodes.

    `row_at_place` (places,) is the row of each fine place; `fine`, `coarse` and `far` are the places of nodes on the
    lattices.
    """
    zone, nodes, numbering = hybrid.zone, int(row_at_place.max()) + 1, hybrid.plate.numbering
    row_of_coarse, row_of_far = (
        np.full(places, -1, dtype=np.int64) for places in (numbering.coarse.place_count, numbering.far.place_count)
    )
    on, far_on = hybrid.fine_places_of_coarse(coarse), hybrid.fine_places_of_coarsest_nodes(far)
    row_of_coarse[coarse], row_of_far[far] = row_at_place[on], row_at_place[far_on]
    independent, of_node = np.ones(nodes), csr_array((nodes, nodes))
    for border, entry_count, rows, ends in (
        (zone.border_nodes, zone.counts.border_nodes, row_at_place, row_of_coarse),
        (zone.tied_coarse_nodes, zone.counts.tied_nodes, row_of_coarse, row_of_far),
    ):
        entries = border[:entry_count]
        tied = rows[entries["border_node"]].astype(np.int64)
        interpolation_nodes = ends[np.column_stack([entries["first_coarser_node"], entries["second_coarser_node"]])]
        w, twice = entries["second_weight"], np.tile(tied, 2)
        of_node = (
            of_node
            + coo_array((np.concatenate([1 - w, w]), (twice, interpolation_nodes.T.ravel())), (nodes, nodes)).tocsr()
        )
        independent[tied] = 0.0
    of_node = (of_node + diags_array(independent)).tocsr()

    pieces, entry_count = zone.clipped_pieces, int(zone.counts.clipped_pieces)
    of_fine, of_coarse = np.full(numbering.fine.place_count, -1), np.full(numbering.coarse.place_count, -1)
    of_fine[fine], of_coarse[coarse] = np.arange(len(fine)), len(fine) + np.arange(len(coarse))
    of_far = np.full(numbering.far.place_count, -1)
    of_far[far] = len(fine) + len(coarse) + np.arange(len(far))
    node_rows = np.concatenate([row_at_place[fine], row_at_place[on], row_at_place[far_on]]).astype(np.int64)
    node_points = csr_array((np.ones(len(node_rows)), (np.arange(len(node_rows)), node_rows)), (len(node_rows), nodes))
    point_blocks = [node_points]
    for side in range(2):
        piece_ends = pieces.ends[:entry_count, side]
        a, b = piece_ends["first_node"], piece_ends["second_node"]
        on_fine = b < 0
        ends = np.column_stack([np.where(on_fine, 0, a), np.maximum(b, 0)])
        rows = row_of_coarse[ends]
        rows[on_fine] = row_at_place[a[on_fine], None]
        w = np.where(on_fine, 0.0, piece_ends["second_weight"])
        point_blocks.append(of_followers(rows, np.column_stack([1 - w, w]), nodes))
    of_end = len(node_rows) + np.arange(2 * entry_count).reshape(2, entry_count)
    return PointInterpolationWeights(
        of_node, (vstack(point_blocks) @ of_node).tocsr(), of_fine, of_coarse, of_far, of_end
    )


def assemble_tangent(
    hybrid: HybridEngine,
    points: PointInterpolationWeights,
    value: NDArray[np.float64],
    rho: NDArray[np.float64],
    inverse_mass: NDArray[np.float64],
    of_supports: csr_array,
) -> csr_array:
    """Minus the derivative (2 n, 2 n), N/m^4, of the force densities (n, 2) at `value`.

    Nodes have densities `rho` (n,) and 1 / mass `inverse_mass` (n,), m/kg, which is 0 for tied nodes. Softened bonds
    enter with their secant stiffness. `of_supports` (2 n, 2 n), N/m^2, is that of the springs to the ground.
    """
    tied = kron(points.node_weights, eye_array(2)).tocsr()
    density, lightness = (diags_array(np.repeat(field, 2)) for field in (rho, inverse_mass))
    springs = _springs_of_lattices_and_pieces(hybrid, points, points.point_weights @ value)
    force_tangent = tangent_of_springs(points.point_weights, value, springs)
    return (density @ tied @ lightness @ (force_tangent + of_supports)).tocsr()


def _springs_of_lattices_and_pieces(
    hybrid: HybridEngine, points: PointInterpolationWeights, u: NDArray[np.float64]
) -> Iterator[SpringsBetweenPoints]:
    """The fine bonds, the springs of coarse and far nodes, and the pieces of clipped bonds, from both ends, where
    points have the displacements u (p, 2)."""
    zone, lattice = hybrid.zone, hybrid.lattice
    for nodes, point_at, table, offsets in (
        (zone.fine, points.point_at_fine_place, lattice.spring_table, lattice.neighbour_offsets),
        (zone.coarse, points.point_at_coarse_place, lattice.coarse_spring_table, lattice.coarse_neighbour_offsets),
        (zone.far, points.point_at_coarsest_place, lattice.coarsest_spring_table, lattice.coarsest_neighbour_offsets),
    ):
        places, uses_green_strain = np.flatnonzero(point_at >= 0), nodes is not zone.fine
        row = nodes.stiffness_index_of_row[places // ROW].astype(np.int64)
        of_rows = nodes.row_stiffness[np.maximum(row, 0), :, places % ROW]
        of_places = np.where(row[:, None] < 0, table[:, 5], of_rows)  # N/m^2, of all springs of each node
        node, k = np.nonzero(of_places)
        stiffness = of_places[node, k]
        source, target, xi = point_at[places[node]], point_at[places[node] + offsets[k]], table[k, :2]
        if uses_green_strain:
            yield SpringsBetweenPoints(source, target, xi, stiffness, True)
            continue
        pull, eta = stiffness * np.sqrt((xi**2).sum(axis=1)), u[target] - u[source]
        is_longer = ((2 * xi + eta) * eta).sum(axis=1) > 0
        places = places[node]
        entry = hybrid.zone.fine.stiffness_index_of_row[places // ROW].astype(np.int64)
        secant, numbers = secants_or_numbers(hybrid.zone.history, entry, k, places % ROW, is_longer)
        curves = None if numbers is None else BondCurves(hybrid.law, *numbers)
        yield SpringsBetweenPoints(source, target, xi, pull * secant, False, curves)
    piece, (first, second) = zone.clipped_pieces.springs[: zone.counts.clipped_pieces], points.piece_end_points
    piece_xi = np.column_stack([piece["xi_x"], piece["xi_y"]])
    for near, far, sign in ((first, second, 1.0), (second, first, -1.0)):
        yield SpringsBetweenPoints(near, far, sign * piece_xi, piece["stiffness"], True)
