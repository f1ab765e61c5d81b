"""Names most similar to what was typed."""

from __future__ import annotations

from collections.abc import Iterable


def nearest(name: str, known: Iterable[str], cutoff: float = 0.0) -> str:
    """The most similar of the `known` names; "" if none has at least the similarity `cutoff`, from 0 to 1."""
    import difflib  # where something is wrong alone

    lower = {other.lower(): other for other in sorted(known, reverse=True)}
    close = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=cutoff)
    return lower[close[0]] if close else ""
