"""The forces of clipped bonds: eight pieces with the same near end at a time.

u, force    (q, 4) displacements of points, m, and forces on them, N; the last column of u is minus half the strain of
            free points, if pieces swell
xi          (g, 4) xi from the near end to the far one, m, and 1 / |xi|^2
far, row    (p,) points at the far ends of pieces, and their rows of xi
k, breaks   (p,) stiffness, N/m, and the least e at which bonds soften or break over that of the piece's
top         (8,) the largest of e times `limit_ratio` so far
at, near    the first of the eight, and the point at their near end
swelling    None, or an array: pieces swell
"""

from __future__ import annotations

from numba import njit

from pdsolve.codegen.inner_functions import is_none, overloaded
from pdsolve.codegen.lanes import keep, larger, magnitude, same
from pdsolve.codegen.rows_of_four import columns_of_rows, eight_beside, move_between_rows, row_in_lanes
from pdsolve.lattice.bond import (
    IN_PLACE,
    any_beyond,
    difference,
    elongation,
    factor,
    factor_near,
    pulled,
    relieved,
    zeros,
)
from pdsolve.lattice.force_polynomials import NARROW


@njit(**IN_PLACE)
def add_forces_of_eight_bond_pieces(u, force, xi, far, rows, k, limit_ratio, top, at, near, swelling):  # type: ignore[no-untyped-def]
    """Add the forces of eight pieces on their ends."""
    x, y, z, inverse = columns_of_rows(xi, rows, at)
    double = 2.0 * inverse
    row = x, y, z, double * x, double * y, double * z, inverse
    far_u, near_u = columns_of_rows(u, far, at), row_in_lanes(u, near)
    eta = _relieve(swelling, difference(far_u[:3], near_u[:3]), far_u[3], near_u[3], row)
    e = elongation(eta, row)
    keep((larger(eight_beside(limit_ratio, at) * e, eight_beside(top, 0)),), top, 0)
    g, size, narrow = factor_near(e), magnitude(e), same(e, NARROW)
    if any_beyond(size, narrow):
        g = factor(e, e, size, narrow, g)
    pull = pulled(zeros(e, eta), eight_beside(k, at) * (e * g), eta, row)
    move_between_rows(pull, force, far, at, near)


@overloaded(IN_PLACE)
def _relieve(swelling, eta, far, near, row):  # type: ignore[no-untyped-def]
    """The eta of pieces whose ends shrink by `far` and `near`."""
    if is_none(swelling):
        return lambda swelling, eta, far, near, row: eta
    return lambda swelling, eta, far, near, row: relieved(eta, far + near, row)
