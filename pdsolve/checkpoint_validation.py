"""Validation of checkpoints, which may come from anyone, as checksums are no secret.

Each part that restores a checkpoint requests its arrays here by shape, type and bounds before it uses them. Invalid
content raises a CheckpointError, which names what was found and what was expected.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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


def lacks_all(checkpoint: Mapping[str, NDArray[Any]], *names: str) -> bool:
    """Whether a checkpoint has none of these arrays, which are written together or not at all."""
    return checkpoint.keys().isdisjoint(names)


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
