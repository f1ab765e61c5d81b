"""Lines and numbers of text files that other programs write."""

from __future__ import annotations

import math
import re
from pathlib import Path

from pdmesh.files import read_bytes

WHOLE = re.compile(r"[+-]?[0-9]{1,18}")  # all of these fit into 64 bits
REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[DEde][+-]?[0-9]+)?")


def text_lines(path: Path) -> list[str]:
    """Lines of the file at `path`, which is UTF-8 or, if it is not, Latin-1. Raises OSError.

    Bytes are split at carriage returns and line feeds alone: text has further ends of lines, which in these files are
    halves of letters or signs in a comment.
    """
    data = read_bytes(path)
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return [line.decode("latin-1") for line in data.splitlines()]
    return [line.decode("utf-8") for line in data.removeprefix(b"\xef\xbb\xbf").splitlines()]


def whole_number(word: str) -> int | None:
    """The whole number of at most 18 digits that `word` is; None for any other word."""
    return int(word) if WHOLE.fullmatch(word) else None


def finite_number(word: str) -> float | None:
    """The finite number that `word` is, in Fortran's notation as well (1.5D-3); None for any other word."""
    if not REAL.fullmatch(word):
        return None
    value = float(word.upper().replace("D", "E"))
    return value if math.isfinite(value) else None
