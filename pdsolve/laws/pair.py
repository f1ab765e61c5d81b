"""Pair laws, whose bonds are independent: their columns, and their bonds' behaviour from the functions in `Pair`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_arrays import INNER, stretch_before
from pdsolve.laws.calls import added_force, bond_strain_energy, broken_energy, dissipated_energy, secant, second_force
from pdsolve.laws.law import Law, Pair, Passes
from pdsolve.model import Model

TINY = 1e-30  # a stretch, a number in both precisions


class PairColumns(NamedTuple):
    """Columns of b bonds; each law has a subclass of its own, by which kernels are compiled for it."""

    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    peak: NDArray[np.floating]  # (b,) stretch above which the bond softens
    limit: NDArray[np.floating]  # (b,) stretch above which it is gone; both infinite where it must not break
    worst: NDArray[np.floating]  # (b,) the largest stretch above the peak, 0 if never there; (0,) if bonds are linear
    broken: NDArray[np.int32]  # (b,) step in which the bond broke, 0 while intact
    pending: NDArray[np.floating]  # (b,) stretch one step before the bond broke, until it has pulled for a second
    # time; 0 of all others, and the least number above 0 in place of a stretch of 0
    matches_work: bool = True  # whether bonds that soften or break in a step add `matching_force` to it


def no_bonds(law: Law) -> PairColumns:
    """Columns without bonds, whose type tells kernels the law."""
    assert issubclass(law.columns_type, PairColumns)
    none = np.zeros(0)
    columns: PairColumns = law.columns_type(none, none, none, none, np.zeros(0, np.int32), none, law.matches_work)
    return columns


def pair_law(kind: type[Any], pair: Pair) -> Law:
    """The law of `pair` with columns of the type `kind`, a `PairColumns`."""
    linear, softens = pair.secant is None, pair.softening is not None

    def columns(model: Model, bonds: Bonds) -> Any:
        """Columns of these bonds (b,)."""
        count, precision = len(bonds.limit), bonds.limit.dtype
        worst = np.zeros(0 if linear else count, precision)
        broken, pending = np.zeros(count, np.int32), np.zeros(count, precision)
        return kind(bonds.stiffness, bonds.peak, bonds.limit, worst, broken, pending)

    straight = _accumulate_one_sided if pair.elastic_in_compression else _accumulate_straight
    curve = _accumulate_curved if pair.is_curved else straight
    return Law(
        columns_type=kind,
        columns=columns,
        passes=Passes(_accumulate_linear if linear else curve),
        energy=_energy_linear if linear else _energy,
        update_bond=_update_softening_bond if softens else _update_elastic_bond,
        bond_history=("worst", "pending") if softens else ("pending",),
        pair=pair,
    )


def _update_elastic_bond(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        _pull_again(law, bond, now, i, j, k, 0.0, f)
    elif bond.stretch > law.limit[k]:
        return _break(law, bond, now, i, j, k, 0.0, f)
    return 0.0


def _update_softening_bond(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        _pull_again(law, bond, now, i, j, k, law.worst[k], f)
    elif bond.stretch > law.limit[k]:
        return _break(law, bond, now, i, j, k, law.worst[k], f)
    elif bond.stretch > law.peak[k] and bond.stretch > law.worst[k]:
        _match_work(law, bond, stretch_before(bond, now, i, j), law.worst[k], k, f)
        law.worst[k] = bond.stretch
    return 0.0


@njit(**INNER)
def _break(law, bond, now, i, j, k, worst, f):  # type: ignore[no-untyped-def]
    """Break bond k, and add the pull that matches its work to f (w,); returns what node i has dissipated, J/m^3."""
    law.broken[k] = now.step
    before, c = stretch_before(bond, now, i, j), law.stiffness[k] * bond.length / 4
    _match_work(law, bond, before, worst, k, f)
    if law.matches_work and before < law.limit[k] and before < bond.stretch:
        law.pending[k] = before if before != 0 else TINY
    return broken_energy(law, c, bond.stretch, before, law.peak[k], law.limit[k])


@njit(**INNER)
def _pull_again(law, bond, now, i, j, k, worst, f):  # type: ignore[no-untyped-def]
    """Add the second pull of bond k, N/m^3, to f (w,), if it broke one step ago."""
    if law.broken[k] == now.step - 1 and law.pending[k] != 0:
        before, first, law.pending[k] = stretch_before(bond, now, i, j), law.pending[k], 0
        _add(law, bond, k, second_force(law, bond.stretch, before, first, worst, law.peak[k], law.limit[k]), f)


@njit(**INNER)
def _match_work(law, bond, before, worst, k, f):  # type: ignore[no-untyped-def]
    """Add the pull of bond k that matches its work, N/m^3, to f (w,)."""
    _add(law, bond, k, added_force(law, bond.stretch, before, worst, law.peak[k], law.limit[k]), f)


@njit(**INNER)
def _add(law, bond, k, over_stiffness, f):  # type: ignore[no-untyped-def]
    """Add a pull of bond k to f (w,), N/m^3."""
    pull = law.stiffness[k] * over_stiffness
    for a in range(len(bond.xi)):
        f[a] += pull * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def _accumulate_linear(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def _accumulate_straight(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        if law.worst[k] > 0:
            force *= secant(law, bond.stretch, law.worst[k], law.peak[k], law.limit[k])
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def _accumulate_one_sided(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        if law.worst[k] > 0 and bond.stretch.real > 0:
            force *= secant(law, bond.stretch, law.worst[k], law.peak[k], law.limit[k])
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def _accumulate_curved(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        force = law.stiffness[k] * bond.stretch
        force *= secant(law, bond.stretch, law.worst[k], law.peak[k], law.limit[k])
        for a in range(len(bond.xi)):
            f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def _energy_linear(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    c = law.stiffness[k] * bond.length / 4
    return bond_strain_energy(law, c, bond.stretch, 0.0, law.peak[k], law.limit[k]), 0.0


def _energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    c, dissipated, worst = law.stiffness[k] * bond.length / 4, 0.0, law.worst[k]
    if worst > 0:
        dissipated = dissipated_energy(law, c, worst, law.peak[k], law.limit[k])
    return bond_strain_energy(law, c, bond.stretch, worst, law.peak[k], law.limit[k]), dissipated
