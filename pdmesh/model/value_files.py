"""Tables of values in files beside a model: CSV and NumPy's .npy, which come from anyone.

A CSV file has one row for each place. With a header, the columns `x`, `y` and `z` are coordinates, m, of which some may
be left out, and ``FILE.csv:COLUMN`` names that of the values where there are several. Without one, the coordinates of
the model come first and the values last, as in a .npy array.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import msgspec

from pdmesh.files import read_bytes
from pdmesh.model.values_of_place import AXES, PlaceError, Table, is_file, named, replaced, varying, wrong_value

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MOST_BYTES = 2**25  # of a file
MOST_ROWS = 200_000  # of its table
WORD = re.compile(r"\s*[\"']?(\w*)")

C = TypeVar("C", bound=msgspec.Struct)


def with_tables(conditions: Sequence[C], folder: Path, dimension: int, place: str) -> tuple[C, ...]:
    """The conditions with the tables of files in a folder in place of their names.

    Raises PlaceError for a file that cannot be one of a model in the plane (2) or in space (3), whose message begins
    with the condition's place below `place`.
    """
    with_values = list(conditions)
    for number, condition in enumerate(conditions):
        for name, at, value in varying(condition):
            if isinstance(value, str) and is_file(value):
                try:
                    table = read_table(value, folder, dimension)
                except PlaceError as error:
                    raise PlaceError(f"{place}[{number}].{named(name, at)}: {error}") from None
                with_values[number] = replaced(with_values[number], name, at, table)
    return tuple(with_values)


def read_table(words: str, folder: Path, dimension: int) -> Table:
    """The table of a file in a folder; `words` are ``FILE`` or ``FILE.csv:COLUMN``. Raises PlaceError."""
    name, _, column = (part.strip() for part in words.partition(":"))
    if Path(name).name != name or not name.isprintable() or "\\" in name:
        raise PlaceError(
            f"the file {name!r:.80} cannot be used; give the name of one beside the model, without a folder"
        )
    path = folder / name
    try:
        if path.resolve().parent != folder.resolve():
            raise PlaceError(f"{name} is a link out of the folder; use a file beside the model")
        data = read_bytes(path, MOST_BYTES)
    except OSError as error:
        raise PlaceError(f"{name}: cannot be read: {error.strerror or error}") from None
    header, rows = (None, _array(data, name)) if name.lower().endswith(".npy") else _columns(data, name)
    header = header or [*AXES[:dimension], "value"]
    if len(header) != rows.shape[1] or len(set(header)) != len(header):
        raise PlaceError(f"{name} has {rows.shape[1]} columns; use {len(header)}, {', '.join(header)}, each once")
    axes = "".join(axis for axis in AXES if axis in header)
    value_names = [word for word in header if word not in AXES]
    if not axes or not (column in value_names if column else len(value_names) == 1):
        expected = f"{column} and " if column else "one column of values (or FILE.csv:COLUMN) and "
        raise PlaceError(f"{name} has the columns {', '.join(header):.80}; use {expected}x, y or z")
    places = rows[:, [header.index(axis) for axis in axes]]
    column_values = rows[:, header.index(column or value_names[0])]
    table = Table(tuple(map(tuple, places.tolist())), tuple(column_values.tolist()), axes)
    wrong = wrong_value(table, dimension)
    if wrong is not None:
        raise PlaceError(f"{name}: {wrong}")
    return table


def _columns(data: bytes, name: str) -> tuple[list[str] | None, NDArray[np.float64]]:
    """Names and numbers (k, c) of the columns of a CSV file; None without a header. Raises PlaceError."""
    import numpy as np  # here, as few models have such files

    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise PlaceError(f"{name} is no text; use a CSV file in UTF-8") from None
    rows = [(at, line.split(",")) for at, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    header = None
    if rows and _numbers(rows[0][1]) is None:
        header = [match[1].lower() for word in rows.pop(0)[1] if (match := WORD.match(word))]
    if not 0 < len(rows) <= MOST_ROWS:
        raise PlaceError(f"{name} has {len(rows)} rows of numbers; use 1 to {MOST_ROWS}")
    number_rows = []
    for at, words in rows:
        numbers = _numbers(words)
        if numbers is None or len(numbers) != len(rows[0][1]):
            raise PlaceError(f"{name}: line {at}: not a row of numbers; use {len(rows[0][1])} numbers between commas")
        number_rows.append(numbers)
    return header, np.array(number_rows)


def _numbers(words: list[str]) -> list[float] | None:
    """The numbers of a row; None if one is none."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return None


def _array(data: bytes, name: str) -> NDArray[np.float64]:
    """The numbers (k, c) of a .npy file, which may hold nothing but numbers. Raises PlaceError."""
    import numpy as np  # here, as few models have such files

    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_column, kind = read(stream)
    except (ValueError, EOFError, SyntaxError, TypeError, RecursionError, MemoryError, tokenize.TokenError):
        raise PlaceError(f"{name} has no header of a .npy file; use one with an array of numbers") from None
    at, fits = stream.tell(), len(shape) == 2 and 0 < shape[0] <= MOST_ROWS and 0 < shape[1] <= len(AXES) + 1
    if kind.kind not in "fiu" or not fits or len(data) - at != shape[0] * shape[1] * kind.itemsize:
        raise PlaceError(
            f"{name} has an array of shape {shape!r:.60} and type {kind!s:.20}; use numbers, (k, 3) of a plate or"
            f" (k, 4) of a body in space, with at most {MOST_ROWS} rows"
        )
    flat = np.frombuffer(data, kind, offset=at)
    return np.asarray(flat.reshape(shape, order="F" if by_column else "C"), dtype=float)
