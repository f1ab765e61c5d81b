"""What a run reports of its fine zone, and the error of a zone that comes too late."""

from __future__ import annotations

from typing import NamedTuple

from pdsolve.errors import FineZoneTooLateError


class ZoneSummary(NamedTuple):
    """Summary of the fine zone for a run's report."""

    refinement: float  # J, in the plane J/m: energy that refining has made so far
    fine_share: float  # of the plate or body
    clipped_stretch: float  # the largest of clipped bonds so far, over that which softens or breaks one


def create_too_late_error(step: int, summary: ZoneSummary) -> FineZoneTooLateError:
    """The error of a clipped bond that would soften or break in a step."""
    return FineZoneTooLateError(
        f"step {step}: the fine zone was refined too late (stretch at its border:"
        f" {summary.clipped_stretch:.2f} of critical)",
        step,
    )
