"""The digest of a grid file, which shows whether the file is still as a program wrote it.

It is the SHA-256 of all bytes before its own line, which is the last key of the file. It detects accidents, not intent:
the key can be removed.
"""

from __future__ import annotations

import hashlib
import warnings

START, END = b',\n"digest": "', b'"\n}\n'  # around the hexadecimal digits
KEY = b'"digest"'  # in a file that another program has written anew


class GridWarning(UserWarning):
    """A grid file that can be used but may not be what was built; one line."""


def sealed(head: bytes) -> bytes:
    """A whole file: `head`, the text of an object up to its last value, and the digest."""
    return head + START + _digest(head) + END


def compare(data: bytes, name: str) -> None:
    """Warn with GridWarning if the text of the file called `name` does not match its digest.

    Converted line ends are accepted. A file without a digest passes, as other programs write none.
    """
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n")
    head, key, tail = data.rpartition(START)
    if (tail == _digest(head) + END) if key else KEY not in data:
        return
    warnings.warn(
        f"{name}: $.digest: found one that does not match the file, expected that of its content: the file was"
        " edited by hand, or damaged (a file without this key is not compared)",
        GridWarning,
        stacklevel=3,
    )


def _digest(head: bytes) -> bytes:
    return hashlib.sha256(head).hexdigest().encode()
