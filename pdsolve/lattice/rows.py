"""Forces on some lanes of a row of 16 consecutive nodes, whose neighbours lie alike: the rows of a moving zone.

u        (d, m) displacements of all places, m
table    (k, .) rows of springs, see `bond`
ways     (k,) places from a node to its neighbours
weights  stiffnesses of the lanes' own: None, those of the table; (., 2, k) uint16, a bit for each lane with a bond and
         for each with half a bond; or (., k, 16), 0 without a bond; those of `entry`; or a tuple of one such (k, 16)
         and bits (., k) uint16 of the lanes whose bond is cut, of which `entry` is one
edges    (., k, 16) e up to which nothing happens to a bond; None: 0; or a tuple: 0, of |e|
history  what the law of bonds that are more than stiffnesses needs; see `pdsolve.lattice.row_histories`
shrink   (m,) minus half the strain of a free node: a bond is relieved of that of both ends; or None
lane, p  the first lane, and its place
s        scratch for the forces: x in the first 16, then y
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from pdsolve.codegen.inner_functions import overloaded
from pdsolve.codegen.lanes import beside, bonded, keep, larger, magnitude, same, uncut, unless_none
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import (
    IN_PLACE,
    any_beyond,
    difference,
    elongation,
    factor_near,
    factor_wide,
    pulled,
    relieved,
    where_weight,
    zeros,
)
from pdsolve.lattice.force_polynomials import NARROW, WIDE
from pdsolve.lattice.layout import ONE
from pdsolve.lattice.row_histories import secant_weight


@overloaded(IN_PLACE)
def own_weight(weights, w, e, entry, slot, lane):  # type: ignore[no-untyped-def]
    """The stiffness of lanes whose table says w, and e, 0 in lanes without a bond."""
    if isinstance(weights, types.NoneType):
        return lambda weights, w, e, entry, slot, lane: (w, e)
    if isinstance(weights, types.BaseTuple):
        return _listed_weight_unless_cut
    return _masked_weight if isinstance(weights.dtype, types.Integer) else _listed_weight


def _masked_weight(weights, w, e, entry, slot, lane):  # type: ignore[no-untyped-def]
    masks = weights[np.uint64(entry)]
    (half,) = bonded((w * 0.5,), masks, 1, slot, lane)
    return bonded((w - half, e), masks, 0, slot, lane)


def _listed_weight(weights, w, e, entry, slot, lane):  # type: ignore[no-untyped-def]
    (own,) = beside(weights[np.uint64(entry)], ONE, slot * ROW + lane)
    return own, unless_none(own, e, own)


def _listed_weight_unless_cut(weights, w, e, entry, slot, lane):  # type: ignore[no-untyped-def]
    listed, cut = weights
    (own,) = beside(listed, ONE, slot * ROW + lane)
    return uncut((own, e), cut, entry, slot, lane)


@overloaded(IN_PLACE)
def beyond_edge(edges, e, entry, slot, lane):  # type: ignore[no-untyped-def]
    """How far e is beyond its edge; e without any, or |e|."""
    if isinstance(edges, types.NoneType):
        return lambda edges, e, entry, slot, lane: e
    if isinstance(edges, types.BaseTuple):
        return lambda edges, e, entry, slot, lane: magnitude(e)
    return lambda edges, e, entry, slot, lane: e - beside(edges[np.uint64(entry)], ONE, slot * ROW + lane)[0]


@overloaded(IN_PLACE)
def shrinkage(shrink, at):  # type: ignore[no-untyped-def]
    """Minus half the strain of free lanes from `at` on; None of None."""
    if isinstance(shrink, types.NoneType):
        return lambda shrink, at: None
    return lambda shrink, at: beside(shrink, ONE, at)[0]


@overloaded(IN_PLACE)
def relieve(eta, near, far, row):  # type: ignore[no-untyped-def]
    """The eta of bonds of this row whose ends shrink by `near` and `far`."""
    if isinstance(near, types.NoneType):
        return lambda eta, near, far, row: eta
    return lambda eta, near, far, row: relieved(eta, far + near, row)


def _make_row_sum(factor: Any, reach: float) -> Any:
    """The sum with the pull w e g(e), g a function valid up to |e| = `reach`.

    It returns 1 where an |e| is beyond, so that the sums are wrong, plus 2 where an e is above `limit`, or above its
    edge by more.
    """

    @njit(**IN_PLACE)
    def add(u, axes, table, ways, weights, edges, history, shrink, entry, lane, p, limit, s):  # type: ignore[no-untyped-def]
        here, near, f = beside(u, axes, p), shrinkage(shrink, p), zeros(u, axes)
        top, size = same(u, -1.0), same(u, 0.0)  # an e is above -1
        for number in range(len(ways)):
            slot = np.uint64(number)  # saves a look whether it counts from the end
            row, at = table[slot], p + ways[slot]
            eta = relieve(difference(beside(u, axes, at), here), near, shrinkage(shrink, at), row)
            w, e = same(u, row[where_weight(len(axes))]), elongation(eta, row)
            w, e = own_weight(weights, w, e, entry, number, lane)
            top, size = larger(beyond_edge(edges, e, entry, number, lane), top), larger(magnitude(e), size)
            g = factor(e)
            f = pulled(f, secant_weight(history, w, e, g, entry, number, lane) * e * g, eta, row)
        for axis in range(len(f)):
            keep((f[axis],), s, axis * ROW)
        far = any_beyond(size, same(u, reach)) if reach < np.inf else False
        return 2 * any_beyond(top, same(u, limit)) + far

    return add


@njit(**IN_PLACE)
def _factor_of_green(e):  # type: ignore[no-untyped-def]
    return 0.5


@njit(**IN_PLACE)
def _factor_by_root(e):  # type: ignore[no-untyped-def]
    q2 = 1.0 + e
    return 1.0 / (q2 + np.sqrt(q2))


sum_narrow, sum_wide = _make_row_sum(factor_near, NARROW), _make_row_sum(factor_wide, WIDE)
sum_by_roots = _make_row_sum(_factor_by_root, np.inf)  # exact at any e
sum_green = _make_row_sum(_factor_of_green, np.inf)  # by Green's strain, force w e / 2 (xi + eta)
