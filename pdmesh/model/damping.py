"""Remarks on energy that damping takes from the motion."""

from __future__ import annotations

from collections.abc import Sequence

from pdmesh.model.document import Absorb, AnyCondition, Contact, Run

MUCH = 0.02  # of what was put in


def damping_warning(
    run: Run, conditions: Sequence[AnyCondition], contact: Contact | None, damped: float, put_in: float
) -> str | None:
    """A remark on the energy `damped`, of all that was `put_in`, if its share is large; else None."""
    if not damped > MUCH * put_in:
        return None
    causes = {
        "run.damping": run.damping > 0,
        "layers that absorb": any(isinstance(condition, Absorb) for condition in conditions),
        "the damped seam of collocation": run.adapt == "collocation",
        "friction": contact is not None and contact.friction > 0,
        "coming to rest after bonds broke": run.solver == "static",
    }
    by = ", ".join(cause for cause, present in causes.items() if present) or "damping"
    return f"{by} took {100 * damped / put_in:.2g} % of the work and initial energy, which no crack dissipated"
