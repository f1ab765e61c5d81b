"""How many bonds there are, in the words of users: pairs of nodes.

Solvers list each bond at both its nodes. Where spacings differ, the thesis mode has some that only one of its nodes
has; they count as half.
"""

from __future__ import annotations


def pair_count(directed: int) -> int:
    """Number of pairs of nodes that so many directed bonds join."""
    return (directed + 1) // 2


def crack_energy(cracks: dict[str, float], unit: str) -> str:
    """The area that broke, G0 times it, and what bonds took: a check of physics, which the balance is not."""
    spent, cost = cracks["spent"], cracks["cost"]
    return (
        f"cracks: area {cracks['area']:.4g} {'m' if unit == 'J/m' else 'm^2'}, times G0 {cost:.4g} {unit}; bonds took"
        f" {spent:.4g} {unit}, {spent / cost:.2f} of that"
    )
