"""What rows of 16 nodes know of the law of their bonds, beside stiffnesses, and what follows from that.

A history is None where stiffnesses say it all, or one of the tuples here. Its arrays (., k, 16) have an entry for each
row of nodes with stiffnesses of its own. Functions of lanes are like those of `pdsolve.lattice.rows`; functions of one
bond take the entry, its number in the family and its lane. Symbols as in `pdsolve.laws.law`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER, is_none, overloaded
from pdsolve.codegen.lanes import beside, same, where_above
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import IN_PLACE
from pdsolve.lattice.layout import ONE
from pdsolve.laws.calls import bond_strain_energy, secant
from pdsolve.laws.law import Law
from pdsolve.laws.pair import no_bonds


class Secants(NamedTuple):
    """Of a law whose bonds are straight lines until they soften."""

    law: Any  # columns of no bonds
    secant: NDArray[Any]  # (., k, 16) force over that of a bond that has not softened
    floor: float  # stretch above which a softened bond has its secant: 0, or -inf


class Curves(NamedTuple):
    """Of a law whose bonds are no straight lines."""

    law: Any
    worst: NDArray[Any]  # (., k, 16)
    peak: NDArray[Any]  # (., k, 16), finite where there is no bond
    limit: NDArray[Any]
    usual_peak: NDArray[Any]  # (k,) of rows without an entry, none of whose bonds has softened
    usual_limit: NDArray[Any]


class UsualCurves(NamedTuple):
    """The same of rows without an entry."""

    law: Any
    usual_peak: NDArray[Any]
    usual_limit: NDArray[Any]


History = Secants | Curves | None


def create_history(
    law: Law, usual_peak: NDArray[np.float64], usual_limit: NDArray[np.float64], zeros: Callable[[], NDArray[Any]]
) -> History:
    """The history of bonds under a law, with entries that `zeros` creates; peaks and limits are those of rows without
    an entry."""
    assert law.pair is not None
    if law.pair.is_curved:
        entries = zeros(), zeros(), zeros()
        return Curves(no_bonds(law), *entries, *(usual.astype(entries[0].dtype) for usual in (usual_peak, usual_limit)))
    return Secants(no_bonds(law), zeros(), 0.0 if law.pair.elastic_in_compression else -np.inf)


def with_entries(history: History, replaced: Callable[[NDArray[Any]], NDArray[Any]]) -> History:
    """The history with other entries in place of its own."""
    if isinstance(history, Curves):
        worst, peak, limit = (replaced(entries) for entries in (history.worst, history.peak, history.limit))
        return history._replace(worst=worst, peak=peak, limit=limit)
    return None if history is None else history._replace(secant=replaced(history.secant))


def secants_or_numbers(
    history: History,
    entry: NDArray[np.int64],
    k: NDArray[np.int64],
    lane: NDArray[np.int64],
    is_longer: NDArray[np.bool_],
) -> tuple[NDArray[Any] | float, tuple[NDArray[np.float64], ...] | None]:
    """Secants (b,) of bonds and, of curved ones alone, whose secants are not in them, their peaks, limits and largest
    stretches above peaks (b,)."""
    if history is None:
        return 1.0, None
    of_bonds = entry.clip(0), k, lane
    if isinstance(history, Secants):
        return np.where((entry >= 0) & (is_longer | (history.floor < 0)), history.secant[of_bonds], 1.0), None
    usual = history.usual_peak[k], history.usual_limit[k], np.zeros(len(k))
    own = (entries[of_bonds] for entries in (history.peak, history.limit, history.worst))
    return 1.0, tuple(np.where(entry >= 0, *both).astype(np.float64) for both in zip(own, usual, strict=True))


def softening_entries(history: Secants | Curves) -> NDArray[Any]:
    """What (., k, 16) softening changes."""
    return history.worst if isinstance(history, Curves) else history.secant


def _is_of_type(history: Any, kind: type) -> bool:
    """Whether a numba type is that of a kind of history."""
    return getattr(history, "instance_class", None) is kind


@overloaded(IN_PLACE)
def of_usual_rows(history):  # type: ignore[no-untyped-def]
    """The history of rows without an entry."""
    if _is_of_type(history, Curves):
        return lambda history: UsualCurves(history.law, history.usual_peak, history.usual_limit)
    return lambda history: None


@overloaded(INNER)
def strain_off_straight(history, e):  # type: ignore[no-untyped-def]
    """The e that counts where springs stand for bonds: its size where bonds are curved, stretched or shortened."""
    if _is_of_type(history, Curves):
        return lambda history, e: np.abs(e)
    return lambda history, e: e


@overloaded(IN_PLACE)
def edges_off_straight(history):  # type: ignore[no-untyped-def]
    """The edges of rows of springs that stand for bonds; see `pdsolve.lattice.rows`."""
    if _is_of_type(history, Curves):
        return lambda history: (0.0,)
    return lambda history: None


@overloaded(IN_PLACE)
def secant_weight(history, w, e, g, entry, slot, lane):  # type: ignore[no-untyped-def]
    """The stiffness w of some lanes of a row times their secants at e; g is 1 / (1 + e + sqrt(1 + e))."""
    if is_none(history):
        return lambda history, w, e, g, entry, slot, lane: w
    if _is_of_type(history, Secants):
        return _secant_weight_of_lines
    return _secant_weight_of_curves


def _secant_weight_of_lines(history, w, e, g, entry, slot, lane):  # type: ignore[no-untyped-def]
    return w * _secants_of_lines(history, e, entry, slot, lane)


def _secant_weight_of_curves(history, w, e, g, entry, slot, lane):  # type: ignore[no-untyped-def]
    return w * secant(history.law, e * g * np.sqrt(1.0 + e), *_numbers_of_lanes(history, entry, slot, lane))


@njit(**IN_PLACE)
def _secants_of_lines(history, stretch, entry, slot, lane):  # type: ignore[no-untyped-def]
    """The secants of some lanes at a stretch, or at an e."""
    (left,) = beside(history.secant[np.uint64(entry)], ONE, slot * ROW + lane)
    return where_above(stretch, same(history.secant, history.floor), left, same(history.secant, 1.0))


@overloaded(IN_PLACE)
def _numbers_of_lanes(history, entry, slot, lane):  # type: ignore[no-untyped-def]
    """Largest stretches above their peaks, peaks and limits of some lanes."""
    if _is_of_type(history, UsualCurves):
        return _usual_numbers_of_lanes

    def numbers(history, entry, slot, lane):  # type: ignore[no-untyped-def]
        row, at = np.uint64(entry), slot * ROW + lane
        (worst,) = beside(history.worst[row], ONE, at)
        (peak,) = beside(history.peak[row], ONE, at)
        (limit,) = beside(history.limit[row], ONE, at)
        return worst, peak, limit

    return numbers


def _usual_numbers_of_lanes(history, entry, slot, lane):  # type: ignore[no-untyped-def]
    peak, limit = history.usual_peak, history.usual_limit
    return same(peak, 0.0), same(peak, peak[slot]), same(peak, limit[slot])


@overloaded(IN_PLACE)
def energy_of_lanes(history, w, stretch, entry, slot, lane):  # type: ignore[no-untyped-def]
    """Stored energies of bonds in some lanes of a row, from those at unit stretch, w, if they were linear."""
    if is_none(history):
        return lambda history, w, stretch, entry, slot, lane: w * stretch * stretch
    if _is_of_type(history, Secants):
        return _energy_of_lines

    def of_curves(history, w, stretch, entry, slot, lane):  # type: ignore[no-untyped-def]
        numbers = _numbers_of_lanes(history, entry, slot, lane)
        return bond_strain_energy(history.law, w, stretch, *numbers)

    return of_curves


def _energy_of_lines(history, w, stretch, entry, slot, lane):  # type: ignore[no-untyped-def]
    return w * _secants_of_lines(history, stretch, entry, slot, lane) * stretch * stretch


@overloaded(INNER)
def secant_of_bond(history, stretch, entry, k, lane):  # type: ignore[no-untyped-def]
    """The secant of one bond."""
    if is_none(history):
        return lambda history, stretch, entry, k, lane: 1.0
    if _is_of_type(history, Secants):
        return _secant_of_line

    def of_curve(history, stretch, entry, k, lane):  # type: ignore[no-untyped-def]
        return secant(history.law, stretch, *_numbers_of_bond(history, entry, k, lane))

    return of_curve


def _secant_of_line(history, stretch, entry, k, lane):  # type: ignore[no-untyped-def]
    return history.secant[entry, k, lane] if entry >= 0 and stretch > history.floor else 1.0


@njit(**INNER)
def _numbers_of_bond(history, entry, k, lane):  # type: ignore[no-untyped-def]
    """The largest stretch above the peak, the peak and the limit of one bond."""
    if entry < 0:
        return 0.0, np.float64(history.usual_peak[k]), np.float64(history.usual_limit[k])
    return (
        np.float64(history.worst[entry, k, lane]),
        np.float64(history.peak[entry, k, lane]),
        np.float64(history.limit[entry, k, lane]),
    )


@overloaded(INNER)
def energy_of_bond(history, w, stretch, entry, k, lane):  # type: ignore[no-untyped-def]
    """Stored energy of one bond, from that at unit stretch, w, if it were linear."""
    if is_none(history):
        return lambda history, w, stretch, entry, k, lane: w * stretch * stretch
    if _is_of_type(history, Secants):
        return lambda history, w, stretch, entry, k, lane: (
            w * secant_of_bond(history, stretch, entry, k, lane) * stretch * stretch
        )

    def of_curve(history, w, stretch, entry, k, lane):  # type: ignore[no-untyped-def]
        return bond_strain_energy(history.law, w, stretch, *_numbers_of_bond(history, entry, k, lane))

    return of_curve


@overloaded(INNER)
def begin_bond(history, entry, k, lane, peak, limit):  # type: ignore[no-untyped-def]
    """Let a bond with this peak and limit begin; a limit of 0: there is none."""
    if is_none(history):
        return lambda history, entry, k, lane, peak, limit: None
    if _is_of_type(history, Secants):
        return _begin_line

    def begin_curve(history, entry, k, lane, peak, limit):  # type: ignore[no-untyped-def]
        history.worst[entry, k, lane] = 0.0
        history.peak[entry, k, lane] = peak if limit > 0 else history.usual_peak[k]
        history.limit[entry, k, lane] = limit if limit > 0 else history.usual_limit[k]

    return begin_curve


def _begin_line(history, entry, k, lane, peak, limit):  # type: ignore[no-untyped-def]
    history.secant[entry, k, lane] = 1.0


@overloaded(INNER)
def soften_bond(history, entry, k, lane, worst, peak, limit):  # type: ignore[no-untyped-def]
    """Remember the largest stretch of a bond, above its peak."""
    if is_none(history):
        return lambda history, entry, k, lane, worst, peak, limit: None
    if _is_of_type(history, Secants):
        return _soften_line

    def soften_curve(history, entry, k, lane, worst, peak, limit):  # type: ignore[no-untyped-def]
        history.worst[entry, k, lane] = worst

    return soften_curve


def _soften_line(history, entry, k, lane, worst, peak, limit):  # type: ignore[no-untyped-def]
    history.secant[entry, k, lane] = secant(history.law, worst, worst, peak, limit)


@overloaded(INNER)
def is_usual(history, entry, k, lane):  # type: ignore[no-untyped-def]
    """Whether a bond has the peak and the limit of rows without an entry, and has not softened."""
    if _is_of_type(history, Curves):
        return _has_usual_limits_and_is_whole
    if _is_of_type(history, Secants):
        return lambda history, entry, k, lane: history.secant[entry, k, lane] == 1.0
    return lambda history, entry, k, lane: True


def _has_usual_limits_and_is_whole(history, entry, k, lane):  # type: ignore[no-untyped-def]
    is_same = history.peak[entry, k, lane] == history.usual_peak[k] and history.worst[entry, k, lane] == 0.0
    return is_same and history.limit[entry, k, lane] == history.usual_limit[k]
