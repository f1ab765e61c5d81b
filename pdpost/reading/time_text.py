"""Times in words: microseconds for fast runs, milliseconds and seconds for slow ones and for load steps."""

from __future__ import annotations

SLOW, LONG = 1e-2, 0.1  # s: from here on a time is told in milliseconds, in seconds


def time_text(seconds: float, form: str = ".4g", micro: str = "us") -> str:
    """A time (s) as text in microseconds, or in milliseconds or seconds if it is long."""
    if abs(seconds) >= LONG:
        return f"{seconds:{form}} s"
    return f"{seconds * 1e3:{form}} ms" if abs(seconds) >= SLOW else f"{seconds * 1e6:{form}} {micro}"
