"""How many bonds there are, in the words of users: pairs of nodes.

Solvers list each bond at both its nodes. Where spacings differ, the thesis mode has some that only one of its nodes
has; they count as half.
"""

from __future__ import annotations


def pair_count(directed: int) -> int:
    """Number of pairs of nodes that so many directed bonds join."""
    return (directed + 1) // 2
