"""How many steps a run takes at once, and what is due between them."""

from __future__ import annotations

from pdsolve.run.node_changes import NodeAdaptation, find_zone_change_since_last_call
from pdsolve.run.recorder import Recorder

BATCH_TIME, SLOW = 0.25, 1e7  # s that a batch is to take; bonds or links a second, as is supposed until it is measured
# Steps that a batch has at least, as what begins one costs a part of a step, where it takes no longer than so many s
LEAST_STEPS, LONGEST_BATCH = 4, 1.0


class StepBatchTimer:
    """Measures the duration of steps; results do not depend on it."""

    def __init__(self, updates_per_step: int) -> None:
        """`updates_per_step` is the number of bond or link updates of a step."""
        self._each = updates_per_step / SLOW  # s of a step

    def choose_batch_step_count(self, min_steps: int, max_steps: int) -> int:
        """Number of steps to take at once, from `min_steps` to `max_steps`."""
        each = max(self._each, 1e-9)
        return max(min_steps, min(max_steps, max(int(BATCH_TIME / each), min(LEAST_STEPS, int(LONGEST_BATCH / each)))))

    def record_duration(self, step_count: int, seconds: float) -> None:
        """Record the duration of some steps."""
        self._each = seconds / max(step_count, 1)

    def will_finish_soon(self, step_count: int) -> bool:
        """Whether so many steps take less than three times `BATCH_TIME`."""
        return step_count * self._each < 3 * BATCH_TIME


def change_nodes_if_due_and_find_next_step(recorder: Recorder, adaptation: NodeAdaptation, step: int) -> int:
    """Let nodes change that are due after `step`; returns the step of the next look."""
    change = (
        adaptation.change_nodes(recorder.system, recorder.state, step)
        if step % adaptation.steps_between_checks == 0
        else None
    )
    if change is not None:
        recorder.record_node_change(step, change)
    return next_multiple(step, adaptation.steps_between_checks)


def grow_cracks_if_due_and_find_next_step(recorder: Recorder, step: int, last_step: int) -> int:
    """Let cracks due after `step` grow; returns the step of the next check, `last_step` without growing cracks."""
    system = recorder.system
    if system.crack_growth is None or system.crack_growth.every is None:
        return last_step
    if step % system.crack_growth.every == 0:
        system.crack_growth.look(recorder.state, step + 1)
    return next_multiple(step, system.crack_growth.every)


def record_zone_motion(recorder: Recorder, since_step: int) -> None:
    """Record the motion of a fine zone since the step `since_step`."""
    change = (
        find_zone_change_since_last_call(recorder.system, with_state=False)
        if recorder.system.moving_zone_operator is not None
        else None
    )
    if change is not None:
        recorder.record_node_change(since_step, change)


def next_multiple(step: int, interval: int) -> int:
    """The next step that is a multiple of an interval."""
    return (step // interval + 1) * interval
