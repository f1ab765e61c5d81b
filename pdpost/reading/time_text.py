"""Times in words: microseconds for runs in time, seconds for long times such as load steps."""

from __future__ import annotations

LONG = 0.1  # s: from here on a time is told in seconds


def time_text(seconds: float, form: str = ".4g", micro: str = "us") -> str:
    """A time (s) as text in microseconds, or in seconds if it is long."""
    return f"{seconds:{form}} s" if abs(seconds) >= LONG else f"{seconds * 1e6:{form}} {micro}"
