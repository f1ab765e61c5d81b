"""How many steps a run takes at once, and what is due between them."""

from __future__ import annotations

from pdsolve.run.node_changes import NodeAdaptation, find_zone_change
from pdsolve.run.recorder import Recorder

PIECE, SLOW = 0.25, 1e7  # s that a piece is to take; bonds or links a second, as is supposed until it is measured


class Pace:
    """Measures the duration of steps; results do not depend on it."""

    def __init__(self, updates_per_step: int) -> None:
        """`updates_per_step` is the number of bond or link updates of a step."""
        self._each = updates_per_step / SLOW  # s of a step

    def choose_step_count(self, least: int, most: int) -> int:
        """Number of steps to take at once, from `least` to `most`."""
        return max(least, min(most, int(PIECE / max(self._each, 1e-9))))

    def record_duration(self, steps: int, seconds: float) -> None:
        """Record the duration of some steps."""
        self._each = seconds / max(steps, 1)

    def will_soon_be_done(self, steps: int) -> bool:
        """Whether so many steps take at most as long as three batches."""
        return steps * self._each < 3 * PIECE


def change_nodes_if_due(recorder: Recorder, adaptation: NodeAdaptation, step: int) -> int:
    """Let nodes change that are due after `step`; returns the step of the next look."""
    change = adaptation.change_nodes(recorder.system, recorder.state, step) if step % adaptation.every == 0 else None
    if change is not None:
        recorder.record_node_change(step, change)
    return next_multiple(step, adaptation.every)


def grow_cracks_if_due(recorder: Recorder, step: int, last: int) -> int:
    """Let cracks due after `step` grow; returns the step of the next check, `last` without growing cracks."""
    system = recorder.system
    if system.growth is None or system.growth.every is None:
        return last
    if step % system.growth.every == 0:
        system.growth.look(recorder.state, step + 1)
    return next_multiple(step, system.growth.every)


def record_zone_motion(recorder: Recorder, previous_step: int) -> None:
    """Record the motion of a fine zone since the step `previous_step`."""
    change = find_zone_change(recorder.system, with_state=False) if recorder.system.hybrid is not None else None
    if change is not None:
        recorder.record_node_change(previous_step, change)


def next_multiple(step: int, interval: int) -> int:
    """The next step that is a multiple of an interval."""
    return (step // interval + 1) * interval
