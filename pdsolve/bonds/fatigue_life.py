"""Remaining life of bonds that tire; the laws stand in `pdmesh.model.document`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Fatigue

Array = NDArray[np.float64]

LEFT = 1e-4  # of a bond's life: with no more left it breaks together with those that have none


class Place(NamedTuple):
    """A place in the blocks of the loading."""

    block: int
    done: float  # cycles of it


def shares(law: Fatigue, grows: NDArray[np.bool_]) -> Array:
    """Range of stretch (b,) over the stretch under the largest loads; `grows`: next to damage.

    There, faces of cracks carry what presses them together: loads below 0 add nothing. Elsewhere nothing is closed.
    """
    return np.where(grows, 1 - max(law.ratio, 0.0), 1 - law.ratio)


def wear(law: Fatigue, eps: Array, grows: NDArray[np.bool_]) -> Array:
    """Share of life (b,) that a cycle takes of bonds at these ranges of stretch (b,); `grows`: next to damage."""
    with np.errstate(under="ignore"):
        growth = _line(law.A, law.m, eps, law.threshold)
        if law.A1 is None:
            return np.where(grows, growth, 0.0)
        initiation = _line(law.A1, law.m1, eps, law.endurance)
        return initiation if law.A is None else np.where(grows, growth, initiation)


def _line(A: float | None, m: float | None, eps: Array, least: float) -> Array:
    if A is None or m is None:
        return np.zeros(len(eps))
    return np.where(eps > least, A * eps**m, 0.0)


def jump(
    life: Array, law: Fatigue, eps: Array, grows: NDArray[np.bool_], at: Place, most: float
) -> tuple[float, Place]:
    """Let bonds tire until the first one has no life left, or for `most` cycles; `life` (b,) changes in place.

    Returns the cycles, infinite if no bond tires, and the place in the blocks then. Between breaks the ranges `eps`
    stay as they are, so that this is exact.
    """
    if not law.blocks:
        spent = wear(law, eps, grows)
        cycles = min(_until_first(life, spent), most)
        _tire(life, spent, cycles)
        return cycles, at
    spent = np.array([wear(law, share * eps, grows) for _, share in law.blocks])
    lengths = np.array([length for length, _ in law.blocks])
    once, total = lengths @ spent, 0.0
    if not (once > 0).any():
        return min(np.inf, most), at
    while total < most:
        if at == Place(0, 0.0):
            repeats = np.floor(min(_until_first(life, once), (most - total) / lengths.sum()))
            _tire(life, once, repeats)
            total += repeats * float(lengths.sum())
        remaining_cycles = min(lengths[at.block] - at.done, most - total)
        cycles = min(_until_first(life, spent[at.block]), remaining_cycles)
        _tire(life, spent[at.block], cycles)
        total += cycles
        at = Place(at.block, at.done + cycles)
        if at.done >= lengths[at.block]:
            at = Place((at.block + 1) % len(lengths), 0.0)
        if cycles < remaining_cycles:
            break
    return total, at


def _until_first(life: Array, spent: Array) -> float:
    """Cycles until the first bond with a life (b,) has spent it."""
    tires = (spent > 0) & (life > 0)
    return float((life[tires] / spent[tires]).min(initial=np.inf))


def _tire(life: Array, spent: Array, cycles: float) -> None:
    if np.isfinite(cycles):
        life -= cycles * spent
