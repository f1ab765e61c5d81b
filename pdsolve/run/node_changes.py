"""Changes of nodes during a run: some are born and some die between two steps.

A node whose bonds change, such as one beside a splitting cell, dies too and is born again under the same id: what is
stored about a node holds for its whole life.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.protocol import Kept
from pdsolve.run.system import Prepared, System, moved
from pdsolve.state import State, zero_state


class Change(NamedTuple):
    """The system of another set of m nodes, and its state."""

    system: System  # of the same settings and the same step; its loads are those of now
    state: State
    origin: NDArray[np.int64]  # (m,) row of each node in the cloud before, -1 of those that are born


class Adapt(Protocol):
    """Decides when and how nodes change, from the state alone, so that a resumed run equals an uninterrupted one."""

    every: int  # steps between two looks

    def epoch(self, system: System, state: State, step: int) -> Change | None:
        """The nodes after `step`, a multiple of `every`; None if they stay."""

    def back(self, system: System, checkpoint: Kept) -> Prepared:
        """The system of a checkpoint with the nodes `checkpoint["ids"]`, in that order.

        `system` is that of the start. The caller restores state, loads and broken bonds.
        """


def zone_moved(system: System, state: bool = True) -> Change | None:
    """The nodes of a moving fine zone if they have changed since the last call; else None.

    Without `state`, that of the change is of no nodes.
    """
    assert system.hybrid is not None
    before, shown = system.hybrid, system.hybrid.changed()
    if shown is None:
        return None
    row = np.minimum(np.searchsorted(before.places, shown.places), len(before.places) - 1)
    same = (before.places[row] == shown.places) & (before.signature[row] == shown.signature)
    return Change(moved(system, shown), shown.state() if state else zero_state(0, 2), np.where(same, row, -1))


def zone_back(system: System, checkpoint: Kept) -> Prepared:
    """The system of a checkpoint, for a run that began as `system`."""
    assert system.hybrid is not None
    system.hybrid.back(checkpoint, system.hybrid.broken())
    change = zone_moved(system)
    return Prepared(system, system.hybrid.state()) if change is None else Prepared(change.system, change.state)
