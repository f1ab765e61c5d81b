"""The digest of a grid file: whether the file is still what a program wrote.

It is the SHA-256 of all bytes before the line that holds it, which is the last key of the file. It guards against
accidents, not against intent: whoever changes a file on purpose may take the key out.
"""

from __future__ import annotations

import hashlib
import warnings

START, END = b',\n"digest": "', b'"\n}\n'  # around the hexadecimal digits
KEY = b'"digest"'  # in a file that another program has written anew


class GridWarning(UserWarning):
    """A grid file that can be used but may not be what was built; one line."""


def sealed(head: bytes) -> bytes:
    """A whole file: `head`, an object's text up to its last value, and the digest."""
    return head + START + _digest(head) + END


def compare(data: bytes, name: str) -> None:
    """Warns with GridWarning where the text of the file called `name` is not the one its digest was written for.

    Line ends may have been converted. A file without a digest passes: other programs write none.
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
