"""Bonds to nodes that are held along an edge, which make up for those that end beyond it.

A grip of one row is soft: nodes within a horizon of it lack the bonds to what it would hold beyond the edge, and bonds
to it carry too little. Here those bonds pull harder, by a factor 1 + M / (H + E) of each free node near the grip, so
that in stretching across the edge what pulls it towards the grip is what pulls it away:

    H    pull of its bonds to the grip, along the direction n to the nearest node of the grip
    E    pull of its other bonds to nodes as far along n, beside the grip on its edge
    M    what the pull of all bonds towards the grip (n . xi > 0) lacks of that away from it

A bond of unit vector e with c = n . e is stretched by c^2 - nu (1 - c^2), and pulls along n by its stiffness times that
times c. The correction of surfaces, which makes bonds near an edge stiffer, stops at grips and at loads that are shared
among the rows of a horizon: nodes near one have that of nodes farther inside. Grips a horizon deep have M = 0.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Acceleration, Displacement, Load, Velocity
from pdmesh.model.load_resultants import shares_of
from pdmesh.model.neighbours import row_chunks, tree_of
from pdmesh.model.selection import components
from pdsolve.bonds.assembly import BondSource, Part
from pdsolve.conditions import is_corrected
from pdsolve.model import Model

MOST = 32.0  # of a factor
SAME = 0.01  # of a depth: nodes this much nearer than a grip are on its edge
NU = 1 / 3  # contraction across a pull that nothing hinders
NOTHING = 1e-9  # of the pull away from a grip: what is less is round-off


class _Ends(NamedTuple):
    """The bonds of some rows, b of them, by their ends."""

    source: NDArray[np.int64]  # (b,)
    target: NDArray[np.int64]  # (b,)
    unit: NDArray[np.float64]  # (b, d)
    stiffness: NDArray[np.floating]  # (b,)
    length: NDArray[np.float64]  # (b,) m


def gripped(filling: BondSource, model: Model) -> BondSource:
    """The filling whose bonds to corrected grips of the model make up for what the edge lacks."""
    constrained = _constrained(model)
    if not constrained.any():
        return filling

    position, reach = model.grid.position, float((model.horizons + model.grid.delta).max())
    near = np.isfinite(tree_of(position[constrained.any(axis=1)]).query(position, distance_upper_bound=reach)[0])

    @cache
    def factors() -> NDArray[np.float64]:
        """Factors (n,) of the bonds of free nodes to grips."""
        node_factors = np.ones(len(model.grid))
        for rows in row_chunks(len(node_factors)):
            if near[rows].any():
                free_rows, factor = _factors(filling.part(rows), constrained)
                node_factors[free_rows] = factor
        return node_factors

    def part(rows: NDArray[np.int64]) -> Part:
        plain_part = filling.part(rows)
        ends = _ends(plain_part)
        any_held = np.asarray(constrained.any(axis=1))
        source_gripped, target_gripped = any_held[ends.source], any_held[ends.target]
        factor = np.where(
            target_gripped & ~source_gripped,
            factors()[ends.source],
            np.where(source_gripped & ~target_gripped, factors()[ends.target], 1.0),
        )
        bonds = plain_part.bonds._replace(stiffness=plain_part.bonds.stiffness * factor)
        return plain_part._replace(bonds=bonds)

    return filling._replace(part=part)


def inside_edges(lack: NDArray[np.float64], model: Model, reach: float) -> NDArray[np.float64]:
    """Surface corrections (n, d), those of nodes within `reach`, m, of a corrected edge taken from farther inside."""
    edge = np.asarray(_constrained(model).any(axis=1))
    for condition in model.settings.conditions if is_corrected(model) else ():
        if isinstance(condition, Load) and condition.shares is not None:
            rows = model.selected(condition)
            edge[rows[shares_of(condition, model.grid.ids[rows]) == 1.0]] = True
    if not edge.any():
        return lack
    position = model.grid.position
    ends, others = position[edge], position[~edge]
    far, nearest = tree_of(ends).query(position)
    near = np.flatnonzero(far <= reach * (1 + NOTHING))
    way = position[near] - ends[nearest[near]]
    inwards = others[tree_of(others).query(position[near])[1]] - position[near]
    way = np.where(edge[near, None], inwards, way)
    way /= np.sqrt((way**2).sum(axis=1))[:, None]
    delta = model.grid.delta[near]
    off, deep = tree_of(position).query(position[near] + (reach + delta - far[near])[:, None] * way)
    is_inside = (off <= delta) & (far[deep] > reach)
    corrections = lack.copy()
    corrections[near[is_inside]] = lack[deep[is_inside]]
    return corrections


def _constrained(model: Model) -> NDArray[np.bool_]:
    """Mask (n, d) of the components that a corrected grip holds."""
    constrained = np.zeros((len(model.grid), model.grid.dimension), dtype=np.bool_)
    for condition in model.settings.conditions if is_corrected(model) else ():
        if isinstance(condition, Displacement | Velocity | Acceleration) and condition.corrected:
            rows = model.selected(condition)
            for axis, value in enumerate(components(condition, model.grid.dimension)):
                if value is not None:
                    constrained[rows, axis] = True
    return constrained


def _ends(part: Part) -> _Ends:
    """The bonds of a part by their ends."""
    bonds = part.bonds
    source = bonds.source + part.first
    length = np.sqrt((bonds.xi.astype(np.float64) ** 2).sum(axis=1))
    return _Ends(source, bonds.neighbour.astype(np.int64), bonds.xi / length[:, None], bonds.stiffness, length)


def _factors(part: Part, constrained: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rows (k,) of a part's free nodes with bonds to grips, and the factors (k,) of these bonds."""
    ends, any_held = _ends(part), np.asarray(constrained.any(axis=1))
    to_grip = any_held[ends.target] & ~any_held[ends.source]
    rows = np.unique(ends.source[to_grip])
    near = np.isin(ends.source, rows)
    source, target, unit, k, length = (column[near] for column in ends)
    to_grip, place = to_grip[near], np.searchsorted(rows, source)
    order = np.lexsort((length, ~to_grip, place))
    shortest = order[np.searchsorted(place[order], np.arange(len(rows)))]
    normal, depth = unit[shortest], length[shortest]
    holds = constrained[
        target, np.abs(normal).argmax(axis=1)[place]
    ]  # of a roller, what it leaves free pulls as others do
    across = (unit * normal[place]).sum(axis=1)
    on_edge = across * length > (1 - SAME) * depth[place]
    pull = k * across * (across**2 - NU * (1 - across**2))
    towards, away, grip, edge = (
        np.bincount(place[mask], np.sign(across[mask]) * pull[mask], len(rows))
        for mask in (across > 0, across < 0, holds & (across > 0), ~holds & on_edge)
    )
    lacks = away - towards
    mask = (lacks > NOTHING * away) & (grip > 0)
    factor = np.ones(len(rows))
    factor[mask] = np.minimum(1 + lacks[mask] / (grip[mask] + edge[mask]), MOST)
    return rows, factor
