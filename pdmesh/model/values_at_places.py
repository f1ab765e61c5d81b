"""Values of expressions and tables at places, and tables in files beside a model: CSV and .npy, which come from anyone.

A CSV file has one row for each place. With a header, the columns `x`, `y` and `z` are coordinates, m, of which some may
be left out, and ``FILE.csv:COLUMN`` names that of the values where there are several. A column `t`, s, gives each place
a row at each time. Without a header, the coordinates of the model come first and the values last, as in a .npy array.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.files import check_regular, read_bytes
from pdmesh.model.neighbours import tree_of
from pdmesh.model.values_of_place import (
    AXES,
    LARGEST,
    LEAST,
    OPERATORS,
    TABLES,
    TIME,
    PlaceError,
    Table,
    Value,
    is_file,
    is_of_place,
    named,
    parsed,
    replaced,
    varying,
    wrong_value,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SAME = 1e-9  # of a table's extent: a node this near to a place has its value
BEYOND = 0.1  # of a table's extent: a node this far outside of it has the value of its border
FLAT = 1e-9  # of a table's extent: directions in which its places extend less count as none
NAMED = {
    "asin": "arcsin",
    "acos": "arccos",
    "atan": "arctan",
    "atan2": "arctan2",
    "min": "minimum",
    "max": "maximum",
}  # in numpy
MOST_BYTES = 2**25  # of a file
MOST_ROWS = 200_000  # of its table
LARGEST_OF_PIXELS = 10**8  # of a picture
WORD = re.compile(r"\s*[\"']?(\w*)")
C = TypeVar("C", bound=msgspec.Struct)


def values_at(value: Value, position: NDArray[np.float64], time: float | None = None) -> NDArray[np.float64]:
    """The values (k,) at places (k, d), m. Raises PlaceError for one that is not a finite number.

    Those of a table with times are at a `time`, s, or when the largest of them acts.
    """
    if isinstance(value, Table):
        if value.times and time is not None:
            values = values_at_times(value, position, np.array([time]))[:, 0]
        else:
            histories = histories_at(value, position)
            values = histories[:, np.abs(histories).max(axis=0, initial=0.0).argmax()].copy()
    elif isinstance(value, str):
        with np.errstate(all="ignore"):
            terms = {**dict(zip(AXES, position.T, strict=False)), "pi": np.float64(np.pi)}
            values = np.broadcast_to(np.asarray(_evaluated(parsed(value), terms), dtype=float), len(position)).copy()
    else:
        return np.full(len(position), value, dtype=float)
    wrong = np.flatnonzero(~(np.abs(values) <= LARGEST))
    if len(wrong):
        place = ", ".join(f"{number:g}" for number in position[wrong[0]])
        raise PlaceError(
            f"the value is {values[wrong[0]]:g} at ({place}) m; use finite numbers of at most {LARGEST:g} at all nodes"
        )
    values[np.abs(values) < LEAST] = 0.0
    return values


def vectors_at(
    vector: Sequence[Value], position: NDArray[np.float64], time: float | None = None
) -> NDArray[np.float64]:
    """The vectors (k, d) at places (k, d), m, as `values_at` has them. Raises PlaceError."""
    if not any(map(is_of_place, vector)):
        return np.tile(np.array(vector, dtype=float), (len(position), 1))
    return np.column_stack([values_at(value, position, time) for value in vector])


def over_time(
    vector: Sequence[Value], position: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The times (t,), s, of tables in a vector, and the vectors (t, k, d) then at places (k, d), m. Raises
    PlaceError."""
    times = np.unique(np.concatenate([value.times for value in vector if isinstance(value, Table) and value.times]))
    columns = []
    for value in vector:
        if isinstance(value, Table) and value.times:
            columns.append(values_at_times(value, position, times))
        else:
            columns.append(np.repeat(values_at(value, position)[:, None], len(times), axis=1))
    return times, np.array(columns).transpose(2, 1, 0)


def values_at_times(table: Table, position: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k, t) of a table with times at places (k, d), m, and these times (t,), s."""
    own, histories = np.array(table.times), histories_at(table, position)
    if len(own) == 1:
        return np.repeat(histories, len(times), axis=1)
    after = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
    share = np.clip((times - own[after - 1]) / (own[after] - own[after - 1]), 0.0, 1.0)
    return np.asarray((1 - share) * histories[:, after - 1] + share * histories[:, after])


def largest(value: Value | None, position: NDArray[np.float64]) -> float:
    """The largest size of a value at places (k, d), m; 0 of none."""
    if value is None or isinstance(value, float | int):
        return abs(value or 0.0)
    return float(np.abs(values_at(value, position)).max(initial=0.0))


def _evaluated(part: ast.expr, terms: dict[str, Any]) -> Any:
    """The value of a checked part of an expression."""
    match part:
        case ast.Constant(value=int() | float() as value):
            try:
                return np.float64(float(value))
            except OverflowError:
                raise PlaceError("a number is larger than a float holds; use at most 1.8e308") from None
        case ast.Name(id=name):
            if name not in terms:
                raise PlaceError(f"an expression has {name}; use x and y in a plate")
            return terms[name]
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_evaluated(left, terms), _evaluated(right, terms))
        case ast.UnaryOp(op=op, operand=operand):
            return OPERATORS[type(op)](_evaluated(operand, terms))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return np.where(OPERATORS[type(op)](_evaluated(left, terms), _evaluated(right, terms)), 1.0, 0.0)
        case ast.Call(func=ast.Name(id=name), args=args):
            function = getattr(np, NAMED.get(name, name))
            return function(*(_evaluated(argument, terms) for argument in args))
    raise PlaceError(f"an expression has {type(part).__name__}; use numbers, places and functions")


def histories_at(table: Table, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k, times) of a table at places (k, d); (k, 1) without times. Raises PlaceError for a place outside of the
    table."""
    axes = table.axes or AXES[: position.shape[1]]
    at = position[:, [AXES.index(axis) for axis in axes]]
    places = np.array(table.places, dtype=float).reshape(-1, len(axes))
    values = np.array(table.values, dtype=float).reshape(-1, len(places)).T
    extent = float(np.ptp(places, axis=0).max())
    far, nearest = tree_of(places).query(at)
    if (far <= SAME * extent).all() or len(places) == 1:
        return np.asarray(values[nearest])
    middle = places.mean(axis=0)
    ways = np.linalg.svd(places - middle, full_matrices=False)
    ways = ways[2][ways[1] > FLAT * ways[1][0]]  # in which the places extend
    inside, at = (places - middle) @ ways.T, (at - middle) @ ways.T
    if len(ways) == 1:
        order = np.argsort(inside[:, 0], kind="stable")
        along = inside[order, 0]
        columns = [np.interp(at[:, 0], along, column[order], left=np.nan, right=np.nan) for column in values.T]
        interpolated = np.column_stack(columns)
    else:
        from scipy.interpolate import LinearNDInterpolator  # slow to import, and few models need it

        interpolated = LinearNDInterpolator(inside, values)(at)
    outside = np.flatnonzero(np.isnan(interpolated).any(axis=1))
    if len(outside):
        far, nearest = tree_of(inside).query(at[outside])
        if far.max() > BEYOND * extent:
            place = ", ".join(f"{number:g}" for number in position[outside[far.argmax()]])
            raise PlaceError(
                f"the node at ({place}) m is {far.max():.3g} m outside of its table; use a table that covers it"
            )
        interpolated[outside] = values[nearest]
    return np.asarray(interpolated)


def nearest_at(table: Table, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k,) of a table's nearest place at places (k, d). Raises PlaceError for a place outside of the table."""
    axes = table.axes or AXES[: position.shape[1]]
    at, places = position[:, [AXES.index(axis) for axis in axes]], np.array(table.places, dtype=float)
    low, high = places.min(axis=0), places.max(axis=0)
    outside = np.maximum(np.maximum(low - at, at - high), 0.0).max(axis=1)
    tree, apart = tree_of(places), 0.0
    if len(places) > 1:  # places may be the middles of cells
        apart = max(BEYOND * float((high - low).max()), float(np.median(tree.query(places, k=2)[0][:, 1])))
    if len(places) > 1 and outside.max(initial=0.0) > apart:
        place = ", ".join(f"{number:g}" for number in position[outside.argmax()])
        raise PlaceError(f"the node at ({place}) m is outside of its table; use a table that covers it")
    return np.asarray(np.array(table.values, dtype=float)[tree.query(at)[1]])


def with_tables(conditions: Sequence[C], folder: Path, dimension: int, place: str) -> tuple[C, ...]:
    """The conditions with the tables of files in a folder in place of their names.

    Raises PlaceError for a file that cannot be one of a model in the plane (2) or in space (3), whose message begins
    with the condition's place below `place`.
    """
    with_values = []
    for number, condition in enumerate(conditions):
        try:
            with_values.append(with_read_values(condition, is_file, lambda words: read_table(words, folder, dimension)))
        except PlaceError as error:
            raise PlaceError(f"{place}[{number}].{error}") from None
    return tuple(with_values)


def with_read_values(condition: C, is_name: Callable[[str], bool], read: Callable[[str], Table]) -> C:
    """The condition with the tables that `read` gives in place of words that are names of files.

    Raises PlaceError, beginning with the name of the value.
    """
    for name, at, value in varying(condition):
        if isinstance(value, str) and is_name(value):
            try:
                table = read(value)
            except PlaceError as error:
                raise PlaceError(f"{named(name, at)}: {error}") from None
            condition = replaced(condition, name, at, table)
    return condition


def read_table(words: str, folder: Path, dimension: int) -> Table:
    """The table of a file in a folder; `words` are ``FILE`` or ``FILE.csv:COLUMN``. Raises PlaceError."""
    name, _, column = (part.strip() for part in words.partition(":"))
    if not name.lower().endswith(TABLES):
        raise PlaceError(f"a grid file cannot name {name}; use {' or '.join(TABLES)}, or a scene or a drawing")
    column = column.lower()  # as names of columns are read
    data = _bytes_beside(name, folder)
    header, rows = (None, _array(data, name)) if name.lower().endswith(".npy") else _columns(data, name)
    header = header or [*AXES[:dimension], "value"]
    if len(header) != rows.shape[1] or len(set(header)) != len(header):
        raise PlaceError(f"{name} has {rows.shape[1]} columns; use {len(header)}, {', '.join(header)}, each once")
    axes = "".join(axis for axis in AXES if axis in header)
    value_names = [word for word in header if word not in (*AXES, TIME)]
    if not (axes or TIME in header) or not (column in value_names if column else len(value_names) == 1):
        expected = f"{column} and " if column else "one column of values (or FILE.csv:COLUMN) and "
        raise PlaceError(f"{name} has the columns {', '.join(header):.80}; use {expected}x, y, z or t")
    places = rows[:, [header.index(axis) for axis in axes]] if axes else np.zeros((len(rows), 1))
    column_values = rows[:, header.index(column or value_names[0])]
    if TIME in header:
        table = table_over_time(rows[:, header.index(TIME)], places, column_values, axes or AXES[0], name)
    else:
        table = Table(tuple(map(tuple, places.tolist())), tuple(column_values.tolist()), axes)
    wrong = wrong_value(table, dimension)
    if wrong is not None:
        raise PlaceError(f"{name}: {wrong}")
    return table


def table_over_time(
    times: NDArray[np.float64], places: NDArray[np.float64], values: NDArray[np.float64], axes: str, name: str
) -> Table:
    """The table of rows (r,) with a time, s, a place (r, axes), m, and a value; each place is there at each time.

    Raises PlaceError, beginning with the `name` of the file.
    """
    moments, at_time = np.unique(times, return_inverse=True)
    _, first, at_place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    at_place = at_place.ravel()  # numpy 2.0 gives it other axes
    rows = np.bincount(at_time * len(first) + at_place, minlength=len(moments) * len(first))
    wrong = np.flatnonzero(rows != 1)
    if len(wrong):
        moment, number = divmod(int(wrong[0]), len(first))
        place = ", ".join(f"{coordinate:g}" for coordinate in places[first[number]])
        raise PlaceError(
            f"{name} has {rows[wrong[0]]} rows of the place ({place}) m at t = {moments[moment]:g} s; use one of each"
            " place at each time"
        )
    values_in_order = np.empty(len(values))
    values_in_order[at_time * len(first) + at_place] = values
    return Table(
        tuple(map(tuple, places[first].tolist())), tuple(values_in_order.tolist()), axes, tuple(moments.tolist())
    )


def array_of_nodes(name: str, folder: Path) -> NDArray[np.float64] | None:
    """The numbers (n,) of a .npy file in a folder; None for any other file or array. Raises PlaceError."""
    if not name.lower().endswith(".npy"):
        return None
    try:
        numbers = np.load(io.BytesIO(_bytes_beside(name, folder)), allow_pickle=False)
    except (ValueError, EOFError, OSError):
        return None
    return np.asarray(numbers, dtype=float) if numbers.ndim == 1 and numbers.dtype.kind in "fiu" else None


def path_beside(name: str, folder: Path) -> Path:
    """The path of a file in a folder. Raises PlaceError for one that is elsewhere."""
    if Path(name).name != name or not name.isprintable() or "\\" in name:
        raise PlaceError(
            f"the file {name!r:.80} cannot be used; give the name of one beside the model, without a folder"
        )
    path = folder / name
    try:
        if path.resolve().parent != folder.resolve():
            raise PlaceError(f"{name} is a link out of the folder; use a file beside the model")
        check_regular(path)
    except OSError as error:
        raise PlaceError(f"{name}: cannot be read: {error.strerror or error}") from None
    return path


def _bytes_beside(name: str, folder: Path) -> bytes:
    """The bytes of a file in a folder. Raises PlaceError."""
    path = path_beside(name, folder)
    try:
        return read_bytes(path, MOST_BYTES)
    except OSError as error:
        raise PlaceError(f"{name}: cannot be read: {error.strerror or error}") from None


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
