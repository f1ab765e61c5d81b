"""Messages about values that a file or an option cannot have, and suggestions for unknown words in them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

import msgspec
import msgspec.inspect as inspection

from pdmesh.messages import listed
from pdmesh.spelling import meant

PLACE = r"(?: - at `(?P<KEY>key` in `)?(?P<PLACE>[^`]*)`)?"
UNKNOWN = re.compile(rf"Object contains unknown field `(?P<NAME>.*?)`{PLACE}", re.DOTALL)
MISSING = re.compile(rf"Object missing required field `(?P<NAME>.*?)`{PLACE}", re.DOTALL)
UNFIT = re.compile(rf".*?{PLACE}", re.DOTALL)
MALFORMED = re.compile(r"JSON is malformed: (.*) \(byte (\d+)\)", re.DOTALL)
UNSET = object()  # no value
DIGITS = re.compile(r"\\d(\{[^}]*\})?")  # in a pattern
STEP = re.compile(r"\.\w+|\[[^\]]*\]")
TYPES: dict[type, str] = {
    inspection.BoolType: "true or false",
    inspection.StrType: "a word",
    inspection.DictType: "a table of names and values",
    inspection.StructType: "a table of names and values",
    inspection.NoneType: "none",
}


T = TypeVar("T")


class Removed(NamedTuple):
    """A setting that this version no longer has."""

    place: str  # of the object that has it, such as $.run.hybrid
    name: str
    last: str  # version that had it


def called(name: str | None, number: int, what: str = "condition") -> str:
    """The name of a condition or another part of a file or, if it has none, its number, from 0."""
    return name or f"{what} {number}"


def explained(error: Exception, kind: type, decode: Callable[[], Any]) -> str:
    """The message of an error in parsing a `kind`: the place, its value, taken from `decode`, and what to use there."""
    text = str(error)
    if isinstance(error, tomllib.TOMLDecodeError):
        return f"not valid TOML: {text[:1].lower()}{text[1:]}; correct it there"
    if not isinstance(error, msgspec.ValidationError):
        if (malformed := MALFORMED.fullmatch(text)) is not None:
            return f"not valid JSON: {malformed[1]} at byte {malformed[2]}; correct it there, or build the file anew"
        if "truncated" in text:
            return "not valid JSON: it ends too early; use a whole file"
        if "out of range" in text:
            return "a number is larger than any float; use at most 1.8e308"
        return f"not valid JSON: {text}; build the file anew"
    if (removed := removed_setting(error, kind)) is not None:
        version = f"version {removed.last} was the last that had it"
        return f"{removed.place}.{removed.name} was removed ({version}); leave it out"
    if (unknown := UNKNOWN.fullmatch(text)) is not None:
        place = unknown["PLACE"] or "$"
        return f"{place}.{unknown['NAME']} is unknown; {_instead(unknown['NAME'], place, kind, decode)}"
    if (missing := MISSING.fullmatch(text)) is not None:
        place = f"{missing['PLACE'] or '$'}.{missing['NAME']}"
        return f"{place} is missing; give {_wanted(place, kind)}"
    unfit = UNFIT.fullmatch(text)
    place = (unfit["PLACE"] if unfit is not None else None) or "$"
    wanted = _wanted(place, kind)
    if "out of range" in text:
        return f"{place} is larger than any float (1.8e308); use {wanted}"
    value = _value(decode, place)
    place = f"a value in {place[:-5]}" if place.endswith("[...]") else place  # of any name
    words = [str(word) for known_type in _types(place, kind) for word in getattr(known_type, "values", ())]
    near = meant(value, words) if isinstance(value, str) and value not in words else ""
    hint = f" (did you mean '{near}'?)" if near else ""
    return f"{place} is {'of another type' if value is UNSET else f'{value!r:.80}'}; use {wanted}{hint}"


def removed_setting(error: Exception, kind: type) -> Removed | None:
    """The removed setting that an error in parsing a `kind` is about; None if it is about something else.

    A struct names its removed settings in `REMOVED`, with the last version that had each.
    """
    unknown = UNKNOWN.fullmatch(str(error)) if isinstance(error, msgspec.ValidationError) else None
    if unknown is None:
        return None
    place, name = unknown["PLACE"] or "$", unknown["NAME"]
    for table in _types(place, kind):
        last = getattr(getattr(table, "cls", None), "REMOVED", {}).get(name)
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


def _at(tree: Any, place: str) -> Any:
    """The value at a place such as ``$.run.hybrid``."""
    for step in STEP.findall(place.removeprefix("$")):
        tree = tree[step[1:] if step.startswith(".") else int(step[1:-1])]
    return tree


def _value(given: Callable[[], Any], place: str) -> Any:
    """The value at a place; UNSET if it cannot be told."""
    with suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError, LookupError, TypeError, ValueError):
        return _at(given(), place)
    return UNSET


def _instead(name: str, place: str, kind: type, given: Callable[[], Any]) -> str:
    """What to do about an unknown field: another of its table, or of another one, that may have been meant."""
    tables = [one for one in _types(place, kind) if isinstance(one, inspection.StructType)]
    value = _value(given, place)
    if isinstance(value, dict):  # of several kinds of tables, that of its tag
        tables = [one for one in tables if one.tag_field is None or value.get(one.tag_field) == one.tag]
    own = list(dict.fromkeys(field.encode_name for one in tables for field in one.fields))
    elsewhere = [dotted for dotted in dotted_names(kind) if "." in dotted] if len(name) > 1 or name in "ED" else []
    above = f"{place.removeprefix('$.')}." if place != "$" else ""
    near = meant(name, own)
    near = f"{above}{near}" if near else meant(name, elsewhere, cutoff=1.0)
    if near:
        return f"did you mean `{near}`?"
    return f"use {listed(own)}" if own else "leave it out"


def dotted_names(kind: type) -> list[str]:
    """The dotted names of all settings in a struct and in those inside of it."""
    return [".".join(path) for path, _ in leaves(inspection.type_info(kind))]


def may_be_none(name: str, kind: type) -> bool:
    """Whether the setting with this dotted name may be left out, and has no word none of its own."""
    types = _types(f"$.{name}", kind)
    words = [value for one in types for value in getattr(one, "values", ())]
    return "none" not in words and any(isinstance(one, inspection.NoneType) for one in types)


def leaves(
    outer: inspection.Type, depth: int = 3, path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], inspection.Field]]:
    """The fields that are no structs, with the names on the way to them; lists of structs are fields of their own."""
    for one in _plain(outer):
        for field in getattr(one, "fields", ()) if isinstance(one, inspection.StructType) else ():
            below = [*leaves(field.type, depth - 1, (*path, field.encode_name))] if depth > 1 else []
            yield from below or [((*path, field.encode_name), field)]


def _wanted(place: str, kind: type) -> str:
    """What a place can have, in words."""
    return " or ".join(described(inspection.UnionType(tuple(_types(place, kind))))) or "a value"


def described(kind: inspection.Type) -> list[str]:
    """What values of a type are, in words."""
    choices = [str(value) for one in _plain(kind) for value in getattr(one, "values", ())]
    words = [listed(choices, quote=True)] if choices else []
    for one in _plain(kind):
        if isinstance(one, inspection.FloatType | inspection.IntType):
            word = "a whole number" if isinstance(one, inspection.IntType) else "a number"
            low = f"from {_short(one.ge)}" if one.ge is not None else ""
            if one.gt is not None:
                low = f"from {one.gt + 1}" if isinstance(one, inspection.IntType) else f"above {_short(one.gt)}"
            if one.le is not None:
                high = f"to {_short(one.le)}" if low.startswith("from") else f"up to {_short(one.le)}"
            else:
                high = f"below {_short(one.lt)}" if one.lt is not None else ""
            joint = " and " if low and high and not high.startswith("to") else " "
            words.append(f"{word} {joint.join(filter(None, (low, high)))}".rstrip())
        elif isinstance(one, inspection.TupleType):
            words.append(f"a list of {len(one.item_types)} values: {', '.join(map(_first, one.item_types))}")
        elif isinstance(one, inspection.CollectionType):
            words.append(f"a list{_several(one)}, each {_first(one.item_type)}")
        elif isinstance(one, inspection.StrType) and one.pattern is not None:
            words.append(listed(_examples(one.pattern)))
        elif isinstance(one, inspection.StructType) and one.tag_field is not None:
            words.append(f"a table with {one.tag_field} = '{one.tag}'")
        elif not isinstance(one, inspection.NoneType | inspection.LiteralType):
            words.append(TYPES.get(type(one), "a value"))
    return list(dict.fromkeys(words))


def _examples(pattern: str) -> list[str]:
    """The words that a pattern such as ``^(cpu|opencl(:N)?)$`` stands for, of which an end may be left out."""
    words = []
    for part in (
        DIGITS.sub("N", pattern).removeprefix("^").removesuffix("$").removeprefix("(").removesuffix(")").split("|")
    ):
        start, _, end = part.removesuffix(")?").partition("(")
        words += [start, start + end] if end else [part]
    return words


def _first(kind: inspection.Type) -> str:
    return " or ".join(described(kind))


def _short(limit: float) -> str:
    return f"{limit:d}" if isinstance(limit, int) else f"{limit:g}"


def _several(kind: inspection.CollectionType) -> str:
    least, most = kind.min_length, kind.max_length
    if not least and most is None:
        return ""
    if least == most:
        return f" of {least} values"
    return f" of {least or 0} to {most} values" if most is not None else f" of at least {least} values"


def _types(place: str, kind: type) -> list[inspection.Type]:
    """The types that a place such as ``$.material.E`` may have, without unions."""
    met: list[inspection.Type] = [inspection.type_info(kind)]
    for step in STEP.findall(place.removeprefix("$")):
        met = [inner for outer in met for inner in _inside(outer, step)]
    return [inner for outer in met for inner in _plain(outer)]


def _inside(outer: inspection.Type, step: str) -> Iterator[inspection.Type]:
    """Types that a step of a path, `.name` or `[index]`, leads to."""
    for member_type in _plain(outer):
        if step.startswith("."):
            tag = getattr(member_type, "tag_field", None)
            if tag == step[1:]:
                yield inspection.LiteralType((member_type.tag,))  # type: ignore[attr-defined]
            yield from (field.type for field in getattr(member_type, "fields", ()) if field.encode_name == step[1:])
        elif isinstance(member_type, inspection.TupleType):
            yield from member_type.item_types
        else:
            item: Any = getattr(member_type, "item_type", getattr(member_type, "value_type", None))
            yield from () if item is None else (item,)


def _plain(outer: inspection.Type) -> Iterator[inspection.Type]:
    """The members of a union type."""
    if isinstance(outer, inspection.Metadata):
        yield from _plain(outer.type)
    elif isinstance(outer, inspection.UnionType):
        for member_type in outer.types:
            yield from _plain(member_type)
    else:
        yield outer
