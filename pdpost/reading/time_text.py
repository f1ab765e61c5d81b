"""Times in words: microseconds for fast runs, milliseconds and seconds for slow ones and for load steps."""

from __future__ import annotations

SLOW, LONG = 9.9995e-3, 0.1  # s: from here on a time is told in milliseconds, in seconds
HOURS = 9999.5  # s: from here on in whole seconds, as four digits would be a power of ten


def time_text(seconds: float, form: str = ".4g", micro: str = "us") -> str:
    """A time (s) as text in microseconds, or in milliseconds or seconds if it is long."""
    if abs(seconds) >= HOURS:
        return f"{seconds:.0f} s"
    if abs(seconds) >= LONG:
        return f"{seconds:{form}} s"
    return f"{seconds * 1e3:{form}} ms" if abs(seconds) >= SLOW else f"{seconds * 1e6:{form}} {micro}"
