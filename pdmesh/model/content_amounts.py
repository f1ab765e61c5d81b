"""Where a substance or heat is, and where it has gone, in words."""

from __future__ import annotations


def amounts_line(unit: str, inside: float, through: float, supplied: float, error: float) -> str:
    """The amounts of a run, each with a word for its sign; `error` is that of their balance.

    `through` has gone out through prescribed nodes, `supplied` has come from sources and exchanges.
    """
    ways = [_way(through, "gone out", "come in"), _way(supplied, "supplied", "withdrawn")]
    return f"{unit}: inside {inside:.6g}, {', '.join(ways)} (balance {error:+.1e})"


def _way(amount: float, word: str, opposite: str) -> str:
    return f"{opposite if amount < 0 else word} {abs(amount):.6g}"
