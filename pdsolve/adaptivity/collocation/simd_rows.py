"""Vector code for the forces of bonds on 16 consecutive fine nodes, held in registers; and bond breaking.

The force of a bond is k e g(e) (xi + eta), as in `pdsolve.lattice.force_polynomials`. Lanes without a bond have zero
stiffness.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.collocation.layout import CUT, EDGE, KNOWN, WHOLE, is_bond_cut, mark_bond_cut
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, intact, keep, larger, same, stacked, unless_none, which_above
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.force_polynomials import coefficients
from pdsolve.lattice.layout import ONE, PLANE

G0, G1, G2, G3, G4, G5, G6, G7, G8, G9, G10 = coefficients("float64")[1]


@njit(forceinline=True, **INNER)
def _lane_stiffness(lattice, cut_bond_bits, u, row_kind, p, row, k, lane, surface_correction):  # type: ignore[no-untyped-def]
    """Stiffness of bond k in the lanes from place p on, 0 without one; `surface_correction` is that of these nodes."""
    if row_kind == KNOWN:
        w = stacked(
            lattice.edge_row_stiffness,
            ONE,
            lattice.edge_row_stiffness_index[row] * len(lattice.neighbour_offsets) + k,
            lane,
        )[0]
    elif row_kind == EDGE:
        w = surface_corrected_stiffness(lattice, p, k, surface_correction)
    else:
        w = same(u, lattice.spring_table[k, 5])
    if row_kind != WHOLE:
        w = w * intact(cut_bond_bits, u, row, k, lane)
    return w


@njit(forceinline=True, **INNER)
def surface_corrected_stiffness(lattice, p, k, surface_correction):  # type: ignore[no-untyped-def]
    """Stiffness of bond k in the lanes from place p on, if it were intact."""
    neighbour = p + lattice.neighbour_offsets[k]
    neighbour_lack = beside(lattice.surface_correction, PLANE, neighbour)
    x, y = (surface_correction[0] + neighbour_lack[0]) * 0.5, (surface_correction[1] + neighbour_lack[1]) * 0.5
    x2, y2 = x * x, y * y
    factor = (
        x
        * y
        / np.sqrt(y2 * lattice.squared_direction_components[k, 0] + x2 * lattice.squared_direction_components[k, 1])
    )
    return lattice.spring_table[k, 5] * (factor * beside(lattice.cell_area_share, ONE, neighbour)[0])


@njit(forceinline=True, **INNER)
def _force_factor_polynomial(double_green_strain):  # type: ignore[no-untyped-def]
    """g(e) for |e| up to WIDE."""
    narrow = (
        ((G5 * double_green_strain + G4) * double_green_strain + G3) * double_green_strain + G2
    ) * double_green_strain + G1
    wide = (
        ((G10 * double_green_strain + G9) * double_green_strain + G8) * double_green_strain + G7
    ) * double_green_strain + G6
    e2 = double_green_strain * double_green_strain
    return (wide * (e2 * e2 * double_green_strain) + narrow) * double_green_strain + G0


@njit(forceinline=True, **INNER)
def _relative_displacement_and_double_green_strain(lattice, u, displacement, p, k):  # type: ignore[no-untyped-def]
    """eta and e of bond k in the lanes from place p on; `displacement` are the displacements there."""
    neighbour_displacement = beside(u, PLANE, p + lattice.neighbour_offsets[k])
    x, y = neighbour_displacement[0] - displacement[0], neighbour_displacement[1] - displacement[1]
    inverse = lattice.spring_table[k, 4]
    return x, y, (x * inverse + lattice.spring_table[k, 2]) * x + (y * inverse + lattice.spring_table[k, 3]) * y


@njit(**INNER)
def store_row_forces(lattice, cut_bond_bits, row_kind, e_bounds, u, f, row):  # type: ignore[no-untyped-def]
    """Force densities (2, places), N/m^3, on the nodes of a row; returns a bit for each node with a bond over its
    limit, and exactness.

    `e_bounds` (2, places) are the e beyond which a bond breaks and the e^2 beyond which the polynomial is not exact.
    """
    over, wide, none = 0, 0, same(u, 0.0)
    for lane in range(0, ROW, across(u)):
        p = row * ROW + lane
        displacement, surface_correction, fx, fy = (
            beside(u, PLANE, p),
            beside(lattice.surface_correction, PLANE, p),
            none,
            none,
        )
        most, widest = none, none
        for k in range(len(lattice.neighbour_offsets)):
            x, y, e = _relative_displacement_and_double_green_strain(lattice, u, displacement, p, k)
            w = _lane_stiffness(lattice, cut_bond_bits, u, row_kind, p, row, k, lane, surface_correction)
            if row_kind != WHOLE:
                e = unless_none(w, e, none)
            most, widest = larger(e, most), larger(e * e, widest)
            pull = w * (e * _force_factor_polynomial(e))
            fx, fy = fx + pull * (x + lattice.spring_table[k, 0]), fy + pull * (y + lattice.spring_table[k, 1])
        keep((fx, fy), f, p)
        bound = beside(e_bounds, PLANE, p)
        over |= which_above(most, bound[0]) << lane
        wide |= which_above(widest, bound[1])
    return over, wide == 0


@njit(**INNER)
def store_row_forces_by_square_roots(lattice, cut_bond_bits, row_kind, u, f, row):  # type: ignore[no-untyped-def]
    """Force densities (2, places), N/m^3, on the nodes of a row by square roots, exact for any stretch."""
    none = same(u, 0.0)
    for lane in range(0, ROW, across(u)):
        p = row * ROW + lane
        displacement, surface_correction, fx, fy = (
            beside(u, PLANE, p),
            beside(lattice.surface_correction, PLANE, p),
            none,
            none,
        )
        for k in range(len(lattice.neighbour_offsets)):
            x, y, e = _relative_displacement_and_double_green_strain(lattice, u, displacement, p, k)
            w = _lane_stiffness(lattice, cut_bond_bits, u, row_kind, p, row, k, lane, surface_correction)
            e = unless_none(w, e, none)
            q2 = e + 1.0
            pull = w * (e / (q2 + np.sqrt(q2)))
            fx, fy = fx + pull * (x + lattice.spring_table[k, 0]), fy + pull * (y + lattice.spring_table[k, 1])
        keep((fx, fy), f, p)


@njit(**INNER)
def store_row_energy_densities(lattice, cut_bond_bits, row_kind, u, densities, row):  # type: ignore[no-untyped-def]
    """Energy densities (1, places), J/m^3, of the nodes of a row: half of each bond's."""
    none = same(u, 0.0)
    for lane in range(0, ROW, across(u)):
        p = row * ROW + lane
        displacement, surface_correction, energy = (
            beside(u, PLANE, p),
            beside(lattice.surface_correction, PLANE, p),
            none,
        )
        for k in range(len(lattice.neighbour_offsets)):
            _, _, e = _relative_displacement_and_double_green_strain(lattice, u, displacement, p, k)
            w = _lane_stiffness(lattice, cut_bond_bits, u, row_kind, p, row, k, lane, surface_correction)
            e = unless_none(w, e, none)
            stretch = e / (np.sqrt(e + 1.0) + 1.0)
            energy = energy + w * (stretch * stretch) * (0.25 / lattice.spring_table[k, 4])
        keep((energy,), densities, p)


@njit(**INNER)
def bond_stiffness_over_own_cell_share(lattice, p, k):  # type: ignore[no-untyped-def]
    """Stiffness of bond k of node p with surface correction, over the share of p's cell inside the plate."""
    j = p + lattice.neighbour_offsets[k]
    x, y = (
        (lattice.surface_correction[0, p] + lattice.surface_correction[0, j]) / 2,
        (lattice.surface_correction[1, p] + lattice.surface_correction[1, j]) / 2,
    )
    factor = (
        x
        * y
        / np.sqrt(
            y * y * lattice.squared_direction_components[k, 0] + x * x * lattice.squared_direction_components[k, 1]
        )
    )
    return lattice.spring_table[k, 5] * factor * lattice.cell_area_share[0, j]


@njit(**INNER)
def double_green_strain_of_bond(lattice, u, p, k):  # type: ignore[no-untyped-def]
    """e of bond k of node p."""
    j = p + lattice.neighbour_offsets[k]
    x, y = u[0, j] - u[0, p], u[1, j] - u[1, p]
    inverse = lattice.spring_table[k, 4]
    return (x * inverse + lattice.spring_table[k, 2]) * x + (y * inverse + lattice.spring_table[k, 3]) * y


@njit(**INNER)
def double_green_strain_one_step_ago(lattice, u, v, dt, p, k):  # type: ignore[no-untyped-def]
    """e of bond k of node p one time step of `dt` ago."""
    j = p + lattice.neighbour_offsets[k]
    x, y = u[0, j] - dt * v[0, j] - (u[0, p] - dt * v[0, p]), u[1, j] - dt * v[1, j] - (u[1, p] - dt * v[1, p])
    inverse = lattice.spring_table[k, 4]
    return (x * inverse + lattice.spring_table[k, 2]) * x + (y * inverse + lattice.spring_table[k, 3]) * y


@njit(**INNER)
def break_bond(lattice, zone, p, k):  # type: ignore[no-untyped-def]
    """Break bond k of node p at both of its ends."""
    half = len(lattice.neighbour_offsets) // 2
    mark_bond_cut(zone.cut_bond_bits, p, k)
    j = p + lattice.neighbour_offsets[k]
    mark_bond_cut(zone.cut_bond_bits, j, k + half if k < half else k - half)
    for row in (p // ROW, j // ROW):
        if zone.simd_row_kinds[row] == WHOLE:
            zone.simd_row_kinds[row] = CUT


@njit(**INNER)
def is_bond_over_limit(lattice, zone, u, p, k):  # type: ignore[no-untyped-def]
    """Whether bond k of node p is to break."""
    if not double_green_strain_of_bond(lattice, u, p, k) > lattice.limit_double_green_strain:
        return False  # as nearly all
    j = p + lattice.neighbour_offsets[k]
    return not (
        lattice.cell_area_share[0, j] == 0
        or is_bond_cut(zone.cut_bond_bits, p, k)
        or lattice.no_fail[p]
        or lattice.no_fail[j]
    )


@cached_njit(error_model="numpy")
def largest_stiffness_bound(lattice, cut_bond_bits, places):  # type: ignore[no-untyped-def]
    """The largest row sum of stiffness of these nodes, N/m^4 (see `pdsolve.bonds.assembly.stiffness_bound`)."""
    most = 0.0
    for p in places:
        xx, yy, xy = 0.0, 0.0, 0.0
        for k in range(len(lattice.neighbour_offsets)):
            if lattice.cell_area_share[0, p + lattice.neighbour_offsets[k]] == 0 or is_bond_cut(cut_bond_bits, p, k):
                continue
            pull = bond_stiffness_over_own_cell_share(lattice, p, k) * lattice.spring_table[k, 4]
            x, y = lattice.spring_table[k, 0], lattice.spring_table[k, 1]
            xx, yy, xy = xx + pull * x * x, yy + pull * y * y, xy + pull * x * y
        most = max(most, (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    return most
