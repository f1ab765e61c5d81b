"""Keys that a JSON text has twice in one object, of which readers would take the last in silence."""

from __future__ import annotations

import json
import re
from collections import Counter
from contextlib import suppress
from typing import Any

from pdmesh.model.grid_file_nodes import BEGIN, END

SIGNS = 12  # quotation marks in a node's record: those of five keys and one text
NUMBERS = re.compile(rb"\[[-+0-9.eE, \n]{40,}\]")


def repeated_key(text: bytes | str) -> str | None:
    """The place, such as ``$.material.E``, of a key that an object in a valid JSON text has twice; None without one.

    The records of a grid file's nodes are only counted, if they are in the layout of `pdmesh build`, as each has the
    same keys; long arrays of numbers are skipped.
    """
    data = text.encode() if isinstance(text, str) else text
    start = data.find(BEGIN) + len(BEGIN)
    end = data.find(END, start)
    # none of the nodes can have a key twice, if they have as many quotes as their keys need
    alike = start >= len(BEGIN) and end >= 0 and data.count(b'"', start, end) == SIGNS * data.count(b"{", start, end)
    with suppress(ValueError):  # if what was left out is no whole value
        if _search(NUMBERS.sub(b"[]", data[:start] + data[end:] if alike else data)) is None:
            return None
    return _search(data)  # the text itself has the last word, and the places


def _search(data: bytes) -> str | None:
    repeated: list[tuple[dict[str, Any], str]] = []

    def object_of(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        if len(values) < len(pairs):
            counts = Counter(name for name, _ in pairs)
            repeated.append((values, next(name for name, count in counts.items() if count > 1)))
        return values

    document = json.loads(data, object_pairs_hook=object_of)
    if not repeated:
        return None
    inner, key = repeated[-1]  # is part of `document`: an object that holds it and drops it comes later
    return f"{_place(document, inner)}.{key}"


def _place(value: Any, wanted: dict[str, Any], place: str = "$") -> str | None:
    """The place of an object, which is compared by identity, within a parsed JSON value."""
    if value is wanted:
        return place
    if isinstance(value, dict):
        inner = ((f"{place}.{name}", item) for name, item in value.items())
    elif isinstance(value, list):
        inner = ((f"{place}[{at}]", item) for at, item in enumerate(value) if isinstance(item, dict | list))
    else:
        return None
    return next((at for name, item in inner if (at := _place(item, wanted, name)) is not None), None)
