"""Amounts of a run in the words of users: bonds, energy of cracks and of damping, a substance or heat.

Bonds are pairs of nodes; solvers list each bond at both its nodes. Where spacings differ, the thesis mode has some that
only one of its nodes has; they count as half.
"""

from __future__ import annotations

from collections.abc import Sequence

from pdmesh.model.document import Absorb, AnyCondition, Contact, Run

WORDS = {"inside": ("inside",) * 2, "through": ("gone out", "come in"), "supplied": ("supplied", "withdrawn")}
MUCH = 0.02  # of what was put in


def pair_count(directed: int) -> int:
    """Number of pairs of nodes that so many directed bonds join."""
    return (directed + 1) // 2


def crack_energy(cracks: dict[str, float], unit: str) -> str:
    """The area that broke, G0 times it, and what bonds took: a check of physics, which the balance is not."""
    spent, cost = cracks["spent"], cracks["cost"]
    others = " (interfaces have a G0 of their own)" if cracks.get("interfaces") else ""
    return (
        f"cracks: area {cracks['area']:.4g} {'m' if unit == 'J/m' else 'm^2'}, times G0 {cost:.4g} {unit}; bonds took"
        f" {spent:.4g} {unit}, {spent / cost:.2f} of that{others}"
    )


def way(name: str, amount: float) -> str:
    """The word for the sign of an amount: what came in is not a negative amount that went out."""
    word, opposite = WORDS[name]
    return opposite if amount < 0 else word


def amounts_line(unit: str, inside: float, through: float, supplied: float, error: float) -> str:
    """The amounts of a run, each with a word for its sign; `error` is that of their balance.

    `through` has gone out through prescribed nodes, `supplied` has come from sources and exchanges.
    """
    ways = [f"{way(name, amount)} {abs(amount):.6g}" for name, amount in (("through", through), ("supplied", supplied))]
    return f"{unit}: inside {inside:.6g}, {', '.join(ways)} (balance {error:+.1e})"


def damping_warning(
    run: Run, conditions: Sequence[AnyCondition], contact: Contact | None, damped: float, put_in: float
) -> str | None:
    """A remark on the energy `damped`, of all that was `put_in`, if its share is large; else None."""
    if not damped > MUCH * put_in:
        return None
    causes = {
        "run.damping": run.damping > 0,
        "run.damping_time": run.damping_time > 0,
        "layers that absorb": any(isinstance(condition, Absorb) for condition in conditions),
        "the damped seam of collocation": run.adapt == "collocation",
        "friction": contact is not None and contact.friction > 0,
        "coming to rest after bonds broke": run.solver == "static",
    }
    by = ", ".join(cause for cause, present in causes.items() if present) or "damping"
    return f"{by} took {100 * damped / put_in:.2g} % of the work and initial energy, which no crack dissipated"
