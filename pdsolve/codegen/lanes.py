"""Lanes as a number type of compiled code: a law's function of one bond then computes as many as fit into registers.

A function that adds, multiplies, divides and takes roots accepts numbers and lanes alike. Each product and each sum of
such a function is rounded, on every processor: contracted ones gain little. For compiled code only; arrays are
(rows, m), row after row.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.datamodel import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, overload

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import INT, ROW, call, lanes_at_once, repeat

_ID = ir.IntType(32)
_DOUBLES = lanes_at_once(8)


class Lanes(types.Type):
    """Several numbers of one type, side by side."""

    def __init__(self, kind: Any, count: int = 0) -> None:
        """`count` is 0 for as many as are summed at once."""
        self.kind, self.count = kind, count or lanes_at_once(kind.bitwidth // 8)
        super().__init__(name=f"Lanes({kind}, {self.count})")


@register_default(Lanes)
class _Model(PrimitiveModel):
    """A vector, which compilers split to the processor's width."""

    def __init__(self, manager: Any, fe_type: Lanes) -> None:
        element = ir.FloatType() if fe_type.kind == types.float32 else ir.DoubleType()
        super().__init__(manager, fe_type, ir.VectorType(element, fe_type.count))


def _infer(function: Any) -> None:
    """Let a function of two numbers accept lanes for either of them."""

    @infer_global(function)
    class _Both(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            lanes = next((kind for kind in args if isinstance(kind, Lanes)), None)
            if lanes is None or len(args) != 2 or kws:
                return None
            kinds = (kind if isinstance(kind, Lanes) else lanes.kind for kind in args)
            return signature(lanes, *kinds)


def _lower(function: Any, instruction: str) -> None:
    def both(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(signature.return_type)
        wide = [
            value if isinstance(kind, Lanes) else repeat(builder, vector, value)
            for kind, value in zip(signature.args, values, strict=True)
        ]
        return getattr(builder, instruction)(*wide)

    for kinds in ((Lanes, Lanes), (Lanes, types.Float), (types.Float, Lanes)):
        lower_builtin(function, *kinds)(both)


for _functions, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _function in _functions:
        _infer(_function)
        _lower(_function, _instruction)


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None


@lower_builtin(operator.neg, Lanes)
def _negated(context, builder, signature, values):  # type: ignore[no-untyped-def]
    return builder.fneg(values[0])


@intrinsic
def root(typingctx, lanes):  # type: ignore[no-untyped-def]
    """The square root of each lane."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return call(builder, "sqrt", *values)

    return lanes(lanes), generate


@overload(np.sqrt)
def _root(lanes):  # type: ignore[no-untyped-def]
    return (lambda lanes: root(lanes)) if isinstance(lanes, Lanes) else None


@intrinsic
def magnitude(typingctx, e):  # type: ignore[no-untyped-def]
    """|e| in lanes."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return call(builder, "fabs", *values)

    return e(e), generate


@intrinsic
def same(typingctx, array, number):  # type: ignore[no-untyped-def]
    """A number in all lanes, in the type of an array's elements or of other lanes."""
    lanes = array if isinstance(array, Lanes) else Lanes(array.dtype)

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        scalar = context.cast(builder, values[1], number, lanes.kind)
        return repeat(builder, context.get_value_type(lanes), scalar)

    return lanes(array, number), generate


@intrinsic
def unless_none(typingctx, weight, value, replacement):  # type: ignore[no-untyped-def]
    """`value` in lanes with a nonzero weight, `replacement` in the rest."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        none = ir.Constant(values[0].type, [0.0] * values[0].type.count)
        return builder.select(builder.fcmp_unordered("!=", values[0], none), values[1], values[2])

    return value(weight, value, replacement), generate


@intrinsic
def larger(typingctx, a, b):  # type: ignore[no-untyped-def]
    """a in lanes where it is more than b, else b."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered(">", *values), *values)

    return a(a, b), generate


@intrinsic
def where_above(typingctx, a, b, value, replacement):  # type: ignore[no-untyped-def]
    """`value` in lanes where a > b, `replacement` in the rest."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered(">", *values[:2]), *values[2:])

    return value(a, b, value, replacement), generate


@intrinsic
def which_above(typingctx, a, b):  # type: ignore[no-untyped-def]
    """A bit for each lane, from the lowest on: whether a > b."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        which = builder.fcmp_ordered(">", *values)
        return builder.zext(builder.bitcast(which, ir.IntType(a.count)), INT)

    return types.int64(a, b), generate


@intrinsic
def trailing_zeros(typingctx, bits):  # type: ignore[no-untyped-def]
    """Number of the lowest bit that is set."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


def _row(context: Any, builder: Any, kind: Any, array: Any, row: int) -> Any:
    """Address of the beginning of an array's row."""
    array_struct = context.make_array(kind)(context, builder, array)
    stride = builder.extract_value(array_struct.strides, 0)
    begin = builder.gep(
        builder.bitcast(array_struct.data, cgutils.voidptr_t), [builder.mul(stride, ir.Constant(stride.type, row))]
    )
    return builder.bitcast(begin, array_struct.data.type)


def _place(builder: Any, row: Any, at: Any, vector: Any) -> Any:
    return builder.bitcast(builder.gep(row, [at]), vector.as_pointer())


@intrinsic
def beside(typingctx, array, like, at):  # type: ignore[no-untyped-def]
    """Lanes from `at` on, of as many rows of an array as a tuple has entries."""
    lanes = Lanes(array.dtype)
    tuple_type = types.UniTuple(lanes, len(like))

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector, vectors = context.get_value_type(lanes), []
        for number in range(len(like)):
            row = _row(context, builder, array, values[0], number)
            value = builder.load(_place(builder, row, values[2], vector))
            value.align = array.dtype.bitwidth // 8
            vectors.append(value)
        return context.make_tuple(builder, tuple_type, vectors)

    return tuple_type(array, like, types.int64), generate


@intrinsic
def listed(typingctx, array, like, ids, at):  # type: ignore[no-untyped-def]
    """Lanes of the nodes listed in `ids` (., 16), from element `at` on; one row of the array each."""
    lanes = Lanes(array.dtype)
    tuple_type = types.UniTuple(lanes, len(like))

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(lanes)
        numbers = context.make_array(ids)(context, builder, values[2]).data
        nodes = [
            builder.sext(builder.load(builder.gep(numbers, [builder.add(values[3], INT(lane))])), INT)
            for lane in range(lanes.count)
        ]
        vectors = []
        for number in range(len(like)):
            row, value = _row(context, builder, array, values[0], number), ir.Constant(vector, ir.Undefined)
            for lane, node in enumerate(nodes):
                value = builder.insert_element(value, builder.load(builder.gep(row, [node])), _ID(lane))
            vectors.append(value)
        return context.make_tuple(builder, tuple_type, vectors)

    return tuple_type(array, like, ids, types.int64), generate


@intrinsic
def keep(typingctx, values, array, at):  # type: ignore[no-untyped-def]
    """Store a tuple of lanes in the first rows of an array, from `at` on."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        for number, value in enumerate(cgutils.unpack_tuple(builder, arguments[0])):
            row = _row(context, builder, array, arguments[1], number)
            done = builder.store(value, _place(builder, row, arguments[2], value.type))
            done.align = array.dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.void(values, array, types.int64), generate


@intrinsic
def repeated(typingctx, array, like, row):  # type: ignore[no-untyped-def]
    """Numbers of a row of an array (., c), each in all lanes: as many as a tuple has entries."""
    lanes = Lanes(array.dtype)
    tuple_type = types.UniTuple(lanes, len(like))

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(lanes)
        array_struct = context.make_array(array)(context, builder, values[0])
        begin = builder.mul(values[2], builder.extract_value(array_struct.shape, 1))
        numbers = [builder.load(builder.gep(array_struct.data, [builder.add(begin, INT(c))])) for c in range(len(like))]
        return context.make_tuple(builder, tuple_type, [repeat(builder, vector, number) for number in numbers])

    return tuple_type(array, like, types.int64), generate


@intrinsic
def stacked(typingctx, array, like, row, lane):  # type: ignore[no-untyped-def]
    """Lanes from `lane` on of entry `row` of an array (., c, 64): as many rows as a tuple has entries."""
    lanes = Lanes(array.dtype)
    tuple_type = types.UniTuple(lanes, len(like))

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(lanes)
        array_struct = context.make_array(array)(context, builder, values[0])
        wide = builder.extract_value(array_struct.shape, 2)
        begin = builder.mul(builder.mul(values[2], builder.extract_value(array_struct.shape, 1)), wide)
        begin, vectors = builder.add(begin, values[3]), []
        for c in range(len(like)):
            at = builder.add(begin, builder.mul(wide, INT(c)))
            value = builder.load(_place(builder, array_struct.data, at, vector))
            value.align = array.dtype.bitwidth // 8
            vectors.append(value)
        return context.make_tuple(builder, tuple_type, vectors)

    return tuple_type(array, like, types.int64, types.int64), generate


def _lane_bits(context: Any, builder: Any, bits: Any, arguments: Any, count: int) -> Any:
    """Bits of `count` lanes from one on, from a table of words of 16 lanes, a row and a column of it, and the lane."""
    view = context.make_array(bits)(context, builder, arguments[0])
    at = builder.add(builder.mul(arguments[1], builder.extract_value(view.shape, 1)), arguments[2])
    word = builder.load(builder.gep(view.data, [at]))
    lane_bits = builder.lshr(word, builder.trunc(arguments[3], word.type))
    return builder.trunc(lane_bits, ir.IntType(count)) if count < word.type.width else lane_bits


def _masked(inverted: bool) -> Any:
    """A tuple of lanes, 0 in those whose bit is not set, or is if `inverted`."""

    @intrinsic
    def masked(typingctx, values, bits, tile, slot, lane):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            count = values.dtype.count
            lane_bits = _lane_bits(context, builder, bits, arguments[1:], count)
            lane_bits = builder.not_(lane_bits) if inverted else lane_bits
            which = builder.bitcast(lane_bits, ir.VectorType(ir.IntType(1), count))
            masked_values = []
            for number in range(len(values)):
                value = builder.extract_value(arguments[0], number)
                masked_values.append(builder.select(which, value, ir.Constant(value.type, [0.0] * count)))
            return context.make_tuple(builder, signature.return_type, masked_values)

        return values(values, bits, types.int64, types.int64, types.int64), generate

    return masked


# 0 in lanes without a bond, and in those whose bond is cut; `bits` (tiles, k) are uint16, `lane` is the first lane
bonded, uncut = _masked(False), _masked(True)


@njit(**INNER)
def across(s):  # type: ignore[no-untyped-def]
    """Number of lanes summed at once into this scratch."""
    return _DOUBLES if s.itemsize == 8 else ROW
