"""Two passes over families in blocks, for laws whose passes are tuples: nodal sums, then bond forces.

Blocks, slots and lanes are those of `kernel`. A bond's numbers besides its reference vector are equal in all lanes of
most slots, a row of `kinds`. A slot at an edge or with a broken bond has a row of `rows`, 0 without a bond. Sums stay
in registers. f_ij consists of sums over both ends and of vectors that only change sign, so that f_ij = -f_ji to the
bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import (
    across,
    beside,
    keep,
    listed,
    repeated,
    same,
    stacked,
    unless_none,
    which_above,
)
from pdsolve.codegen.plane_slots import FAR, VECTOR
from pdsolve.codegen.vector_code import ROW
from pdsolve.laws.bond_arrays import Bond
from pdsolve.laws.calls import accumulate, bond_force, finish_sums, initial_sums, margin
from pdsolve.laws.small_tensors import blank, summed
from pdsolve.operators.simd_lattice.kernel import INNER, LANES

KIND = VECTOR + 1  # of a slot: row of `kinds`, or -1 less a row of `rows`
SAFE = 1e-6  # nearer to its limit than this share, a bond is looked at by itself
COLUMNS, NODAL, OWN, VECTORS = range(4)  # of `likes`: tuples as long as a bond's numbers, nodal numbers, what
# `finish` wants of it, and a vector


class Slots(NamedTuple):
    """Bonds in blocks: s slots, c numbers a bond."""

    start: NDArray[np.int64]  # (blocks + 1,) slots of a block
    slots: NDArray[np.int32]  # (s, 6) ways of the four rows, as in `kernel.Blocks`, row of `vectors`, kind
    ids: NDArray[np.int32]  # (., 16) neighbours
    vectors: NDArray[np.floating]  # (., 8 or 9) xi, 2 xi / |xi|^2, 1 / |xi|^2, |xi|, 1 / |xi|
    kinds: NDArray[np.floating]  # (., c)
    rows: NDArray[np.floating]  # (., c, 64)


@njit(forceinline=True, **INNER)
def _numbers(slots, slot, like, lane):  # type: ignore[no-untyped-def]
    """Numbers of the bonds of some lanes."""
    kind = np.int64(slots.slots[slot, KIND])
    if kind >= 0:
        return repeated(slots.kinds, like, kind)
    return stacked(slots.rows, like, -1 - kind, lane)


@njit(forceinline=True, **INNER)
def _there(slots, slot, array, like, at, lane):  # type: ignore[no-untyped-def]
    """Values of the neighbours of some lanes, the first node of which is `at`, in the first rows of an array."""
    way = np.int64(slots.slots[slot, lane // ROW])
    if way < FAR:
        return beside(array, like, at + way)
    return listed(array, like, slots.ids, (way - FAR) * ROW + lane % ROW)


def _bond(slots: Any, slot: Any, c: Any, u: Any, displacement: Any, at: Any, lane: Any) -> Any:
    """Deformed bonds of some lanes; lanes without a bond are undeformed."""


@overload(_bond, jit_options=INNER | {"forceinline": True})
def _bond_of(slots, slot, c, u, displacement, at, lane):  # type: ignore[no-untyped-def]
    return _bond_in_the_plane if len(displacement) == 2 else _bond_in_space


def _bond_in_the_plane(slots, slot, c, u, displacement, at, lane):  # type: ignore[no-untyped-def]
    v = slots.vectors[slots.slots[slot, VECTOR]]
    neighbour_displacement = _there(slots, slot, u, (0, 0), at, lane)
    x, y = (
        unless_none(c[0], neighbour_displacement[0] - displacement[0], neighbour_displacement[0] * 0.0),
        unless_none(c[0], neighbour_displacement[1] - displacement[1], neighbour_displacement[1] * 0.0),
    )
    e = (v[4] * x + v[2]) * x + (v[4] * y + v[3]) * y
    q = np.sqrt(1.0 + e)
    reach = q + 1.0
    once = 1.0 / (q * reach)
    stretch = e * q * once
    return Bond((v[0], v[1]), (x, y), v[5], q, stretch, v[5] * stretch, v[6] * (reach * once))


def _bond_in_space(slots, slot, c, u, displacement, at, lane):  # type: ignore[no-untyped-def]
    v = slots.vectors[slots.slots[slot, VECTOR]]
    neighbour_displacement, none = _there(slots, slot, u, (0, 0, 0), at, lane), displacement[0] * 0.0
    x, y = (
        unless_none(c[0], neighbour_displacement[0] - displacement[0], none),
        unless_none(c[0], neighbour_displacement[1] - displacement[1], none),
    )
    z = unless_none(c[0], neighbour_displacement[2] - displacement[2], none)
    e = (v[6] * x + v[3]) * x + (v[6] * y + v[4]) * y + (v[6] * z + v[5]) * z
    q = np.sqrt(1.0 + e)
    reach = q + 1.0
    once = 1.0 / (q * reach)
    stretch = e * q * once
    return Bond((v[0], v[1], v[2]), (x, y, z), v[7], q, stretch, v[7] * stretch, v[8] * (reach * once))


@cached_njit(nogil=True, error_model="numpy")
def first_pass_blocks(slots, law, u, constants, m, likes, by_lanes, first, last):  # type: ignore[no-untyped-def]
    """Fill m (w, n) in some blocks with nodal numbers between the passes or, without `by_lanes`, with their sums."""
    none = same(u, 0.0)
    for b in range(first, last):
        for lane in range(0, LANES, across(u)):
            at = b * LANES + lane
            displacement, sums = beside(u, likes[VECTORS], at), initial_sums(law, likes[VECTORS], none)
            for slot in range(slots.start[b], slots.start[b + 1]):
                c = _numbers(slots, slot, likes[COLUMNS], lane)
                sums = accumulate(law, _bond(slots, slot, c, u, displacement, at, lane), c, sums)
            if by_lanes:
                keep(finish_sums(law, sums, beside(constants, likes[OWN], at)), m, at)
            else:
                keep(sums, m, at)


@cached_njit(nogil=True, error_model="numpy")
def exchange_blocks(slots, law, u, m, f, likes, first, last):  # type: ignore[no-untyped-def]
    """Fill f (d, n) in these blocks with force densities, N/m^3."""
    none = same(u, 0.0)
    for b in range(first, last):
        for lane in range(0, LANES, across(u)):
            at = b * LANES + lane
            displacement, nodal = beside(u, likes[VECTORS], at), beside(m, likes[NODAL], at)
            pull = blank(likes[VECTORS], none)
            for slot in range(slots.start[b], slots.start[b + 1]):
                c = _numbers(slots, slot, likes[COLUMNS], lane)
                neighbour_nodal = _there(slots, slot, m, likes[NODAL], at, lane)
                pull = summed(
                    pull, bond_force(law, _bond(slots, slot, c, u, displacement, at, lane), c, nodal, neighbour_nodal)
                )
            keep(pull, f, at)


@cached_njit(nogil=True, error_model="numpy")
def watch_blocks(slots, law, u, m, near, likes, first, last):  # type: ignore[no-untyped-def]
    """Mark in `near` (n,) the nodes of lanes with a bond over its limit, or nearly."""
    for b in range(first, last):
        for lane in range(0, LANES, across(u)):
            at = b * LANES + lane
            displacement, nodal = beside(u, likes[VECTORS], at), beside(m, likes[NODAL], at)
            for slot in range(slots.start[b], slots.start[b + 1]):
                c = _numbers(slots, slot, likes[COLUMNS], lane)
                neighbour_nodal = _there(slots, slot, m, likes[NODAL], at, lane)
                value, limit = margin(law, _bond(slots, slot, c, u, displacement, at, lane), c, nodal, neighbour_nodal)
                if which_above(value, limit * (1.0 - SAFE)) != 0:
                    for k in range(across(u)):
                        near[at + k] = True
                    break
