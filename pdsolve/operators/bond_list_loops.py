"""The loops over bonds of `BondList`, row by row, for any law.

One thread sums a row in the order of its neighbours, so that the result does not depend on the number of threads.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import is_none
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.laws.bond_arrays import INLINE, bond_at, deformed, stretch_before
from pdsolve.laws.calls import (
    accumulate,
    accumulate_bond_force,
    bond_force,
    energy,
    fails,
    failure_stretch,
    finish_intermediate_pass,
    finish_pass,
    first_pass,
    initial_sums,
    intermediate_pass,
    may_fail,
    nodal_energy,
    nodal_numbers,
    numbers,
    second_share,
    update_bond,
    update_history,
)
from pdsolve.laws.small_tensors import blank, summed

KERNEL: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


class TornBonds(NamedTuple):
    """Bonds (k,) that failed in a step, in order."""

    bond: NDArray[np.int64]
    source: NDArray[np.int64]  # row of the node whose bond it is
    force: NDArray[np.float64]  # (k, w) that matches its work, N/m^3
    growth: NDArray[np.float64]  # of the stretch in that step


def torn_bonds(bond: NDArray[np.int64], source: NDArray[np.int64], width: int) -> TornBonds:
    """Bonds that fail, before their forces are known."""
    return TornBonds(bond, source, np.zeros((len(bond), width)), np.zeros(len(bond)))


def is_whole(broken: NDArray[np.int32] | None, k: Any) -> bool:
    """Whether bond k is not broken, given the steps in which bonds broke; None: no bond of the law breaks."""
    return broken is None or bool(broken[k] == 0)


@overload(is_whole, jit_options=INLINE)
def _is_whole(broken, k):  # type: ignore[no-untyped-def]
    if is_none(broken):
        return lambda broken, k: True
    return lambda broken, k: broken[k] == 0


@cached_njit(**KERNEL)
def first_pass_rows(bonds, law, now, m, rows, first, last):  # type: ignore[no-untyped-def]
    """Compute some rows of m."""
    for at in range(first, last):
        i = rows[at]
        m[i] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            first_pass(law, deformed(bonds, now.value, i, j, k), now, i, j, k, m)
        finish_pass(law, now, i, m)


@cached_njit(**KERNEL)
def first_pass_rows_of_sums(bonds, law, now, m, rows, first, last):  # type: ignore[no-untyped-def]
    """Compute some rows of m, for a law whose passes are tuples."""
    start, neighbour, value, broken, none = bonds.start, bonds.neighbour, now.value, law.broken, m.dtype.type(0) * 1.0
    like = blank(bonds.xi, none)
    for at in range(first, last):
        row = rows[at]
        i = np.uint64(row)
        sums = initial_sums(law, like, none)
        for place in range(start[i], start[i + 1]):
            k = np.uint64(place)
            if is_whole(broken, k):
                j = np.uint64(neighbour[k])
                sums = accumulate(law, bond_at(bonds, value, i, j, k), numbers(law, i, j, k), sums)
        for a in range(len(sums)):
            m[row, a] = sums[a]
        finish_pass(law, now, row, m)


@cached_njit(**KERNEL)
def finish_pass_rows(bonds, law, now, m, first, last):  # type: ignore[no-untyped-def]
    """Finish rows whose sums are in m."""
    for i in range(first, last):
        finish_pass(law, now, i, m)


@cached_njit(**KERNEL)
def bond_force_rows(bonds, law, now, m, out, first, last):  # type: ignore[no-untyped-def]
    """Add the forces of bonds to the rows of `out`, for a law whose passes are tuples."""
    start, neighbour, value, broken, none = bonds.start, bonds.neighbour, now.value, law.broken, m.dtype.type(0) * 1.0
    like = blank(bonds.xi, none)
    for row in range(first, last):
        i = np.uint64(row)
        f, nodal_i = like, nodal_numbers(law, like, m, i)
        for place in range(start[i], start[i + 1]):
            k = np.uint64(place)
            if broken[k] == 0:
                j = np.uint64(neighbour[k])
                bond, nodal_j = deformed(bonds, value, i, j, k), nodal_numbers(law, like, m, j)
                f = summed(f, bond_force(law, bond, numbers(law, i, j, k), nodal_i, nodal_j))
        for a in range(len(f)):
            out[i, a] += f[a]


@cached_njit(**KERNEL)
def intermediate_pass_rows(bonds, law, now, m, more, first, last):  # type: ignore[no-untyped-def]
    """Compute the rows `first` to `last` - 1 of `more`, given those of m."""
    for i in range(first, last):
        more[i] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            intermediate_pass(law, deformed(bonds, now.value, i, j, k), now, i, j, k, m, more)


@cached_njit(**KERNEL)
def finish_intermediate_pass_rows(bonds, law, now, m, more, first, last):  # type: ignore[no-untyped-def]
    """Finish the rows for the last pass."""
    for i in range(first, last):
        finish_intermediate_pass(law, now, i, m, more)


@cached_njit(**KERNEL)
def update_rows(bonds, law, now, m, out, dissipated, first, last):  # type: ignore[no-untyped-def]
    """Add the forces and the dissipated energy of bonds to the rows of `out` and `dissipated`."""
    f = np.empty(out.shape[1], dtype=out.dtype)
    for i in range(first, last):
        f[:] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            bond = deformed(bonds, now.value, i, j, k)
            dissipated[i] += update_bond(law, bond, now, m, i, j, k, f)
            accumulate_bond_force(law, bond, now, m, i, j, k, f)
        for a in range(len(f)):
            out[i, a] += f[a]


@cached_njit(**KERNEL)
def force_rows(bonds, law, now, m, out, first, last):  # type: ignore[no-untyped-def]
    """Add the forces of bonds without history to the rows of `out`.

    Values may be complex, which gives derivatives without cancellation.
    """
    f = np.empty(out.shape[1], dtype=out.dtype)
    for i in range(first, last):
        f[:] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            accumulate_bond_force(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k, f)
        for a in range(len(f)):
            out[i, a] += f[a]


@cached_njit(**KERNEL)
def energy_rows(bonds, law, now, m, strain_energy, dissipated, rows, first, last):  # type: ignore[no-untyped-def]
    """Compute stored and dissipated energy of some rows of nodes and their bonds."""
    for at in range(first, last):
        i = rows[at]
        strain_energy[i], dissipated[i] = nodal_energy(law, now, i, m)
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            bond_energy = energy(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k)
            strain_energy[i] += bond_energy[0]
            dissipated[i] += bond_energy[1]


@cached_njit(**KERNEL)
def may_fail_rows(bonds, law, now, m, near, first, last):  # type: ignore[no-untyped-def]
    """Mark in `near` the nodes with a bond that may fail."""
    for i in range(first, last):
        if may_fail(law, now, i, m):
            near[i] = True
            for k in range(bonds.start[i], bonds.start[i + 1]):
                near[bonds.neighbour[k]] = True


@cached_njit(**KERNEL)
def fail_rows(bonds, law, now, m, near, failing, torn, first, last):  # type: ignore[no-untyped-def]
    """Mark failing bonds of the nodes `near` in `failing`, and their nodes in `torn`."""
    for i in range(first, last):
        if near[i]:
            for k in range(bonds.start[i], bonds.start[i + 1]):
                j = bonds.neighbour[k]
                if fails(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k):
                    failing[k] = torn[i] = True


@cached_njit(**KERNEL)
def match_rows(bonds, law, now, m, torn, out, dissipated, rows, first, last):  # type: ignore[no-untyped-def]
    """Add to the rows of `out` the forces of failing bonds that match their work, as `calls.added_force`, and set those
    in `torn`; set in `dissipated` which share of the energy that bonds release now they dissipated at their thresholds,
    -1 if one has none.

    They are shares of the forces of now, which grow with the stretch s from s_n to s_(n+1): with the threshold s0 they
    are (s0^2 - s_n s_(n+1)) / (2 s_(n+1) (s_(n+1) - s_n)).
    """
    f = np.empty(out.shape[1], dtype=out.dtype)
    for at in range(first, last):
        i, every, threshold_work = rows[at], 0.0, 0.0
        for n in range(np.searchsorted(torn.bond, bonds.start[i]), np.searchsorted(torn.bond, bonds.start[i + 1])):
            k = torn.bond[n]
            j = bonds.neighbour[k]
            bond = deformed(bonds, now.value, i, j, k)
            before, limit = stretch_before(bond, now, i, j), failure_stretch(law, bond, now, m, i, j, k)
            if before >= limit:
                threshold_work = -np.inf
                continue
            f[:] = 0
            accumulate_bond_force(law, bond, now, m, i, j, k, f)
            share = (limit * limit - bond.stretch * before) / (2 * bond.stretch * (bond.stretch - before))
            along = 0.0
            for a in range(len(bond.xi)):
                along += f[a] * (bond.xi[a] + bond.eta[a]) * bond.stretch
            every, threshold_work = every + along, threshold_work + along * (limit / bond.stretch) ** 2
            torn.growth[n] = bond.stretch - before
            for a in range(len(f)):
                torn.force[n, a] = share * f[a]
                out[i, a] += torn.force[n, a]
        dissipated[i] = threshold_work / every if every > 0 and threshold_work >= 0 else -1.0


@cached_njit(**KERNEL)
def pull_again(bonds, now, torn, out):  # type: ignore[no-untyped-def]
    """Add the second pulls of bonds that failed one step ago to `out` (n, w)."""
    for n in range(len(torn.bond)):
        i, k = torn.source[n], torn.bond[n]
        j = bonds.neighbour[k]
        bond = deformed(bonds, now.value, i, j, k)
        share = second_share(torn.growth[n], bond.stretch - stretch_before(bond, now, i, j))
        for a in range(out.shape[1]):
            out[i, a] += share * torn.force[n, a]


@cached_njit(**KERNEL)
def update_history_rows(bonds, law, now, m, first, last):  # type: ignore[no-untyped-def]
    """Update the history of the nodes `first` to `last` - 1."""
    for i in range(first, last):
        update_history(law, bonds, now, i, m)
