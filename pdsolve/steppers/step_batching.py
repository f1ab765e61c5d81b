"""How many steps to take at once, so that somebody who wants the run to stop is soon heard."""

from __future__ import annotations

PIECE = 0.25  # s that a piece is to take
SLOW = 1e7  # updates a second, of bonds or links: as is supposed until it is measured


class Pace:
    """Measures how long steps take, as they are taken; what they come to does not depend on it."""

    def __init__(self, updates: int) -> None:
        """`updates` are those of a step, of bonds or links."""
        self._each = updates / SLOW  # s of a step

    def steps(self, least: int, most: int) -> int:
        """How many to take at once, at least and at most."""
        return max(least, min(most, int(PIECE / max(self._each, 1e-9))))

    def took(self, steps: int, seconds: float) -> None:
        """Note how long so many steps have taken."""
        self._each = seconds / max(steps, 1)

    def is_soon(self, steps: int) -> bool:
        """Whether so many more take no longer than three pieces."""
        return steps * self._each < 3 * PIECE
