"""Values of conditions that depend on the place: expressions of x, y and z, and tables of places; what may be in them.

An expression comes from a file of anyone. It is parsed, not evaluated by Python: numbers, `x`, `y`, `z` (m), `pi`, the
operators ``+ - * / ^ **``, comparisons (1 or 0) and the functions below are all that it may hold.

`values_at_places` has their values. It needs numpy, which what only names materials and conditions does not import.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any

import msgspec

AXES = "xyz"
TIME = "t"  # the column of times, s, in a file
LONGEST = 1000  # letters of an expression
MOST_PARTS = 500  # of its syntax tree
TABLES = (".csv", ".npy")  # ends of names of tables; see `values_at_places`
MESHES = (".vtu", ".vtk", ".pvd", ".frd")  # and of meshes, which scenes and drawings read
LARGEST = 1e30  # of a value
LEAST = 1e-100  # smaller values are 0

FUNCTIONS = {  # and how many values each takes
    **dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "sqrt", "exp", "log"), 1),
    **dict.fromkeys(("log10", "floor", "ceil", "sign", "abs"), 1),
    **dict.fromkeys(("atan2", "min", "max"), 2),
    "where": 3,
}
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Values at places: linear between them, constant in directions in which the places do not extend.

    With `times` they are linear in time too, and cover the run. Values of all places at the first time come first.
    """

    places: tuple[tuple[float, ...], ...]  # (k, axes) m
    values: tuple[float, ...]  # (k,), with times (times k,)
    axes: Annotated[str, msgspec.Meta(pattern="^x?y?z?$", min_length=1)] | None = None  # of places; None: all
    times: tuple[float, ...] = ()  # s, increasing

    def __repr__(self) -> str:
        """The table in a few words."""
        times = f" and {len(self.times)} times" if self.times else ""
        return f"table of {len(self.places)} places{times}, {min(self.values):.6g} to {max(self.values):.6g}"


Expression = Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST)]
Value = float | Expression | Table  # a number, an expression of x, y and z in SI units, or a table
Vector = Annotated[tuple[Value, ...], msgspec.Meta(min_length=2, max_length=3)]
NAMES = ("x", "y", "z", "traction", "pressure", "body_force", "value", "rate", "flux")  # of fields with such values


class PlaceError(ValueError):
    """A value of place that cannot be; the message says what was found and expected."""


def is_of_place(value: Value | None) -> bool:
    """Whether a value depends on the place."""
    return isinstance(value, str | Table)


def is_over_time(value: Value | None) -> bool:
    """Whether a value is a table with times."""
    return isinstance(value, Table) and bool(value.times)


def end_of_data(condition: msgspec.Struct) -> float | None:
    """The time, s, at which the first of a condition's tables with times ends; None without one."""
    ends = [value.times[-1] for _, _, value in varying(condition) if isinstance(value, Table) and value.times]
    return min(ends, default=None)


def varying(condition: msgspec.Struct) -> Iterator[tuple[str, int | None, str | Table]]:
    """The values of a condition that vary with place: field, number within it or None, and value."""
    for name in NAMES:
        field_value = getattr(condition, name, None)
        for at, value in enumerate(field_value) if isinstance(field_value, tuple) else ((None, field_value),):
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
    """Whether words name a file: FILE.csv, FILE.csv:COLUMN or FILE.npy, or a mesh, FILE.vtu:NAME."""
    return value.partition(":")[0].strip().lower().endswith((*TABLES, *MESHES))


def wrong_value(value: str | Table, dimension: int) -> str | None:
    """What is wrong with an expression or a table in a plate (2) or in space (3); None if nothing is."""
    try:
        if isinstance(value, Table):
            _check_table(value, dimension)
        elif is_file(value):
            return f"the file '{value:.80}' was not read; give its values or an expression"
        else:
            axes = AXES[:dimension]
            for part in ast.walk(parsed(value)):
                if isinstance(part, ast.Name) and part.id in AXES and part.id not in axes:
                    return f"an expression has {part.id}; use {', '.join(axes)} in a plate"
    except PlaceError as error:
        return str(error)
    return None


def _check_table(table: Table, dimension: int) -> None:
    """Raise PlaceError for a table that a plate (2) or a body in space (3) cannot have."""
    axes, times = table.axes or AXES[:dimension], table.times
    count = len(table.places) * (len(times) or 1)
    if not set(axes) <= set(AXES[:dimension]):
        raise PlaceError(f"a table goes along {axes}; use {', '.join(AXES[:dimension])} in a plate")
    if not count or count != len(table.values):
        at_times = f", {len(times)} times" if times else ""
        raise PlaceError(
            f"a table has {len(table.places)} places{at_times} and {len(table.values)} values; use"
            f" {count or 'as many of each'}"
        )
    if any(len(place) != len(axes) for place in table.places):
        raise PlaceError(f"places in a table have another number of coordinates; use {', '.join(axes)}")
    if not all(abs(number) <= LARGEST for numbers in (*table.places, table.values, times) for number in numbers):
        raise PlaceError(f"numbers in a table are not finite; use at most {LARGEST:g}")
    if any(not before < after for before, after in pairwise(times)) or (times and times[0] > 0):
        raise PlaceError(
            f"the times of a table go from {times[0]:g} to {times[-1]:g} s; use times that increase and begin at 0 or"
            " before"
        )


@lru_cache(64)
def parsed(text: str) -> ast.expr:
    """The syntax tree of an expression. Raises PlaceError for anything but numbers, places and known functions."""
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
        parts = [part for part in ast.walk(tree) if not isinstance(part, ast.expr_context | ast.operator | ast.unaryop)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise PlaceError(
            f"cannot read {text!r:.80}; use an expression of x, y and z such as '1e6 * (1 - (y/0.02)^2)'"
        ) from None
    if len(parts) > MOST_PARTS:
        raise PlaceError(f"an expression has {len(parts)} parts; use at most {MOST_PARTS}")
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
            if len(args) == FUNCTIONS[name]:
                return
            raise PlaceError(f"{name} has {len(args)} values; give {FUNCTIONS[name]}")
        case ast.cmpop():
            return
    text = ast.unparse(part) if isinstance(part, ast.expr) else type(part).__name__
    functions = ", ".join(sorted(FUNCTIONS))
    raise PlaceError(f"an expression has {text!r:.60}; use numbers, x, y, z, pi, + - * / ^ < > and {functions}")
