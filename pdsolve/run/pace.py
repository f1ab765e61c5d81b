"""How many steps a run takes at once, and what is due between them."""

from __future__ import annotations

from pdsolve.run.node_changes import Adapt, zone_moved
from pdsolve.run.recorder import Recorder

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


def adapted(notes: Recorder, adapt: Adapt, step: int) -> int:
    """Let nodes change that are due after `step`; returns the step of the next look."""
    change = adapt.epoch(notes.system, notes.state, step) if step % adapt.every == 0 else None
    if change is not None:
        notes.follow(step, change)
    return next_multiple(step, adapt.every)


def grown(notes: Recorder, step: int, last: int) -> int:
    """Let cracks due after `step` grow; returns the step of the next check, `last` without growing cracks."""
    system = notes.system
    if system.growth is None or system.growth.every is None:
        return last
    if step % system.growth.every == 0:
        system.growth.look(notes.state, step + 1)
    return next_multiple(step, system.growth.every)


def follow_zone(notes: Recorder, before: int) -> None:
    """Record the motion of a fine zone since the step `before`."""
    change = zone_moved(notes.system, state=False) if notes.system.hybrid is not None else None
    if change is not None:
        notes.follow(before, change)


def next_multiple(step: int, interval: int) -> int:
    """The next step that is a multiple of an interval."""
    return (step // interval + 1) * interval
