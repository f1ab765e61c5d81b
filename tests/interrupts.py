"""Ctrl-C while a test waits: at any line of Python that it executes."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable


def interrupted_at(line: int, work: Callable[[], object]) -> bool:
    """Do some work with Ctrl-C as a line of it begins, in our modules or in those of Python; whether it was raised."""
    lines = 0

    def trace(frame: object, event: str, _: object) -> object:
        nonlocal lines
        if event == "line":
            lines += 1
            if lines == line:
                signal.raise_signal(signal.SIGINT)
        return trace

    sys.settrace(trace)  # type: ignore[arg-type]
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    return False
