"""The innermost loop of clipped bonds as vector code: x, y and z of one piece in a vector.

u, force    (q, 4) displacements of points, m, and forces on them, N; the last column of u is 0
xi          (g, 4) xi, m, and 1 / |xi|^2
i, j, row   points at the ends of the piece, and its row of xi;    k   its stiffness, N/m
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pdsolve.codegen.pull import NARROW, coefficients
from pdsolve.codegen.vector_code import INT, call, repeat

ACROSS = 4
_DOUBLE, _ID = ir.DoubleType(), ir.IntType(32)
_VECTOR = ir.VectorType(_DOUBLE, ACROSS)


@intrinsic
def add_piece(typingctx, u, force, xi, i, j, row, k):  # type: ignore[no-untyped-def]
    """Add the forces of a piece on its ends; its e."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        arrays = zip(signature.args[:3], values[:3], strict=True)
        where, forces, ways = (context.make_array(kind)(context, builder, array).data for kind, array in arrays)
        first, second, way, stiffness = values[3:]
        eta = builder.fsub(*(_load(builder, _at(builder, where, point)) for point in (second, first)))
        reference = _load(builder, _at(builder, ways, way))
        along = builder.fmul(call(builder, "fmuladd", ir.Constant(_VECTOR, [2.0] * ACROSS), reference, eta), eta)
        x, y, z, inverse = (
            *(builder.extract_element(along, _ID(axis)) for axis in range(3)),
            builder.extract_element(reference, _ID(3)),
        )
        e = builder.fmul(inverse, builder.fadd(builder.fadd(x, y), z))
        pull = builder.fmul(stiffness, builder.fmul(e, _shortened(builder, e)))
        on = builder.fmul(repeat(builder, _VECTOR, pull), builder.fadd(reference, eta))
        for point, sign in ((first, builder.fadd), (second, builder.fsub)):
            place = _at(builder, forces, point)
            builder.store(sign(_load(builder, place), on), place).align = 8
        return e

    numbers = (types.int64,) * 3
    return types.float64(u, force, xi, *numbers, types.float64), generate


def _shortened(builder: ir.IRBuilder, e: Any) -> Any:
    """1 / (1 + e + sqrt(1 + e)), by a polynomial where that holds."""
    near = builder.fcmp_ordered("<", call(builder, "fabs", e), _DOUBLE(NARROW))
    with builder.if_else(near, likely=True) as (then, otherwise):
        with then:
            factors = coefficients("float64")[0]
            inner = _DOUBLE(factors[-1])
            for factor in factors[-2::-1]:
                inner = call(builder, "fmuladd", inner, e, _DOUBLE(factor))
            from_inner = builder.block
        with otherwise:
            q2 = builder.fadd(_DOUBLE(1.0), e)
            outer = builder.fdiv(_DOUBLE(1.0), builder.fadd(q2, call(builder, "sqrt", q2)))
            from_outer = builder.block
    found = builder.phi(_DOUBLE)
    found.add_incoming(inner, from_inner)
    found.add_incoming(outer, from_outer)
    return found


def _at(builder: ir.IRBuilder, data: Any, row: Any) -> Any:
    """Address of a row (4,)."""
    return builder.bitcast(builder.gep(data, [builder.mul(row, INT(ACROSS))]), _VECTOR.as_pointer())


def _load(builder: ir.IRBuilder, place: Any) -> Any:
    value = builder.load(place)
    value.align = 8
    return value
