"""The form of a message about bad input: the problem with its place and value, then what to do.

    plate.json already exists; use --force to overwrite it
    plate.json: $.run.steps is -1; use a whole number from 0

A file or a line stands first where the problem is inside of it. The part behind the semicolon is an instruction.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

NONE = re.compile(r"none(?! or\b)(.*)", re.DOTALL)  # a setting that is not to be there, and why

COUNTED = re.compile(r"\d\S* [a-z]")  # such as 2 materials


def unfit(place: str, value: object, use: object) -> str:
    """The message about a value that a place cannot have, and what to `use` there.

    A `value` of None or "none" is missing; "some" is one that is not quoted. Use "none" and a reason for what cannot
    be there at all.
    """
    shown, remedy = str(value), str(use)
    if shown.lower() == "none":
        return f"{place} is missing; give {remedy}"
    if never := NONE.fullmatch(remedy):
        return f"{place}{'' if shown == 'some' else f' ({shown})'} cannot be used{never[1]}; leave it out"
    verb = "has" if COUNTED.match(shown) else "is"
    return f"{place} {verb} {shown}; use {remedy}"


def listed(names: Iterable[str], quote: bool = False) -> str:
    """Names as a choice in words: a, b or c."""
    words = [f"'{name}'" if quote else name for name in names]
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]])) if words else ""
