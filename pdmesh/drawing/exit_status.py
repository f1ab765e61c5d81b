"""Descriptions of how a process ended."""

from __future__ import annotations

import signal


def how_it_ended(code: int) -> str:
    """Words for a process's exit code."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"
