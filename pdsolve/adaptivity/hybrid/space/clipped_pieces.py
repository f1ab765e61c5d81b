"""The innermost loop of clipped bonds as vector code: eight pieces with the same near end at a time.

u, force    (q, 4) displacements of points, m, and forces on them, N; the last column of u is minus half the strain of
            free points, if pieces swell
xi          (g, 4) xi from the near end to the far one, m, and 1 / |xi|^2
far, row    (p,) points at the far ends of pieces, and their rows of xi
k, breaks   (p,) stiffness, N/m, and the least e at which bonds soften or break over that of the piece's
top         (8,) the largest of e times `limit_ratio` so far
at, near    the first of the eight, and the point at their near end
swelling    None, or an array: pieces swell
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pdsolve.codegen.inner_functions import is_none
from pdsolve.codegen.vector_code import INT, call
from pdsolve.lattice.force_polynomials import NARROW, coefficients

TOGETHER = 8
_ACROSS = 4
_DOUBLE, _ID = ir.DoubleType(), ir.IntType(32)
_ROW, _ROWS = ir.VectorType(_DOUBLE, _ACROSS), ir.VectorType(_DOUBLE, TOGETHER)
# of two vectors, the even and the odd entries in pairs; and the first and the last two of each half
_EVEN, _ODD = (0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)
_FIRST, _LAST = (0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)


@intrinsic
def add_forces_of_eight_bond_pieces(  # type: ignore[no-untyped-def]
    typingctx, u, force, xi, far_points, row, k, limit_ratio, largest, at, near_point, swelling
):
    """Add the forces of eight pieces on their ends."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        arrays = zip(signature.args[:8], values[:8], strict=True)
        data = [context.make_array(kind)(context, builder, array).data for kind, array in arrays]
        _add(builder, data, values[8], values[9], not is_none(swelling))
        return context.get_dummy_value()

    numbers = types.int64, types.int64
    return types.void(u, force, xi, far_points, row, k, limit_ratio, largest, *numbers, swelling), generate


def _add(builder: ir.IRBuilder, data: list[Any], at: Any, near_point: Any, swells: bool) -> None:
    where, force, ways, far_points, row, k, limit_ratio, largest = data
    others = [_load_integer(builder, far_points, at, n) for n in range(TOGETHER)]
    near_u = _load(builder, where, builder.mul(near_point, INT(_ACROSS)), _ROW)
    far_u = _columns(builder, [_load(builder, where, builder.mul(j, INT(_ACROSS)), _ROW) for j in others])
    eta = [builder.fsub(far_off, _emit_broadcast(builder, near_u, axis)) for axis, far_off in enumerate(far_u[:3])]
    of = (builder.mul(_load_integer(builder, row, at, n), INT(_ACROSS)) for n in range(TOGETHER))
    *reference, inverse = _columns(builder, [_load(builder, ways, row_start, _ROW) for row_start in of])
    if swells:
        shrink = builder.fadd(far_u[3], _emit_broadcast(builder, near_u, 3))
        eta = [_emit_fused_multiply_add(builder, shrink, x, y) for x, y in zip(reference, eta, strict=True)]
    e = _llvm_constant_vector(0.0)
    for x, y in zip(reference, eta, strict=True):
        e = _emit_fused_multiply_add(builder, _emit_fused_multiply_add(builder, _llvm_constant_vector(2.0), x, y), y, e)
    e = builder.fmul(inverse, e)
    risk, before = builder.fmul(_load(builder, limit_ratio, at, _ROWS), e), _load(builder, largest, INT(0), _ROWS)
    _emit_vector_store(builder, call(builder, "maxnum", before, risk), largest, INT(0))
    pull = builder.fmul(_load(builder, k, at, _ROWS), builder.fmul(e, _emit_secant_factor(builder, e)))
    on = [builder.fmul(pull, builder.fadd(x, y)) for x, y in zip(reference, eta, strict=True)]
    forces = _rows(builder, [*on, _llvm_constant_vector(0.0)])
    for j, force_row in zip(others, forces, strict=True):
        place = builder.mul(j, INT(_ACROSS))
        _emit_vector_store(builder, builder.fsub(_load(builder, force, place, _ROW), force_row), force, place)
    while len(forces) > 1:
        forces = [builder.fadd(*forces[n : n + 2]) for n in range(0, len(forces), 2)]
    place = builder.mul(near_point, INT(_ACROSS))
    _emit_vector_store(builder, builder.fadd(_load(builder, force, place, _ROW), forces[0]), force, place)


def _emit_secant_factor(builder: ir.IRBuilder, e: Any) -> Any:
    """1 / (1 + e + sqrt(1 + e)), by a polynomial where that holds."""
    began, (exact, done) = builder.block, (builder.function.append_basic_block(name) for name in ("exact", "done"))
    factors = coefficients("float64")[0]
    inner = _llvm_constant_vector(factors[-1])
    for factor in factors[-2::-1]:
        inner = _emit_fused_multiply_add(builder, inner, e, _llvm_constant_vector(factor))
    beyond = builder.fcmp_unordered(">", call(builder, "fabs", e), _llvm_constant_vector(NARROW))
    bits = ir.IntType(TOGETHER)
    builder.cbranch(builder.icmp_unsigned("!=", builder.bitcast(beyond, bits), bits(0)), exact, done)
    builder.position_at_end(exact)
    q2 = builder.fadd(_llvm_constant_vector(1.0), e)
    root = builder.fdiv(_llvm_constant_vector(1.0), builder.fadd(q2, call(builder, "sqrt", q2)))
    outer = builder.select(beyond, root, inner)
    builder.branch(done)
    builder.position_at_end(done)
    quotient = builder.phi(_ROWS)
    quotient.add_incoming(inner, began)
    quotient.add_incoming(outer, exact)
    return quotient


def _columns(builder: ir.IRBuilder, rows: list[Any]) -> list[Any]:
    """The four columns of eight rows."""
    every = tuple(range(TOGETHER))
    a, b, c, d = (_emit_shuffle(builder, rows[n], rows[n + _ACROSS], every) for n in range(_ACROSS))
    return [
        _emit_shuffle(builder, _emit_shuffle(builder, a, b, pairs), _emit_shuffle(builder, c, d, pairs), halves)
        for halves in (_FIRST, _LAST)
        for pairs in (_EVEN, _ODD)
    ]


def _rows(builder: ir.IRBuilder, columns: list[Any]) -> list[Any]:
    """The eight rows of four columns."""
    x, y, z, w = columns
    row_pairs = []
    for halves in (_FIRST, _LAST):
        xz, yw = _emit_shuffle(builder, x, z, halves), _emit_shuffle(builder, y, w, halves)
        row_pairs += [_emit_shuffle(builder, xz, yw, pairs) for pairs in (_EVEN, _ODD)]
    nothing = ir.Constant(_ROWS, ir.Undefined)
    return [
        _emit_shuffle(builder, row_pair, nothing, tuple(range(first, first + _ACROSS)))
        for first in (0, _ACROSS)
        for row_pair in row_pairs
    ]


def _emit_shuffle(builder: ir.IRBuilder, first: Any, second: Any, lanes: tuple[int, ...]) -> Any:
    return builder.shuffle_vector(first, second, ir.Constant(ir.VectorType(_ID, len(lanes)), list(lanes)))


def _emit_broadcast(builder: ir.IRBuilder, row: Any, entry: int) -> Any:
    """An entry of a row in all eight."""
    return _emit_shuffle(builder, row, ir.Constant(_ROW, ir.Undefined), (entry,) * TOGETHER)


def _llvm_constant_vector(number: float) -> Any:
    return ir.Constant(_ROWS, [number] * TOGETHER)


def _emit_fused_multiply_add(builder: ir.IRBuilder, a: Any, b: Any, c: Any) -> Any:
    return call(builder, "fmuladd", a, b, c)


def _load_integer(builder: ir.IRBuilder, data: Any, at: Any, offset: int) -> Any:
    return builder.sext(builder.load(builder.gep(data, [builder.add(at, INT(offset))])), INT)


def _load(builder: ir.IRBuilder, data: Any, at: Any, kind: Any) -> Any:
    value = builder.load(builder.bitcast(builder.gep(data, [at]), kind.as_pointer()))
    value.align = 8
    return value


def _emit_vector_store(builder: ir.IRBuilder, value: Any, data: Any, at: Any) -> None:
    builder.store(value, builder.bitcast(builder.gep(data, [at]), value.type.as_pointer())).align = 8
