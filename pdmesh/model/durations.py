"""The number of steps in a duration."""

from __future__ import annotations

import math

import msgspec

from pdmesh.model.document import MOST_STEPS, GridError, Run

SLACK = 1e-9  # of a step: round-off


def counted(run: Run, step: float) -> Run:
    """The run with its duration expressed in steps of `step` s; a run at rest is returned unchanged.

    Raises GridError for too many steps.
    """
    if run.duration is None or run.solver == "static":
        return run
    steps = max(1.0, run.duration / step - SLACK)
    if steps > MOST_STEPS:
        raise GridError(
            f"$.run.duration: found {run.duration:g} s in steps of {step:.3g} s, expected at most {MOST_STEPS:g}"
        )
    return msgspec.structs.replace(run, steps=math.ceil(steps), duration=None)
