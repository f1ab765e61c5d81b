"""Output of the three programs, escaped so that a terminal shows control characters and does not obey them."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TextIO

from pdmesh.plain_text import for_line, visible


class UnprintedError(Exception):
    """Output that cannot be written: the other end of a pipe has closed, or a disk is full."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"stdout: {error.strerror}")
        self.is_closed = isinstance(error, BrokenPipeError)  # by one who has seen enough, such as head


def print_text(text: str, file: TextIO | None = None, end: str = "\n") -> None:
    """Print on stdout, or another stream. Raises UnprintedError."""
    stream = sys.stdout if file is None else file
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        stream.write((visible(text) + end).encode(encoding, "backslashreplace").decode(encoding))
        stream.flush()
    except OSError as error:
        raise UnprintedError(error) from None


def print_to_stderr(message: str) -> None:
    """Print a line on stderr; errors in writing are ignored."""
    with suppress(UnprintedError):
        print_text(for_line(message), sys.stderr)


def leave_stdout() -> None:
    """Discard what is left to print, so that Python does not complain at exit."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
