"""Eight rows of four numbers as four columns of lanes, and back: what lists of places read and write.

Arrays of rows are (q, 4) of double precision, lists of rows are of int32.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from pdsolve.codegen.lanes import Lanes
from pdsolve.codegen.vector_code import INT, repeat

TOGETHER = 8
_ACROSS = 4
_EIGHT = Lanes(types.float64, TOGETHER)
_ID = ir.IntType(32)
_ROW, _ROWS = ir.VectorType(ir.DoubleType(), _ACROSS), ir.VectorType(ir.DoubleType(), TOGETHER)
# of two vectors, the even and the odd entries in pairs; and the first and the last two of each half
_EVEN, _ODD = (0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)
_FIRST, _LAST = (0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)


@intrinsic
def columns_of_rows(typingctx, array, rows, at):  # type: ignore[no-untyped-def]
    """The four columns of eight rows, those listed from `at` on."""
    columns = types.UniTuple(_EIGHT, _ACROSS)

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        data = _data(context, builder, array, values[0])
        loaded = [_load(builder, data, start, _ROW) for start in _starts(context, builder, rows, *values[1:])]
        return context.make_tuple(builder, columns, _columns(builder, loaded))

    return columns(array, rows, types.int64), generate


@intrinsic
def row_in_lanes(typingctx, array, row):  # type: ignore[no-untyped-def]
    """The four numbers of a row, each in eight lanes."""
    columns = types.UniTuple(_EIGHT, _ACROSS)

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        start = builder.mul(values[1], INT(_ACROSS))
        loaded = _load(builder, _data(context, builder, array, values[0]), start, _ROW)
        numbers = (builder.extract_element(loaded, _ID(number)) for number in range(_ACROSS))
        return context.make_tuple(builder, columns, [repeat(builder, _ROWS, number) for number in numbers])

    return columns(array, types.int64), generate


@intrinsic
def eight_beside(typingctx, array, at):  # type: ignore[no-untyped-def]
    """Eight numbers of an array from `at` on."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return _load(builder, _data(context, builder, array, values[0]), values[1], _ROWS)

    return _EIGHT(array, types.int64), generate


@intrinsic
def move_between_rows(typingctx, values, array, rows, at, row):  # type: ignore[no-untyped-def]
    """Take eight vectors, the three columns `values`, from the rows listed from `at` on, and add them to one `row`."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        data = _data(context, builder, array, arguments[1])
        columns = [*cgutils.unpack_tuple(builder, arguments[0]), ir.Constant(_ROWS, [0.0] * TOGETHER)]
        vectors = _rows(builder, columns)
        for start, vector in zip(_starts(context, builder, rows, *arguments[2:4]), vectors, strict=True):
            _store(builder, builder.fsub(_load(builder, data, start, _ROW), vector), data, start)
        while len(vectors) > 1:
            vectors = [builder.fadd(*vectors[n : n + 2]) for n in range(0, len(vectors), 2)]
        start = builder.mul(arguments[4], INT(_ACROSS))
        _store(builder, builder.fadd(_load(builder, data, start, _ROW), vectors[0]), data, start)
        return context.get_dummy_value()

    return types.void(values, array, rows, types.int64, types.int64), generate


def _columns(builder: Any, rows: list[Any]) -> list[Any]:
    """The four columns of eight rows."""
    every = tuple(range(TOGETHER))
    a, b, c, d = (_shuffle(builder, rows[n], rows[n + _ACROSS], every) for n in range(_ACROSS))
    return [
        _shuffle(builder, _shuffle(builder, a, b, pairs), _shuffle(builder, c, d, pairs), halves)
        for halves in (_FIRST, _LAST)
        for pairs in (_EVEN, _ODD)
    ]


def _rows(builder: Any, columns: list[Any]) -> list[Any]:
    """The eight rows of four columns."""
    x, y, z, w = columns
    row_pairs = []
    for halves in (_FIRST, _LAST):
        xz, yw = _shuffle(builder, x, z, halves), _shuffle(builder, y, w, halves)
        row_pairs += [_shuffle(builder, xz, yw, pairs) for pairs in (_EVEN, _ODD)]
    nothing = ir.Constant(_ROWS, ir.Undefined)
    return [
        _shuffle(builder, row_pair, nothing, tuple(range(first, first + _ACROSS)))
        for first in (0, _ACROSS)
        for row_pair in row_pairs
    ]


def _shuffle(builder: Any, first: Any, second: Any, lanes: tuple[int, ...]) -> Any:
    return builder.shuffle_vector(first, second, ir.Constant(ir.VectorType(_ID, len(lanes)), list(lanes)))


def _data(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    return context.make_array(kind)(context, builder, array).data


def _starts(context: Any, builder: Any, kind: Any, listed_rows: Any, at: Any) -> list[Any]:
    """Where the eight rows listed from `at` on begin."""
    data = _data(context, builder, kind, listed_rows)
    numbers = [builder.load(builder.gep(data, [builder.add(at, INT(n))])) for n in range(TOGETHER)]
    return [builder.mul(builder.sext(number, INT), INT(_ACROSS)) for number in numbers]


def _load(builder: Any, data: Any, at: Any, kind: Any) -> Any:
    value = builder.load(builder.bitcast(builder.gep(data, [at]), kind.as_pointer()))
    value.align = 8
    return value


def _store(builder: Any, value: Any, data: Any, at: Any) -> None:
    builder.store(value, builder.bitcast(builder.gep(data, [at]), value.type.as_pointer())).align = 8
