"""Lanes of a tile: those whose bond is there, and how a bond is stretched without a root and a division."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pdsolve.codegen.lanes import Lanes
from pdsolve.codegen.pull import coefficients, stretch_coefficients
from pdsolve.codegen.vector_code import call


@intrinsic
def bonded(typingctx, values, bits, tile, slot, lane):  # type: ignore[no-untyped-def]
    """A tuple of lanes, 0 in those without a bond; `bits` (tiles, k) are uint16, `lane` is the first of the lanes."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        count = values.dtype.count
        view = context.make_array(bits)(context, builder, arguments[1])
        at = builder.add(builder.mul(arguments[2], builder.extract_value(view.shape, 1)), arguments[3])
        word = builder.load(builder.gep(view.data, [at]))
        lane_bits = builder.lshr(word, builder.trunc(arguments[4], word.type))
        lane_bits = builder.trunc(lane_bits, ir.IntType(count)) if count < word.type.width else lane_bits
        which = builder.bitcast(lane_bits, ir.VectorType(ir.IntType(1), count))
        masked_values = []
        for number in range(len(values)):
            value = builder.extract_value(arguments[0], number)
            masked_values.append(builder.select(which, value, ir.Constant(value.type, [0.0] * count)))
        return context.make_tuple(builder, signature.return_type, masked_values)

    return values(values, bits, types.int64, types.int64, types.int64), generate


@intrinsic
def stretched(typingctx, e):  # type: ignore[no-untyped-def]
    """The stretch of bonds, and 1 / (1 + stretch), at |e| up to `NARROW`."""
    assert isinstance(e, Lanes)
    precision = "float32" if e.kind == types.float32 else "float64"

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        (e_value,) = values

        def polynomial(factors: tuple[float, ...]) -> Any:
            every = [ir.Constant(e_value.type, [factor] * e.count) for factor in factors]
            value = every[-1]
            for factor in every[-2::-1]:
                value = call(builder, "fmuladd", value, e_value, factor)
            return value

        stretch = builder.fmul(e_value, polynomial(stretch_coefficients(precision)))
        ones = ir.Constant(e_value.type, [1.0] * e.count)
        inverse = call(builder, "fmuladd", builder.fneg(e_value), polynomial(coefficients(precision)[0]), ones)
        return context.make_tuple(builder, signature.return_type, [stretch, inverse])

    return types.UniTuple(e, 2)(e), generate


@intrinsic
def magnitude(typingctx, e):  # type: ignore[no-untyped-def]
    """|e| in lanes."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return call(builder, "fabs", *values)

    return e(e), generate
