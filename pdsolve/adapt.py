"""Clouds whose nodes change while a system marches: some are born, some die, between two steps.

A node whose bonds become others, as those beside one that splits, dies too and is born again under its id: what is
written of a node holds for its whole life.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.operator import Kept
from pdsolve.state import State
from pdsolve.system import Prepared, System


class Change(NamedTuple):
    """Another cloud, and the state it goes on with; m nodes."""

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
