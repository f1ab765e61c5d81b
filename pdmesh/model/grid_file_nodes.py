"""The nodes of a grid file: records in its text, columns in memory.

Text is read and written some hundred records at a time, which stay in the processor's cache.

Readers would take the last of a key that a JSON text has twice in one object, in silence: it is refused.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from itertools import chain
from struct import pack
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from pdmesh.model.base_structs import Id

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

BEGIN, END, BETWEEN = b'"nodes": [\n  ', b"\n]", b",\n  "  # of the records in the text of a file
READ, WRITTEN = 65_536, 256  # bytes; nodes
SIGNS = 12  # quotation marks in a node's record: those of five keys and one text
NUMBERS = re.compile(rb"\[[-+0-9.eE, \n]{40,}\]")


class NodeRecord(msgspec.Struct, frozen=True, gc=False, forbid_unknown_fields=True):
    """One node of the grid file, with the keys of the thesis."""

    id: Id
    border: Literal["true", "false"]
    position: tuple[float, float, float]  # m
    hole_id: Id
    delta: tuple[float, float, float]  # m


DECODER = msgspec.json.Decoder(list[NodeRecord])


@dataclass(frozen=True, eq=False)
class NodeColumns:
    """The nodes of a grid file, n of them, in columns."""

    id: NDArray[np.int64]  # (n,)
    border: NDArray[np.bool_]  # (n,)
    position: NDArray[np.float64]  # (n, 3) m
    hole_id: NDArray[np.int64]  # (n,)
    delta: NDArray[np.float64]  # (n, 3) m

    def __len__(self) -> int:
        return len(self.id)

    def __eq__(self, other: object) -> bool:
        import numpy as np

        names = [field.name for field in fields(self)]
        return isinstance(other, NodeColumns) and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in names
        )

    __hash__ = None  # type: ignore[assignment]


def columns_of(records: Sequence[NodeRecord]) -> NodeColumns:
    """The columns of records."""
    import numpy as np

    n = len(records)
    position = chain.from_iterable([record.position for record in records])
    delta = chain.from_iterable([record.delta for record in records])
    return NodeColumns(  # packing takes half the time of numpy's own conversion
        np.frombuffer(pack(f"{n}q", *[record.id for record in records]), np.int64),
        np.array([record.border == "true" for record in records], bool),
        np.frombuffer(pack(f"{3 * n}d", *position)).reshape(n, 3),
        np.frombuffer(pack(f"{n}q", *[record.hole_id for record in records]), np.int64),
        np.frombuffer(pack(f"{3 * n}d", *delta)).reshape(n, 3),
    )


def taken_out(text: bytes) -> tuple[bytes, NodeColumns] | None:
    """The text of a file without its nodes, and these; None if its lines are not those of `written`, or wrong."""
    import numpy as np

    start, end = text.find(BEGIN) + len(BEGIN), text.rfind(END)
    if start < len(BEGIN) or end <= start:
        return None
    parts, at = [], start
    try:
        while at < end:  # some lines at a time
            line_end = text.find(BETWEEN, at + READ, end)
            stop = end if line_end < 0 else line_end
            parts.append(columns_of(DECODER.decode(b"[%b]" % text[at:stop])))
            at = stop + len(BETWEEN)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    names = [field.name for field in fields(NodeColumns)]
    every = (np.concatenate([getattr(part, name) for part in parts]) for name in names)
    return text[:start] + text[end:], NodeColumns(*every)


def written(nodes: NodeColumns) -> Iterator[bytes]:
    """The records, a line for each node, in pieces."""
    for at in range(0, len(nodes), WRITTEN):
        line, varying = b"{", list[list[bytes]]()  # what is the same in all nodes of a piece is put into words once
        for before, column, after in (
            (b'"id":', nodes.id, b""),
            (b',"border":"', nodes.border, b'"'),
            (b',"position":[', nodes.position, b"]"),
            (b',"hole_id":', nodes.hole_id, b""),
            (b',"delta":[', nodes.delta, b"]"),
        ):
            values = column[at : at + WRITTEN]
            same = bool((values == values[0]).all())
            text = msgspec.json.encode((values[:1] if same else values).tolist())
            texts = text[1:-1].split(b",") if values.ndim == 1 else text[2:-2].split(b"],[")
            line += before + (texts[0] if same else b"%b") + after
            if not same:
                varying.append(texts)
        lines = BETWEEN.join([line + b"}"] * min(WRITTEN, len(nodes) - at))
        yield (BETWEEN if at else b"") + lines % tuple(chain.from_iterable(zip(*varying, strict=True)))


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
