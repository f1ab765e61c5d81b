"""Where a substance or heat is, and where it has gone, in words."""

from __future__ import annotations

WORDS = {"inside": ("inside",) * 2, "through": ("gone out", "come in"), "supplied": ("supplied", "withdrawn")}


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
