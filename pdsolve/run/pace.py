"""How many steps a run takes at once."""

from __future__ import annotations

PIECE, SLOW = 0.25, 1e7  # s that a piece is to take; bonds or links a second, as is supposed until it is measured


class Pace:
    """Measures the duration of steps; results do not depend on it."""

    def __init__(self, updates: int) -> None:
        """`updates` is the number of bond or link updates of a step."""
        self._each = updates / SLOW  # s of a step

    def steps(self, least: int, most: int) -> int:
        """Number of steps to take at once, from `least` to `most`."""
        return max(least, min(most, int(PIECE / max(self._each, 1e-9))))

    def took(self, steps: int, seconds: float) -> None:
        """Record the duration of some steps."""
        self._each = seconds / max(steps, 1)

    def is_soon(self, steps: int) -> bool:
        """Whether so many steps take at most as long as three batches."""
        return steps * self._each < 3 * PIECE
