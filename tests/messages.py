"""Messages are tested for the names, places and values in them, not for their sentences."""

from __future__ import annotations

import re

Part = object | re.Pattern[str]  # a text, a number, a path, or a pattern
Parts = Part | tuple[Part, ...]


def naming(*parts: Part, found: Parts = (), expected: Parts = ()) -> str:
    """A pattern, for `match`, of a message that names all parts, in any order, as whole words.

    `found` are parts of the problem, such as a value, and `expected` what may be used in its place.
    """
    every = (*parts, *_several(found), *_several(expected))
    return "(?s)^" + "".join(f"(?=.*{_whole(part)})" for part in every)


def mentions(message: object, *parts: Part, found: Parts = (), expected: Parts = ()) -> bool:
    """Whether a message names all parts; see `naming`."""
    return re.search(naming(*parts, found=found, expected=expected), str(message)) is not None


def _several(parts: Parts) -> tuple[Part, ...]:
    return parts if isinstance(parts, tuple) else (parts,)


def _whole(part: Part) -> str:
    """A pattern as it is; of other parts one that matches no piece of a longer word or number."""
    if isinstance(part, re.Pattern):
        return str(part.pattern)
    text = str(part)
    before = r"(?<![\w.-])" if re.match(r"\d", text) else r"(?<![\w-])" if re.match(r"\w", text) else ""
    return before + re.escape(text) + (r"(?!\w|[.-]\w)" if re.search(r"\w$", text) else "")
