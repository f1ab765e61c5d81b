"""Suggestions for unknown words in files and options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

import msgspec
import msgspec.inspect as inspection

from pdmesh.spelling import nearest

UNKNOWN = re.compile(r"(Invalid enum value '|Object contains unknown field `)(.*?)['`](?: - at `\$(.*)`)?", re.DOTALL)
UNFIT = re.compile(r"Expected .* - at `\$(.*)`", re.DOTALL)
LARGE = re.compile(r"Number out of range(?: - at `([^`]*)`)?")
STEP = re.compile(r"\.\w+|\[[^\]]*\]")


T = TypeVar("T")


class Removed(NamedTuple):
    """A setting that this version no longer has."""

    place: str  # of the object that has it, such as .run.hybrid
    name: str
    last: str  # version that had it


def called(name: str | None, number: int, what: str = "condition") -> str:
    """The name of a condition or another part of a file or, if it has none, its number, from 0."""
    return name or f"{what} {number}"


def explained(error: Exception, kind: type, given: Callable[[], Any]) -> str:
    """The message of an error in parsing a `kind`; for an unknown word, it ends with the known ones.

    After a word with a fixed set of values come all of them, after a field's name the most similar one, or the last
    version that had it. A value of the wrong type is quoted from `given`.
    """
    removed = removed_setting(error, kind)
    if removed is not None:
        version = f"version {removed.last} was the last that had it"
        return f"${removed.place}.{removed.name}: removed ({version}); leave it out"
    unfit = UNFIT.fullmatch(str(error)) if isinstance(error, msgspec.ValidationError) else None
    if unfit is not None and "[...]" not in unfit[1]:
        with suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError):  # of what comes after it in a file
            return f"{error}, found {_at(given(), unfit[1])!r:.80}"
    large = LARGE.fullmatch(str(error))
    if large is not None:
        return f"{large[1] or '$'}: found a number that no float holds, such as 1e999, expected at most 1.8e308"
    said = UNKNOWN.fullmatch(str(error)) if isinstance(error, msgspec.ValidationError) else None
    if said is None:
        return str(error)
    met = _types_at(kind, said[3] or "")
    if said[1].startswith("Object"):
        near = nearest(said[2], [field.encode_name for one in met for field in getattr(one, "fields", ())])
        return f"{error}, expected one such as `{near}`" if near else str(error)
    words = [str(value) for one in met for value in getattr(one, "values", ())]
    return f"{error}, expected {', '.join(words[:-1])} or {words[-1]}" if len(words) > 1 else str(error)


def removed_setting(error: Exception, kind: type) -> Removed | None:
    """The removed setting that an error in parsing a `kind` is about; None if it is about something else.

    A struct names its removed settings in `REMOVED`, with the last version that had each.
    """
    said = UNKNOWN.fullmatch(str(error)) if isinstance(error, msgspec.ValidationError) else None
    if said is None or not said[1].startswith("Object"):
        return None
    place, name = said[3] or "", said[2]
    for one in _types_at(kind, place):
        last = getattr(getattr(one, "cls", None), "REMOVED", {}).get(name)
        if last is not None:
            return Removed(place, name, last)
    return None


def decode_older(text: str, kind: type[T]) -> tuple[T, str]:
    """The `kind` in a JSON text that an older version may have written, and the text without removed settings.

    Raises msgspec.DecodeError.
    """
    while True:
        try:
            return msgspec.json.decode(text, type=kind), text
        except msgspec.ValidationError as error:
            removed = removed_setting(error, kind)
            if removed is None:
                raise
            tree = msgspec.json.decode(text)
            del _at(tree, removed.place)[removed.name]
            text = msgspec.json.encode(tree).decode()


def _types_at(kind: type, path: str) -> list[inspection.Type]:
    """The types that a path of `.name` and `[index]` leads to from a `kind`; those of a union each."""
    met = [inspection.type_info(kind)]
    for step in STEP.findall(path):
        met = [inner for outer in met for inner in _inside(outer, step)]
    return [inner for outer in met for inner in _plain(outer)]


def _at(given: Any, path: str) -> Any:
    """The value at the end of a path of `.name` and `[index]`."""
    for step in STEP.findall(path):
        given = given[step[1:] if step.startswith(".") else int(step[1:-1])]
    return given


def _inside(outer: inspection.Type, step: str) -> Iterator[inspection.Type]:
    """Types that a step of a path, `.name` or `[index]`, leads to."""
    for one in _plain(outer):
        if step.startswith("."):
            yield from (field.type for field in getattr(one, "fields", ()) if field.encode_name == step[1:])
        elif isinstance(one, inspection.TupleType):
            yield from one.item_types
        else:
            item: Any = getattr(one, "item_type", getattr(one, "value_type", None))
            yield from () if item is None else (item,)


def _plain(outer: inspection.Type) -> Iterator[inspection.Type]:
    """The members of a union type."""
    if isinstance(outer, inspection.Metadata):
        yield from _plain(outer.type)
    elif isinstance(outer, inspection.UnionType):
        for one in outer.types:
            yield from _plain(one)
    else:
        yield outer
