"""Bonds that broke in the last step and pull once more in the next one: their arrays in checkpoints.

See `pdsolve.laws.calls.second_force`. Operators keep them where they keep their bonds; here they are by rows of nodes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pdsolve.checkpoint_validation import entry, lacks_all
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import Broken


class PendingPulls(NamedTuple):
    """Bonds (k,) that broke in the last step."""

    source: NDArray[np.int64]  # row of the node whose bond it was
    target: NDArray[np.int64]
    stretch: NDArray[Any]  # one step before it broke


def pending_to_arrays(pending: PendingPulls) -> dict[str, NDArray[Any]]:
    """Arrays of a checkpoint; ranks gather them by name, so that they are there without any such bond too."""
    source, target, stretch = (column[np.lexsort((pending.target, pending.source))] for column in pending)
    ends = {"pending_source": source.astype(np.int64), "pending_target": target.astype(np.int64)}
    return {"pending": stretch, **ends}


def read_pending_pulls(checkpoint: CheckpointArrays, nodes: int, kind: DTypeLike) -> PendingPulls:
    """PendingPulls among so many nodes from a checkpoint, none in one of an older version. Raises CheckpointError."""
    if lacks_all(checkpoint, "pending", "pending_source", "pending_target"):
        none = np.zeros(0, dtype=np.int64)
        return PendingPulls(none, none, np.zeros(0, dtype=kind))
    stretch = entry(checkpoint, "pending", (None,), kind)
    source, target = (
        entry(checkpoint, f"pending_{end}", stretch.shape, np.int64, 0, nodes - 1) for end in ("source", "target")
    )
    return PendingPulls(source, target, stretch)


def last_breaks(broken: Broken) -> Broken:
    """The bonds among these that broke in the latest step of all."""
    last = broken.step == broken.step.max(initial=0)
    return Broken(*(column[last] for column in broken))


def pulls_to_arrays(
    step: NDArray[Any], pull: NDArray[np.float64], growth: NDArray[np.float64]
) -> dict[str, NDArray[Any]]:
    """Arrays of a checkpoint: the force with which b bonds broke and the growth of their stretch, 0 before the last
    step."""
    last = step == step.max(initial=0)
    return {"break_pull": np.where(last, pull, 0.0), "break_growth": np.where(last, growth, 0.0)}


def read_pulls(checkpoint: CheckpointArrays, bonds: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What `pulls_to_arrays` gave, 0 in a checkpoint of an older version. Raises CheckpointError."""
    if lacks_all(checkpoint, "break_pull", "break_growth"):
        return np.zeros(bonds), np.zeros(bonds)
    return entry(checkpoint, "break_pull", (bonds,), float), entry(checkpoint, "break_growth", (bonds,), float)
