"""The bond of a lattice in some lanes: how far it is stretched, and what it pulls with.

One description for the plane and for space: tuples have one entry of lanes for each axis, and code is generated for as
many as there are. Products and sums that are fused here are so on every processor that can.

xi      reference vector of a bond, m
eta     displacement of its far end less that of its near end, m
e       (2 xi.eta + eta.eta) / xi.xi, so that 1 + e is the square of the ratio of lengths
row     of a slot: xi, 2 xi / xi.xi, 1 / xi.xi; then, in blocks and of families, |xi| and 1 / |xi|, or (FIELDS,) in
        tiles the stiffness over length w, and w n_a^2 / 2 for each axis a with the direction n of the bond
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, overload, register_jitable

from pdsolve.codegen.inner_functions import INNER, is_none
from pdsolve.codegen.lanes import Lanes, beside, keep, same, where_above
from pdsolve.codegen.vector_code import INT, ROW, call, join, lanes_of_register, repeat, split
from pdsolve.lattice.force_polynomials import WIDE, coefficients, stretch_coefficients

FIELDS = 12  # of a row
IN_PLACE = INNER | {"forceinline": True}  # how functions of a bond are compiled: into the loop that calls them


@register_jitable
def where_inverse(dimension: int) -> int:
    """Where 1 / xi.xi is in a row."""
    return 2 * dimension


@register_jitable
def where_weight(dimension: int) -> int:
    """Where the stiffness over length is in a row; what it is with corrections along each axis follows."""
    return 2 * dimension + 1


def _entries(context: Any, builder: Any, kind: Any, row: Any, vector: Any, first: int, count: int) -> list[Any]:
    """So many entries of a row from `first` on, each in all lanes; or, of a tuple, those of each lane."""
    if isinstance(kind, types.BaseTuple):
        return list(cgutils.unpack_tuple(builder, row)[first : first + count])
    data = context.make_array(kind)(context, builder, row).data
    numbers = (builder.load(builder.gep(data, [INT(first + axis)])) for axis in range(count))
    return [repeat(builder, vector, number) for number in numbers]


@intrinsic
def difference(typingctx, a, b):  # type: ignore[no-untyped-def]
    """a - b of two vectors."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        pairs = zip(*(cgutils.unpack_tuple(builder, value) for value in values), strict=True)
        return context.make_tuple(builder, signature.return_type, [builder.fsub(x, y) for x, y in pairs])

    return a(a, b), generate


@intrinsic
def elongation(typingctx, eta, row):  # type: ignore[no-untyped-def]
    """The e of a bond from its eta."""
    lanes = eta.dtype

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector, d = context.get_value_type(lanes), len(eta)
        doubled = _entries(context, builder, row, values[1], vector, d, d)
        (inverse,) = _entries(context, builder, row, values[1], vector, where_inverse(d), 1)
        first, *rest = zip(cgutils.unpack_tuple(builder, values[0]), doubled, strict=True)
        e = builder.fmul(call(builder, "fmuladd", inverse, *first), first[0])
        for along, x in rest:
            e = call(builder, "fmuladd", call(builder, "fmuladd", inverse, along, x), along, e)
        return e

    return lanes(eta, row), generate


@intrinsic
def pulled(typingctx, f, pull, eta, row):  # type: ignore[no-untyped-def]
    """f + pull (xi + eta)."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(eta.dtype)
        reference = _entries(context, builder, row, values[3], vector, 0, len(eta))
        totals, relative = (cgutils.unpack_tuple(builder, values[number]) for number in (0, 2))
        axes = zip(totals, relative, reference, strict=True)
        after = [call(builder, "fmuladd", values[1], builder.fadd(x, along), total) for total, along, x in axes]
        return context.make_tuple(builder, signature.return_type, after)

    return f(f, pull, eta, row), generate


@intrinsic
def relieved(typingctx, eta, relief, row):  # type: ignore[no-untyped-def]
    """eta + `relief` xi."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        vector = context.get_value_type(eta.dtype)
        reference = _entries(context, builder, row, values[2], vector, 0, len(eta))
        axes = zip(cgutils.unpack_tuple(builder, values[0]), reference, strict=True)
        after = [call(builder, "fmuladd", values[1], x, along) for along, x in axes]
        return context.make_tuple(builder, signature.return_type, after)

    return eta(eta, relief, row), generate


@intrinsic
def corrected_weight(typingctx, row, c, c_own):  # type: ignore[no-untyped-def]
    """The stiffness over length of a bond whose ends have the corrections c and `c_own` along each axis."""
    lanes = c.dtype

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        first = where_weight(len(c)) + 1
        shares = _entries(context, builder, row, values[0], context.get_value_type(lanes), first, len(c))
        both = zip(*(cgutils.unpack_tuple(builder, value) for value in values[1:]), strict=True)
        sums = [builder.fadd(far, near) for far, near in both]
        weight = builder.fmul(shares[0], sums[0])
        for share, total in zip(shares[1:], sums[1:], strict=True):
            weight = call(builder, "fmuladd", share, total, weight)
        return weight

    return lanes(row, c, c_own), generate


@intrinsic
def advanced(typingctx, values, rates, dt):  # type: ignore[no-untyped-def]
    """`values` + dt `rates` of two vectors, each product and each sum rounded."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pairs = zip(*(cgutils.unpack_tuple(builder, tuple_value) for tuple_value in arguments[:2]), strict=True)
        after = [builder.fadd(x, builder.fmul(arguments[2], rate)) for x, rate in pairs]
        return context.make_tuple(builder, signature.return_type, after)

    return values(values, rates, dt), generate


def _by_each_lane(instruction: str) -> Any:
    """A vector times a number of each lane, or over it."""

    @intrinsic
    def by_each_lane(typingctx, vector, number):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
            entries = [
                getattr(builder, instruction)(entry, values[1]) for entry in cgutils.unpack_tuple(builder, values[0])
            ]
            return context.make_tuple(builder, signature.return_type, entries)

        return vector(vector, number), generate

    return by_each_lane


divided, multiplied = _by_each_lane("fdiv"), _by_each_lane("fmul")


@njit(**IN_PLACE)
def kick_and_drift(u, next_u, v, next_v, a, dt, axes, at):  # type: ignore[no-untyped-def]
    """The second half kick of a step and the first half kick and drift of the next one, for the lanes at the places
    from `at` on with accelerations a; each product and each sum rounded."""
    half = same(u, dt / 2)
    speed = advanced(advanced(beside(v, axes, at), a, half), a, half)
    keep(speed, next_v, at)
    keep(advanced(beside(u, axes, at), speed, same(u, dt)), next_u, at)


@intrinsic
def zeros(typingctx, array, like):  # type: ignore[no-untyped-def]
    """A zero vector of as many axes as a tuple has entries, in the type of an array's elements or of lanes."""
    vectors = types.UniTuple(array if isinstance(array, Lanes) else Lanes(array.dtype), len(like))

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        zero = ir.Constant(context.get_value_type(vectors.dtype), [0.0] * vectors.dtype.count)
        return context.make_tuple(builder, vectors, [zero] * len(like))

    return vectors(array, like), generate


@intrinsic
def sums_in(typingctx, s, like):  # type: ignore[no-untyped-def]
    """The sums of forces at the beginning of a scratch as an array (d, 16); a tuple has d entries."""
    view = types.Array(s.dtype, 2, "C")

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        data = context.make_array(s)(context, builder, values[0]).data
        sums, size = context.make_array(view)(context, builder), s.dtype.bitwidth // 8
        shape, strides = [INT(len(like)), INT(ROW)], [INT(ROW * size), INT(size)]
        context.populate_array(sums, data=data, shape=shape, strides=strides, itemsize=INT(size), meminfo=None)
        return sums._getvalue()

    return view(s, like), generate


@intrinsic
def where_nonzero(typingctx, weight, vector):  # type: ignore[no-untyped-def]
    """A vector in lanes with a nonzero weight, 0 in the rest."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        none = ir.Constant(values[0].type, [0.0] * weight.count)
        which = builder.fcmp_unordered("!=", values[0], none)
        chosen = [builder.select(which, entry, none) for entry in cgutils.unpack_tuple(builder, values[1])]
        return context.make_tuple(builder, signature.return_type, chosen)

    return vector(weight, vector), generate


@intrinsic
def entries(typingctx, row, like):  # type: ignore[no-untyped-def]
    """The first entries of a row, as many as a tuple has."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        data = context.make_array(row)(context, builder, values[0]).data
        numbers = [builder.load(builder.gep(data, [INT(number)])) for number in range(len(like))]
        return context.make_tuple(builder, signature.return_type, numbers)

    return types.UniTuple(row.dtype, len(like))(row, like), generate


def _polynomial(builder: Any, factors: tuple[float, ...], e: Any) -> Any:
    """A polynomial with the coefficients of 1, e, e^2 ... in each lane."""
    parts = split(builder, e)  # side by side, so that a factor is in a register once
    first, *rest = (ir.Constant(parts[0].type, [factor] * parts[0].type.count) for factor in reversed(factors))
    sums = [first] * len(parts)
    for factor in rest:
        sums = [call(builder, "fmuladd", total, part, factor) for total, part in zip(sums, parts, strict=True)]
    return join(builder, sums)


@intrinsic
def stretched(typingctx, e):  # type: ignore[no-untyped-def]
    """The stretch of bonds, and 1 / (1 + stretch), at |e| up to `NARROW`."""
    assert isinstance(e, Lanes)
    precision = "float32" if e.kind == types.float32 else "float64"

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        (e_value,) = values
        stretch = builder.fmul(e_value, _polynomial(builder, stretch_coefficients(precision), e_value))
        ones = ir.Constant(e_value.type, [1.0] * e.count)
        inverse = call(
            builder, "fmuladd", builder.fneg(e_value), _polynomial(builder, coefficients(precision)[0], e_value), ones
        )
        return context.make_tuple(builder, signature.return_type, [stretch, inverse])

    return types.UniTuple(e, 2)(e), generate


@intrinsic
def any_beyond(typingctx, a, b):  # type: ignore[no-untyped-def]
    """Whether a > b in any lane; where lanes are in one register, also whether one of both is no number."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        if a.count > lanes_of_register(a.kind.bitwidth // 8):  # whose masks are slow to join: by the sign of b - a
            integers = ir.VectorType(ir.IntType(a.kind.bitwidth), a.count)
            signs = split(builder, builder.bitcast(builder.fsub(values[1], values[0]), integers))
            some = reduce(builder.or_, signs)
            mask = builder.icmp_signed("<", some, ir.Constant(some.type, [0] * some.type.count))
        else:
            mask = builder.fcmp_unordered(">", *values)
        bits = ir.IntType(mask.type.count)
        return builder.icmp_unsigned("!=", builder.bitcast(mask, bits), bits(0))

    return types.boolean(a, b), generate


def _polynomial_up_to(number: int) -> Any:
    """g(e) = 1 / (1 + e + sqrt(1 + e)) by the polynomial for |e| up to NARROW (0) or WIDE (1)."""

    @intrinsic
    def polynomial(typingctx, e):  # type: ignore[no-untyped-def]
        factors = coefficients("float32" if e.kind == types.float32 else "float64")[number]

        def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
            return _polynomial(builder, factors, values[0])

        return e(e), generate

    return polynomial


factor_near, factor_wide = _polynomial_up_to(0), _polynomial_up_to(1)


@njit(**IN_PLACE)
def factor(u, e, size, near, nearest):  # type: ignore[no-untyped-def]
    """g(e) at any e, whose `size` is |e|: `nearest` up to `near`, then by the wide polynomial, then by a root.

    Lane by lane, so that a sum does not depend on the lanes beside it.
    """
    g, wide = where_above(size, near, factor_wide(e), nearest), same(u, WIDE)
    if any_beyond(size, wide):
        q2 = 1.0 + e
        return where_above(size, wide, 1.0 / (q2 + np.sqrt(q2)), g)
    return g


def displaced(u: Any, shrink: Any, x: Any, y: Any, i: Any, j: Any) -> Any:
    """Both components of what stretches the bond (x, y) from node i to j at displacements u (2, m)."""


@overload(displaced, jit_options=IN_PLACE)
def _displaced(u, shrink, x, y, i, j):  # type: ignore[no-untyped-def]
    if is_none(shrink):
        return lambda u, shrink, x, y, i, j: (u[0, j] - u[0, i], u[1, j] - u[1, i])

    def relieved(u, shrink, x, y, i, j):  # type: ignore[no-untyped-def]
        both = shrink[i] + shrink[j]
        return u[0, j] - u[0, i] + both * x, u[1, j] - u[1, i] + both * y

    return relieved


def displaced_along(u: Any, shrink: Any, xi: Any, i: Any, j: Any) -> Any:
    """All components of what stretches the bond xi from node i to j at displacements u (d, m)."""


@overload(displaced_along, jit_options=IN_PLACE)
def _displaced_along(u, shrink, xi, i, j):  # type: ignore[no-untyped-def]
    if len(xi) == 2:
        return lambda u, shrink, xi, i, j: displaced(u, shrink, xi[0], xi[1], i, j)

    def in_space(u, shrink, xi, i, j):  # type: ignore[no-untyped-def]
        (x, y), (_, z) = displaced(u, shrink, xi[0], xi[1], i, j), displaced(u[1:], shrink, xi[1], xi[2], i, j)
        return x, y, z

    return in_space
