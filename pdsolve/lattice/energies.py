"""Energies of the bonds of lattices under a pair law, on the loop of their forces, for blocks and tiles."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import across, beside, keep, magnitude, same, unless_none, where_above
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.blocks import dissipated_in_slot
from pdsolve.lattice.bond import IN_PLACE, any_beyond, stretched, where_inverse
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import has_bonds, in_tiles, is_in_tiles, pair_law_of, places_of, slot_at, turns_of
from pdsolve.lattice.sums import common_of_lanes, history_of_lanes, own_shrinkage, secant_weight, weigh_and_stretch
from pdsolve.lattice.tiles import dissipated_in_tile
from pdsolve.laws.calls import bond_strain_energy


@cached_njit(nogil=True, error_model="numpy")
def sum_energies(bonds, history, u, strain_energy, dissipated, first, last, mask):  # type: ignore[no-untyped-def]
    """Add the energy densities, J/m^3, that the bonds of the groups `first` to `last` - 1 store and that their
    softening has dissipated, to arrays of nodes, in blocks of places.

    With a `mask` of all lanes of tiles, those of its lanes alone; None: of all, as in blocks.
    """
    s = np.empty((1, ROW), u.dtype)
    for group in range(first, last):
        lanes = places_of(bonds, group)[1]
        for lane in range(0, lanes, across(u)):
            if has_lanes(mask, group * lanes + lane, across(u)):
                keep((_sum_lanes(bonds, history, u, group, lane),), s, 0)
                for k in range(across(u)):
                    node = node_of(bonds, group * lanes + lane + k)
                    if node >= 0 and has_lanes(mask, group * lanes + lane + k, 1):
                        strain_energy[node] += s[0, k]
        sum_dissipated(bonds, history, dissipated, group, mask)


@njit(**IN_PLACE)
def _sum_lanes(bonds, history, u, group, lane):  # type: ignore[no-untyped-def]
    """Energy densities that the bonds of some lanes of a group store, J/m^3."""
    own = places_of(bonds, group)[0] + lane
    here, relief = beside(u, bonds.axes, own), own_shrinkage(bonds, history, own)
    common = common_of_lanes(bonds, group, own)
    (begin, end), energy = turns_of(bonds, group, lane), same(u, 0.0)
    for turn in range(begin, end):
        slot = slot_at(bonds, turn)
        if has_bonds(bonds, group, slot):
            row, w, _, e = weigh_and_stretch(bonds, history, u, common, here, relief, group, own, slot, lane)
            e = unless_none(w, e, w)  # in blocks, lanes without a bond have any
            quarter = same(u, 0.25 / row[where_inverse(len(here))])
            energy = energy + stored(bonds, history, common, w, quarter, e, slot, lane)
    return energy


@njit(**IN_PLACE)
def _stretch(bonds, e):  # type: ignore[no-untyped-def]
    """Stretches of lanes at e, by a polynomial where they are small."""
    (stretch, _), size, near = stretched(e), magnitude(e), same(bonds.vectors, NARROW)
    if any_beyond(size, near):  # lane by lane, so that a sum does not depend on the lanes beside it
        stretch = where_above(size, near, e / (np.sqrt(1.0 + e) + 1.0), stretch)
    return stretch


@overloaded(IN_PLACE)
def stored(bonds, history, common, w, quarter, e, slot, lane):  # type: ignore[no-untyped-def]
    """Stored energies of the bonds of some lanes, J/m^3; w is what `weight` gives of them, `quarter` |xi|^2 / 4."""
    return _stored_by_curve if pair_law_of(bonds).is_curved else _stored_by_line


def _stored_by_curve(bonds, history, common, w, quarter, e, slot, lane):  # type: ignore[no-untyped-def]
    of_lanes = history_of_lanes(bonds, history, common, slot, lane)
    return bond_strain_energy(bonds.law, w * quarter, _stretch(bonds, e), *of_lanes)


def _stored_by_line(bonds, history, common, w, quarter, e, slot, lane):  # type: ignore[no-untyped-def]
    stretch = _stretch(bonds, e)
    return secant_weight(bonds, history, common, w, e, e, slot, lane) * quarter * stretch * stretch


@overloaded(INNER)
def has_lanes(mask, first, count):  # type: ignore[no-untyped-def]
    """Whether a mask has any of so many lanes from `first` on; without a mask, None, all are asked for."""
    if is_none(mask):
        return lambda mask, first, count: True

    return lambda mask, first, count: mask[first : first + count].any()


@in_tiles(lambda bonds, number: np.int64(bonds.node[number]))
def node_of(bonds, number):  # type: ignore[no-untyped-def]
    """Where a lane's energy goes, the `number` of which counts those of all groups: in blocks its place, in tiles the
    row of its node, or -1 without one."""
    return number


@overloaded(INNER)
def sum_dissipated(bonds, history, dissipated, group, mask):  # type: ignore[no-untyped-def]
    """Add what softening has dissipated in the intact bonds of a group, J/m^3, bond by bond."""
    if pair_law_of(bonds).softening is None:
        return lambda bonds, history, dissipated, group, mask: None
    if is_in_tiles(bonds):
        return _in_tile
    return _in_block if is_none(mask) else None


def _in_tile(bonds, history, dissipated, group, mask):  # type: ignore[no-untyped-def]
    for lane in range(ROW if bonds.memory[group] >= 0 else 0):
        if has_lanes(mask, group * ROW + lane, 1):
            for slot in range(len(bonds.offsets)):
                dissipated_in_tile(bonds, group, slot, lane, dissipated)


def _in_block(bonds, history, dissipated, group, mask):  # type: ignore[no-untyped-def]
    if bonds.softened[group]:
        for slot in range(bonds.start[group], bonds.start[group + 1]):
            dissipated_in_slot(bonds, history.worst, group, slot, dissipated)
