"""Clouds whose nodes change while a system marches: some are born, some die, between two steps.

A node whose bonds become others, as those beside one that splits, dies too and is born again under its id: what is
written of a node holds for its whole life.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Kept
from pdsolve.run.system import Prepared, System, moved
from pdsolve.state import State


class Change(NamedTuple):
    """The system of another cloud of m nodes, and the state it goes on with."""

    system: System  # of the same settings and the same step; its loads are those of now
    state: State
    origin: NDArray[np.int64]  # (m,) row of each node in the cloud before, -1 of those that are born


class Adapt(Protocol):
    """Says when nodes change, and into what; from the state alone, so that a resumed run does as one left alone."""

    every: int  # steps between two looks

    def epoch(self, system: System, state: State, step: int) -> Change | None:
        """What the nodes become after `step`, a multiple of `every`; None: they stay."""

    def back(self, system: System, kept: Kept) -> Prepared:
        """The system of the cloud of a checkpoint, whose nodes have the ids `kept["ids"]`, in that order.

        `system` is that of the start. The caller puts back state, loads, and what has broken.
        """


def zone_moved(system: System) -> Change | None:
    """What the nodes of a fine zone have become since they were last looked at; None: they are the same."""
    assert system.hybrid is not None
    before, shown = system.hybrid, system.hybrid.changed()
    if shown is None:
        return None
    row = np.minimum(np.searchsorted(before.places, shown.places), len(before.places) - 1)
    same = (before.places[row] == shown.places) & (before.signature[row] == shown.signature)
    return Change(moved(system, shown), shown.state(), np.where(same, row, -1))


def zone_back(system: System, kept: Kept) -> Prepared:
    """The system of a checkpoint, of a run that began as `system`."""
    assert system.hybrid is not None
    system.hybrid.back(kept, system.hybrid.broken())
    change = zone_moved(system)
    return Prepared(system, system.hybrid.state()) if change is None else Prepared(change.system, change.state)
