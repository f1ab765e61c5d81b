"""Validation of checkpoints, which may come from anyone, as checksums are no secret.

Each part that restores a checkpoint requests its arrays here by shape, type and bounds before it uses them. Invalid
content raises a CheckpointError, which names what was found and what was expected. Arrays that several operators write
alike are described at the end: of bonds that broke in the last step and pull once more in the next one, see
`pdsolve.laws.calls.second_force`. Operators keep these where they keep their bonds; here they are by rows of nodes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pdsolve.errors import CheckpointError
from pdsolve.state import Broken

Shape = tuple[int | None, ...]  # None: of any length, at one place at most

MOST_OF_NUMBERS = 1e100  # of any unit: whatever is larger no run has gone through


def entry(
    checkpoint: Mapping[str, NDArray[Any]],
    name: str,
    shape: Shape,
    kind: DTypeLike,
    low: float = -MOST_OF_NUMBERS,
    high: float = MOST_OF_NUMBERS,
) -> NDArray[Any]:
    """The array `name` of a checkpoint in the given shape and type, with all values from `low` to `high`.

    Raises CheckpointError.
    """
    kind, array = np.dtype(kind), checkpoint.get(name)
    if array is None:
        raise CheckpointError(f"'{name}' is missing, which this model has")
    if array.dtype != kind:
        raise CheckpointError(f"'{name}' has type {array.dtype.name}; it must be {kind.name}")
    wanted = int(np.prod([length for length in shape if length is not None]))
    fits = array.size == wanted if None not in shape else not wanted or array.size % wanted == 0
    if not fits or (not wanted and array.size):
        several = "" if None not in shape else "a multiple of "
        raise CheckpointError(f"'{name}' has {array.size} values; it must have {several}{wanted}")
    if kind != np.bool_:
        wrong = ~((array >= np.float64(low)) & (array <= np.float64(high))).ravel()  # of NaN too
        if wrong.any():
            value = array.ravel()[wrong.argmax()]
            raise CheckpointError(f"'{name}' has {value:.6g}; it must be numbers from {low:.6g} to {high:.6g}")
    length = array.size // wanted if wanted else 0
    return array.reshape([length if size is None else size for size in shape])


def like(checkpoint: Mapping[str, NDArray[Any]], name: str, array: NDArray[Any]) -> NDArray[Any]:
    """The array `name` of a checkpoint, with the shape and type of `array`. Raises CheckpointError."""
    return entry(checkpoint, name, array.shape, array.dtype)


def expect_broken(broken: Broken, step: int, nodes: int) -> None:
    """Raise CheckpointError for bonds that break after `step` or at none, between missing nodes, or twice."""
    for values, low, high, what in (
        (broken.step, 1, step, "a bond that breaks in step"),
        (broken.source, 0, nodes - 1, "a broken bond of row"),
        (broken.target, 0, nodes - 1, "a broken bond to row"),
    ):
        wrong = (values < low) | (values > high)
        if wrong.any():
            raise CheckpointError(f"{what} is {values[wrong.argmax()]}; it must be {low} to {high}")
    if len(np.unique(broken.source * nodes + broken.target)) != len(broken.source):
        raise CheckpointError("a bond breaks twice")


def expect_found(present: NDArray[np.bool_], source: NDArray[np.int64], target: NDArray[np.int64]) -> None:
    """Raise CheckpointError unless all bonds (k,) of these rows are `present` (k,)."""
    if not present.all():
        at = int((~present).argmax())
        raise CheckpointError(f"a bond goes from row {source[at]} to row {target[at]}, which the model does not have")


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


def read_pending_pulls(checkpoint: Mapping[str, NDArray[Any]], nodes: int, kind: DTypeLike) -> PendingPulls:
    """PendingPulls among so many nodes from a checkpoint, none in one of an older version. Raises CheckpointError."""
    if checkpoint.keys().isdisjoint(("pending", "pending_source", "pending_target")):
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


def read_pulls(checkpoint: Mapping[str, NDArray[Any]], bonds: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What `pulls_to_arrays` gave, 0 in a checkpoint of an older version. Raises CheckpointError."""
    if checkpoint.keys().isdisjoint(("break_pull", "break_growth")):
        return np.zeros(bonds), np.zeros(bonds)
    return entry(checkpoint, "break_pull", (bonds,), float), entry(checkpoint, "break_growth", (bonds,), float)
