"""Values of expressions and tables at places."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of
from pdmesh.model.values_of_place import AXES, LARGEST, LEAST, OPERATORS, PlaceError, Table, Value, is_of_place, parsed

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


def values_at(value: Value, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values (k,) at places (k, d), m. Raises PlaceError for one that is not a finite number."""
    if isinstance(value, Table):
        values = _interpolated(value, position)
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
        interpolated = np.interp(at[:, 0], inside[order, 0], values[order], left=np.nan, right=np.nan)
    else:
        from scipy.interpolate import LinearNDInterpolator  # slow to import, and few models need it

        interpolated = LinearNDInterpolator(inside, values)(at)
    outside = np.flatnonzero(np.isnan(interpolated))
    if len(outside):
        far, nearest = tree_of(inside).query(at[outside])
        if far.max() > BEYOND * extent:
            place = ", ".join(f"{number:g}" for number in position[outside[far.argmax()]])
            raise PlaceError(
                f"the node at ({place}) m is {far.max():.3g} m outside of its table; use a table that covers it"
            )
        interpolated[outside] = values[nearest]
    return np.asarray(interpolated)
