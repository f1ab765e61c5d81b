"""Descriptions of how a process, or a library within it, ended."""

from __future__ import annotations

import signal

WITHOUT_WORDS = "nothing; it stopped, probably for lack of memory"  # what a library says whose error has no message


def how_it_ended(code: int) -> str:
    """Words for a process's exit code."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"
