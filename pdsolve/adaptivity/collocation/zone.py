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

from pdsolve.adaptivity.collocation.layout import CollocationPlate, LatticeConstants, Numbering, dilate_mask, row_kinds
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.pull import WIDE
from pdsolve.codegen.record import Record
from pdsolve.codegen.vector_code import ROW
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.stencils import ball

NONE, FINE, COARSE, BETWEEN = range(4)  # places: without a node; active ones; those that are interpolated
EVENTS = 4096  # room for so many breaks at first


class BreakEvents(NamedTuple):
    """The b broken bonds, in arrays with room for more."""

    step: NDArray[np.int32]
    node: NDArray[np.int32]  # place of one of both nodes
    spring: NDArray[np.int32]  # its number among those of that node
    pull: NDArray[np.float64]  # force over stiffness with which it broke
    growth: NDArray[np.float64]  # of its stretch in that step


class Totals(Record):
    """Energies since the start, and stretches of coarse pairs. Checkpoints hold them in this order."""

    dissipated: float  # J/m, by bonds
    switched: float  # J/m, that making nodes fine has added
    largest_e: float  # of coarse pairs so far
    damped: float  # J/m, taken by damping before nodes were switched last


class Counts(Record):
    """Numbers of events. Checkpoints hold them in this order."""

    broken_bonds: int  # in `breaks`
    any_hot: int  # 1 where fine nodes are wanted around any coarse one, or 0
    switches: int  # how often nodes have become fine


class CollocationZone(NamedTuple):
    """The variable arrays of a plate solved by collocation, for compiled code."""

    u: NDArray[np.float64]  # (2, places) m
    v: NDArray[np.float64]  # (2, places) m/s; within a step the mean since the last one
    a: NDArray[np.float64]  # (2, places) m/s^2
    f: NDArray[np.float64]  # (2, places) N/m
    cut: NDArray[np.uint16]  # (places / 16, k) a bit for each bond that is cut or broken
    kinds: NDArray[np.uint8]  # (places / 16,) of rows
    node: NDArray[np.uint8]  # (places,) NONE, FINE, COARSE or BETWEEN
    rows: NDArray[np.int64]  # (r,) rows of 16 places with active fine nodes
    coarse: NDArray[np.int64]  # (c,) places of active coarse nodes
    between: NDArray[np.int64]  # (b, 5) places of fictitious nodes that bonds reach, and of those they are between
    spent: NDArray[np.float64]  # (places,) J/m, by a node's bonds so far
    damping: NDArray[np.float64]  # (places,) 1/s
    damped: NDArray[np.float64]  # (places,) J/m^3
    bounds: NDArray[np.float64]  # (2, places) of e, beyond which bonds break, of e^2, beyond which forces are inexact
    flags: NDArray[np.uint16]  # (r,) of rows, a bit for each node that has a bond over its bound
    again: NDArray[np.uint8]  # (places / 16,) rows whose bonds broke in this step
    hot: NDArray[np.bool_]  # (places,) coarse nodes around which fine ones are wanted
    totals: Totals
    counts: Counts
    breaks: BreakEvents


def mask_coarse_places(at: Numbering) -> NDArray[np.bool_]:
    """Mask (places,) of the places that are coarse nodes too."""
    is_even = np.zeros(at.places, dtype=np.bool_)
    field = is_even[: at.places - 2 * ROW].reshape(-1, at.stride)
    field[at.below : at.below + at.ny : 2, at.left : at.left + at.nx : 2] = True
    return is_even


def parent_places(at: Numbering, places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Coarse places (n, 4) that these lie on or between, each repeated according to its weight."""
    row, column = np.divmod(places, at.stride)
    right, up = (column - at.left) % 2, (row - at.below) % 2
    corner = places - right - up * at.stride
    return np.stack(
        [corner, corner + 2 * right, corner + 2 * up * at.stride, corner + 2 * right + 2 * up * at.stride], 1
    )


def mask_eligible_coarse(ground: LatticeConstants, plate: CollocationPlate, margin: int) -> NDArray[np.bool_]:
    """Mask (places,) of coarse places that may be active.

    They are not beside a node with a condition, nor within `margin` spacings of one without a whole family. Bonds have
    a surface layer at edges, one horizon deep; a stencil that reaches into it removes energy from the motion all along
    the edge.
    """
    odd = (plate.row >= 0) & ~plate.has_full_family
    odd = (dilate_mask(odd, ground.at, margin) if margin else odd) | plate.has_condition
    fine = np.flatnonzero((plate.row >= 0) & odd)
    may_be_active = mask_coarse_places(ground.at) & plate.has_full_family & ~odd
    may_be_active[parent_places(ground.at, fine).ravel()] = False
    return may_be_active


def node_kinds(ground: LatticeConstants, plate: CollocationPlate, active: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Kind of each place if these coarse nodes are active."""
    kinds = np.zeros(ground.at.places, dtype=np.uint8)
    around = active[parent_places(ground.at, plate.place)].all(axis=1)
    kinds[plate.place] = np.where(around, np.where(active[plate.place], COARSE, BETWEEN), FINE)
    return kinds


def active_areas(ground: LatticeConstants, plate: CollocationPlate, node: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Areas (places,) of active nodes, m^2: their own plus those of fictitious nodes by their weights."""
    areas = np.zeros(ground.at.places)
    kind = node[plate.place]
    fine = kind == FINE
    areas[plate.place[fine]] = plate.area[fine]
    np.add.at(areas, parent_places(ground.at, plate.place[~fine]), plate.area[~fine, None] / 4)
    return areas


def create_zone(
    ground: LatticeConstants, plate: CollocationPlate, active: NDArray[np.bool_], band: float
) -> CollocationZone:
    """The initial zone at rest; nodes within a horizon of the seam are damped by `band`, 1/s."""
    places = ground.at.places
    nothing = np.zeros(0, dtype=np.int64)
    u, v, a, f = (aligned(np.zeros((2, places))) for _ in range(4))
    spent, damping, damped = np.zeros((3, places))
    zone = CollocationZone(
        u=u,
        v=v,
        a=a,
        f=f,
        cut=plate.cut,
        kinds=row_kinds(ground, plate.cut),
        node=np.zeros(places, dtype=np.uint8),
        rows=nothing,
        coarse=nothing,
        between=nothing.reshape(0, 5),
        spent=spent,
        damping=damping,
        damped=damped,
        bounds=np.full((2, places), np.inf),
        flags=np.zeros(0, dtype=np.uint16),
        again=np.zeros(places // ROW, dtype=np.uint8),
        hot=np.zeros(places, dtype=np.bool_),
        totals=Totals.of(),
        counts=Counts.of(),
        breaks=BreakEvents(*np.zeros((3, EVENTS), dtype=np.int32), *np.zeros((2, EVENTS))),
    )
    return renumber_zone(ground, plate, zone, active, band)


def renumber_zone(
    ground: LatticeConstants, plate: CollocationPlate, zone: CollocationZone, active: NDArray[np.bool_], band: float
) -> CollocationZone:
    """The zone with these coarse nodes active; nodes within a horizon of the seam are damped by `band`, 1/s."""
    at, node = ground.at, node_kinds(ground, plate, active)
    fine = node == FINE
    rows = np.flatnonzero(fine.reshape(-1, ROW).any(axis=1))
    reached = np.flatnonzero((node == BETWEEN) & dilate_mask(fine, at, at.below))
    between = np.column_stack([reached, parent_places(at, reached)])
    damping = np.zeros(at.places)
    if band > 0:
        coarse = node == COARSE
        damping[(fine & dilate_mask(coarse, at, at.below)) | (coarse & dilate_mask(fine, at, at.below))] = band
        damping[plate.has_condition] = 0.0
    return zone._replace(
        node=node,
        rows=rows,
        coarse=np.flatnonzero(node == COARSE),
        between=between,
        damping=damping,
        bounds=np.where([fine & ~ground.no_fail, fine], [[ground.limit], [WIDE**2]], np.inf),
        flags=np.zeros(len(rows), dtype=np.uint16),
    )


def interpolate_motion(zone: CollocationZone, at: Numbering, places: NDArray[np.int64]) -> None:
    """Interpolate the motion of nodes between coarse ones."""
    four = parent_places(at, places)
    for field in (zone.u, zone.v, zone.a):
        field[:, places] = field[:, four].mean(axis=2)


def deactivate_near(
    ground: LatticeConstants, plate: CollocationPlate, coarse_active: NDArray[np.bool_], stretched: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The coarse nodes that stay active when the neighbourhoods of the `stretched` ones are refined."""
    at, stays_active = ground.at, coarse_active.copy()
    reach = ball(at.below // 2, 2)
    _deactivate(np.flatnonzero(stretched), 2 * (reach[:, 1] * at.stride + reach[:, 0]), stays_active)
    return stays_active


@cached_njit(error_model="numpy")
def _deactivate(hot, ways, active):  # type: ignore[no-untyped-def]
    for q in hot:
        for way in ways:
            if 0 <= q + way < len(active):
                active[q + way] = False
