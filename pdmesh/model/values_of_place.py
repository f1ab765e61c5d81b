"""Values of conditions that depend on the place: expressions of x, y and z, and tables between whose places they are
interpolated.

An expression comes from a file of anyone. It is parsed, not evaluated by Python: numbers, `x`, `y`, `z` (m), `pi`, the
operators ``+ - * / ^ **``, comparisons (1 or 0) and the functions below are all that it may hold.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of

AXES = "xyz"
LONGEST = 1000  # letters of an expression
MOST_PARTS = 500  # of its syntax tree
FILES = (".csv", ".npy")  # ends of names of tables; see `value_files`
LARGEST = 1e30  # of a value
LEAST = 1e-100  # smaller values are 0
SAME = 1e-9  # of a table's extent: a node this near to a place has its value
BEYOND = 0.1  # of a table's extent: a node this far outside of it has the value of its border
FLAT = 1e-9  # of a table's extent: directions in which its places extend less count as none

FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    **{name: (1, getattr(np, name)) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "exp", "log")},
    **{name: (1, getattr(np, name)) for name in ("log10", "floor", "ceil", "sign", "abs")},
    "asin": (1, np.arcsin),
    "acos": (1, np.arccos),
    "atan": (1, np.arctan),
    "atan2": (2, np.arctan2),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "where": (3, np.where),
}
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Values at places: linear between them, constant in directions in which the places do not extend."""

    places: tuple[tuple[float, ...], ...]  # (k, axes) m
    values: tuple[float, ...]  # (k,)
    axes: Annotated[str, msgspec.Meta(pattern="^x?y?z?$", min_length=1)] | None = None  # of places; None: all

    def __repr__(self) -> str:
        """The table in a few words."""
        return f"table of {len(self.places)} places, {min(self.values):.6g} to {max(self.values):.6g}"


Expression = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST)]
Value = float | Expression | Table  # a number, an expression of x, y and z in SI units, or a table
Vector = Annotated[tuple[Value, ...], msgspec.Meta(min_length=2, max_length=3)]
NAMES = ("x", "y", "z", "traction", "body_force", "value", "rate", "flux")  # of fields that hold such values


class PlaceError(ValueError):
    """A value of place that cannot be; the message says what was found and expected."""


def values_at(value: Value, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values (k,) at places (k, d), m. Raises PlaceError for one that is not a finite number."""
    if isinstance(value, Table):
        found = _interpolated(value, position)
    elif isinstance(value, str):
        with np.errstate(all="ignore"):
            terms = {**dict(zip(AXES, position.T, strict=False)), "pi": np.float64(np.pi)}
            found = np.broadcast_to(np.asarray(_evaluated(_parsed(value), terms), dtype=float), len(position)).copy()
    else:
        return np.full(len(position), value, dtype=float)
    wrong = np.flatnonzero(~(np.abs(found) <= LARGEST))
    if len(wrong):
        place = ", ".join(f"{number:g}" for number in position[wrong[0]])
        raise PlaceError(
            f"found {found[wrong[0]]:g} at ({place}) m, expected finite numbers of at most {LARGEST:g} at all nodes"
        )
    found[np.abs(found) < LEAST] = 0.0
    return found


def vectors_at(vector: Sequence[Value], position: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vectors (k, d) at places (k, d), m. Raises PlaceError."""
    if not any(map(is_of_place, vector)):
        return np.tile(np.array(vector, dtype=float), (len(position), 1))
    return np.column_stack([values_at(value, position) for value in vector])


def largest(value: Value | None, position: NDArray[np.float64]) -> float:
    """The largest size of a value at places (k, d), m; 0 of none."""
    if value is None or isinstance(value, float | int):
        return abs(value or 0.0)
    return float(np.abs(values_at(value, position)).max(initial=0.0))


def is_of_place(value: Value | None) -> bool:
    """Whether a value depends on the place."""
    return isinstance(value, str | Table)


def varying(condition: msgspec.Struct) -> Iterator[tuple[str, int | None, str | Table]]:
    """The values of a condition that vary with place: field, number within it or None, and value."""
    for name in NAMES:
        found = getattr(condition, name, None)
        for at, value in enumerate(found) if isinstance(found, tuple) else ((None, found),):
            if isinstance(value, str | Table):
                yield name, at, value


def replaced(condition: Any, name: str, at: int | None, value: Value) -> Any:
    """The condition with another value in a field, or at a number within it."""
    if at is not None:
        vector = list(getattr(condition, name))
        vector[at] = value
        return msgspec.structs.replace(condition, **{name: tuple(vector)})
    return msgspec.structs.replace(condition, **{name: value})


def named(name: str, at: int | None) -> str:
    """The name of such a value in messages: x, or traction[0]."""
    return name if at is None else f"{name}[{at}]"


def is_file(value: str) -> bool:
    """Whether words name a file: FILE.csv, FILE.csv:COLUMN or FILE.npy."""
    return value.partition(":")[0].strip().lower().endswith(FILES)


def wrong_value(value: str | Table, dimension: int) -> str | None:
    """What is wrong with an expression or a table in a plate (2) or in space (3); None if nothing is."""
    try:
        if isinstance(value, Table):
            _check_table(value, dimension)
        elif is_file(value):
            return f"found the file '{value:.80}', which was not read, expected its values or an expression"
        else:
            _check_names(_parsed(value), AXES[:dimension])
    except PlaceError as error:
        return str(error)
    return None


def _check_names(tree: ast.expr, known: str) -> None:
    for part in ast.walk(tree):
        if isinstance(part, ast.Name) and part.id in AXES and part.id not in known:
            raise PlaceError(f"found {part.id} in an expression, expected {', '.join(known)} in a plate")


@lru_cache(64)
def _parsed(text: str) -> ast.expr:
    """The syntax tree of an expression. Raises PlaceError for anything but numbers, places and known functions."""
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
        parts = [part for part in ast.walk(tree) if not isinstance(part, ast.expr_context | ast.operator | ast.unaryop)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise PlaceError(
            f"found {text!r:.80}, expected an expression of x, y and z such as '1e6 * (1 - (y/0.02)^2)'"
        ) from None
    if len(parts) > MOST_PARTS:
        raise PlaceError(f"found an expression of {len(parts)} parts, expected at most {MOST_PARTS}")
    called = {id(part.func) for part in parts if isinstance(part, ast.Call)}
    for part in parts:
        _check_part(part, called)
    return tree


def _check_part(part: ast.AST, called: set[int]) -> None:
    """Raise PlaceError for a part that an expression may not have; `called` are the ids of names of functions."""
    match part:
        case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
            return
        case ast.Name(id=name) if (name in FUNCTIONS) if id(part) in called else (name in (*AXES, "pi")):
            return
        case ast.BinOp(op=op) | ast.UnaryOp(op=op) if type(op) in OPERATORS:
            return
        case ast.Compare(ops=[op]) if type(op) in OPERATORS:
            return
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            if len(args) == FUNCTIONS[name][0]:
                return
            raise PlaceError(f"found {name} of {len(args)} values, expected {FUNCTIONS[name][0]}")
        case ast.cmpop():
            return
    text = ast.unparse(part) if isinstance(part, ast.expr) else type(part).__name__
    known = ", ".join(sorted(FUNCTIONS))
    raise PlaceError(f"found {text!r:.60} in an expression, expected numbers, x, y, z, pi, + - * / ^ < > and {known}")


def _evaluated(part: ast.expr, terms: dict[str, Any]) -> Any:
    """The value of a checked part of an expression."""
    match part:
        case ast.Constant(value=value):
            return np.float64(_number(value))
        case ast.Name(id=name):
            if name not in terms:
                raise PlaceError(f"found {name} in an expression, expected x and y in a plate")
            return terms[name]
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_evaluated(left, terms), _evaluated(right, terms))
        case ast.UnaryOp(op=op, operand=operand):
            return OPERATORS[type(op)](_evaluated(operand, terms))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return np.where(OPERATORS[type(op)](_evaluated(left, terms), _evaluated(right, terms)), 1.0, 0.0)
        case ast.Call(func=ast.Name(id=name), args=args):
            return FUNCTIONS[name][1](*(_evaluated(each, terms) for each in args))
    raise PlaceError(f"found {type(part).__name__} in an expression, expected numbers, places and functions")


def _number(value: Any) -> float:
    """A number of an expression. Raises PlaceError for one that no float holds."""
    try:
        return float(value)
    except OverflowError:
        raise PlaceError("found a number that no float holds, expected at most 1.8e308") from None


def _check_table(table: Table, dimension: int) -> None:
    """Raise PlaceError for a table whose columns do not fit each other or the dimension."""
    axes = table.axes or AXES[:dimension]
    if not set(axes) <= set(AXES[:dimension]):
        raise PlaceError(f"found a table along {axes}, expected {', '.join(AXES[:dimension])} in a plate")
    if not table.places or len(table.places) != len(table.values):
        raise PlaceError(
            f"found {len(table.places)} places and {len(table.values)} values in a table, expected as many of each"
        )
    if any(len(place) != len(axes) for place in table.places):
        raise PlaceError(f"found places of another number of coordinates in a table, expected {', '.join(axes)}")
    if not (np.abs(np.array(table.places)) <= LARGEST).all() or not (np.abs(table.values) <= LARGEST).all():
        raise PlaceError(f"found numbers that are not finite in a table, expected at most {LARGEST:g}")


def _interpolated(table: Table, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k,) of a table at places (k, d). Raises PlaceError for a place outside of the table."""
    axes = table.axes or AXES[: position.shape[1]]
    at = position[:, [AXES.index(axis) for axis in axes]]
    places, values = np.array(table.places, dtype=float).reshape(-1, len(axes)), np.array(table.values, dtype=float)
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
        found = np.interp(at[:, 0], inside[order, 0], values[order], left=np.nan, right=np.nan)
    else:
        from scipy.interpolate import LinearNDInterpolator  # slow to import, and few models need it

        found = LinearNDInterpolator(inside, values)(at)
    outside = np.flatnonzero(np.isnan(found))
    if len(outside):
        far, nearest = tree_of(inside).query(at[outside])
        if far.max() > BEYOND * extent:
            place = ", ".join(f"{number:g}" for number in position[outside[far.argmax()]])
            raise PlaceError(
                f"found a node at ({place}) m, {far.max():.3g} m outside of its table, expected a table that covers it"
            )
        found[outside] = values[nearest]
    return np.asarray(found)
