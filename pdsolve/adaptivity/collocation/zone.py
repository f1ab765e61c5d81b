"""Fine and coarse nodes; all of it follows from which coarse nodes are active.

A coarse node is active if its neighbourhood is whole and nothing is about to break in it. A fine node is active unless
all the one, two or four coarse nodes that it lies on or between are. It is then fictitious: interpolated from them with
equal weights, exact for linear fields (multi-grid coupling of A. Shojaei, A. Hermann, C. J. Cyron, P. Seleson, S. A.
Silling, Comput. Methods Appl. Mech. Eng. 391 (2022) 114544, on vertex-nested grids). An inactive coarse node is the
active fine node that it lies on. No fictitious node is therefore interpolated from another, and each place has one
displacement.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.collocation.layout import (
    CollocationPlate,
    LatticeConstants,
    PlateNumbering,
    dilate_mask,
    reshape_to_lattice,
)
from pdsolve.adaptivity.hybrid.arrays import BreakEvents
from pdsolve.codegen.record import Record
from pdsolve.codegen.vector_code import ROW
from pdsolve.numerics.memory import aligned
from pdsolve.operators.stencils import ball
from pdsolve.state import State

NONE, FINE, COARSE, BETWEEN = range(4)  # places: without a node; active ones; those that are interpolated


class EnergyTotals(Record):
    """Energies since the start, and stretches of coarse pairs. Checkpoints hold them in this order."""

    dissipated_energy: float  # J/m, by bonds
    refinement_energy: float  # J/m, that making nodes fine has added
    largest_double_green_strain: float  # of coarse pairs so far
    damped_energy: float  # J/m, taken by damping before nodes were switched last


class ZoneCounts(Record):
    """Numbers of events. Checkpoints hold them in this order."""

    broken_bonds: int  # in `break_events`
    refinement_due: int  # 1 where fine nodes are wanted around any coarse one, or 0
    refinements: int  # how often nodes have become fine


class CollocationZone(NamedTuple):
    """The variable arrays of a plate solved by collocation, for compiled code."""

    u: NDArray[np.float64]  # (2, places) m
    v: NDArray[np.float64]  # (2, places) m/s; within a step the mean since the last one
    f: NDArray[np.float64]  # (2, places) N/m^3
    cut_bond_bits: NDArray[np.uint16]  # (places / 16, k) a bit for each bond that is cut or broken
    stiffness_index_of_row: NDArray[np.int32]  # (places / 16,) which of `row_stiffness` a row has, see there
    node_kinds: NDArray[np.uint8]  # (places,) NONE, FINE, COARSE or BETWEEN
    rows_with_fine_nodes: NDArray[np.int64]  # (r,) rows of 16 places with active fine nodes
    rows_with_coarse_nodes: NDArray[np.int64]  # (q,) rows of 16 places with active coarse nodes
    active_coarse_places: NDArray[np.int64]  # (c,) places of active coarse nodes
    fictitious_nodes: NDArray[np.int64]  # (b, 5) places of those that bonds reach, and of the four they are between
    node_dissipation: NDArray[np.float64]  # (places,) J/m, by a node's bonds so far
    has_bond_over_limit: NDArray[np.bool_]  # (places / 16,) of rows with fine nodes
    is_to_refine: NDArray[np.bool_]  # (places,) nodes around which fine ones are wanted
    totals: EnergyTotals
    counts: ZoneCounts
    break_events: BreakEvents


def coarse_parent_places(numbering: PlateNumbering, places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Coarse places (n, 4) that these lie on or between, each repeated according to its weight."""
    row, column = np.divmod(places, numbering.row_stride)
    right, up = (column - numbering.left_margin) % 2, (row - numbering.row_margin) % 2
    corner = places - right - up * numbering.row_stride
    across, along = 2 * right, 2 * up * numbering.row_stride
    return np.stack([corner, corner + across, corner + along, corner + across + along], 1)


def mask_possible_coarse_nodes(lattice: LatticeConstants, plate: CollocationPlate, margin: int) -> NDArray[np.bool_]:
    """Mask (places,) of coarse places that may be active.

    They are not beside a node with a condition, nor within `margin` spacings of one without a whole family. Bonds have
    a surface layer at edges, one horizon deep; a stencil that reaches into it removes energy from the motion all along
    the edge.
    """
    odd = (plate.grid_row_at_place >= 0) & ~plate.has_full_family
    odd = (dilate_mask(odd, lattice.numbering, margin) if margin else odd) | plate.has_condition
    fine = np.flatnonzero((plate.grid_row_at_place >= 0) & odd)
    may_be_active = np.zeros(len(odd), dtype=np.bool_)
    reshape_to_lattice(may_be_active, lattice.numbering)[::2, ::2] = True
    may_be_active &= plate.has_full_family & ~odd
    may_be_active[coarse_parent_places(lattice.numbering, fine).ravel()] = False
    return may_be_active


def node_kinds_at_places(
    lattice: LatticeConstants, plate: CollocationPlate, is_active: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Kind of each place if these coarse nodes are active."""
    kinds = np.zeros(lattice.numbering.place_count, dtype=np.uint8)
    around = is_active[coarse_parent_places(lattice.numbering, plate.place_of_grid_row)].all(axis=1)
    kinds[plate.place_of_grid_row] = np.where(
        around, np.where(is_active[plate.place_of_grid_row], COARSE, BETWEEN), FINE
    )
    return kinds


def areas_of_active_nodes(
    lattice: LatticeConstants, plate: CollocationPlate, node_kinds: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """Areas (places,) of active nodes, m^2: their own plus those of fictitious nodes by their weights."""
    areas = np.zeros(lattice.numbering.place_count)
    kind = node_kinds[plate.place_of_grid_row]
    fine = kind == FINE
    areas[plate.place_of_grid_row[fine]] = plate.node_areas[fine]
    np.add.at(
        areas,
        coarse_parent_places(lattice.numbering, plate.place_of_grid_row[~fine]),
        plate.node_areas[~fine, None] / 4,
    )
    return areas


def create_collocation_zone(plate: CollocationPlate, state: State) -> CollocationZone:
    """The zone with this `state` by places, without any active nodes."""
    places, nothing = len(state.value), np.zeros(0, dtype=np.int64)
    step, number = np.zeros((2, 0), dtype=np.int32)  # room is made as bonds break
    return CollocationZone(
        u=state.value.T,
        v=state.rate.T,
        f=aligned(np.zeros((2, places))),
        cut_bond_bits=plate.cut_bond_bits.copy(),
        stiffness_index_of_row=plate.stiffness_index_of_row.copy(),
        node_kinds=np.zeros(places, dtype=np.uint8),
        rows_with_fine_nodes=nothing,
        rows_with_coarse_nodes=nothing,
        active_coarse_places=nothing,
        fictitious_nodes=nothing.reshape(0, 5),
        node_dissipation=np.zeros(places),
        has_bond_over_limit=np.zeros(places // ROW, dtype=np.bool_),
        is_to_refine=np.zeros(places, dtype=np.bool_),
        totals=EnergyTotals.of(),
        counts=ZoneCounts.of(),
        break_events=BreakEvents(step, nothing, number, *np.zeros((2, 0))),
    )


def zone_with_active_coarse_nodes(
    lattice: LatticeConstants, plate: CollocationPlate, zone: CollocationZone, is_active: NDArray[np.bool_]
) -> CollocationZone:
    """The zone with these coarse nodes active."""
    numbering, kinds = lattice.numbering, node_kinds_at_places(lattice, plate, is_active)
    has_fine = (kinds == FINE).reshape(-1, ROW).any(axis=1)
    in_rows = np.repeat(has_fine, ROW)  # whose sums are all formed
    reached = np.flatnonzero((kinds == BETWEEN) & dilate_mask(in_rows, numbering, numbering.row_margin))
    return zone._replace(
        node_kinds=kinds,
        rows_with_fine_nodes=np.flatnonzero(has_fine),
        rows_with_coarse_nodes=np.flatnonzero((kinds == COARSE).reshape(-1, ROW).any(axis=1)),
        active_coarse_places=np.flatnonzero(kinds == COARSE),
        fictitious_nodes=np.column_stack([reached, coarse_parent_places(numbering, reached)]),
    )


def mask_nodes_near_border(
    lattice: LatticeConstants, plate: CollocationPlate, node_kinds: NDArray[np.uint8]
) -> NDArray[np.bool_]:
    """Mask (places,) of fine nodes within a horizon of coarse ones and of coarse ones likewise, without conditions."""
    numbering, fine, coarse = lattice.numbering, node_kinds == FINE, node_kinds == COARSE
    near = fine & dilate_mask(coarse, numbering, numbering.row_margin)
    near |= coarse & dilate_mask(fine, numbering, numbering.row_margin)
    return np.asarray(near & ~plate.has_condition)


def interpolate_motion_between_coarse_nodes(state: State, numbering: PlateNumbering, places: NDArray[np.int64]) -> None:
    """Interpolate the motion of nodes between coarse ones."""
    for field in state[:3]:
        field[places] = field[coarse_parent_places(numbering, places)].mean(axis=1)


def mask_coarse_nodes_after_refinement(
    lattice: LatticeConstants, coarse_active: NDArray[np.bool_], is_to_refine: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The coarse nodes that stay active when the neighbourhoods of the `is_to_refine` nodes are refined."""
    numbering, stays_active = lattice.numbering, coarse_active.copy()
    ways = 2 * ball(numbering.row_margin // 2, 2)
    centres = np.unique(coarse_parent_places(numbering, np.flatnonzero(is_to_refine)))
    around = (centres[:, None] + ways[:, 1] * numbering.row_stride + ways[:, 0]).ravel()
    stays_active[around[(around >= 0) & (around < len(stays_active))]] = False
    return stays_active
