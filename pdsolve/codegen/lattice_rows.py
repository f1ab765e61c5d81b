"""Forces on 16 consecutive nodes as vector code, their sums kept in registers.

    u        (2, m) displacements of all places         table    (k, 8) springs, as in `family.Springs`
    ways     (k,) places from a node to its neighbours   weights  (., k, 16) stiffnesses of the lanes' own, 0 without a
    at       where those of the row begin, if it has              bond
             its own                                     masks    (., 2, k) a bit for each lane with a bond, and for
    limit    of e                                                 each with half a bond
    p        place of the first lane                     s        scratch: forces, x then y
    shrink   (m,) minus half the strain of a free node:
             a bond is relieved of that of both ends; or None

Each returns 1 where |e| is beyond what it can do, so that its sums are wrong, plus 2 where an e is above the limit.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pdsolve.codegen.pull import NARROW, WIDE
from pdsolve.codegen.vector_code import INT, ROW, Code

FY = ROW  # where the sums along y begin in s
WHOLE, MASKED, OWN = range(3)  # rows: all lanes have all springs; those of the table, half of them, or none; others


class _Sum:
    """Generator of the loop over the springs of some lanes."""

    def __init__(self, code: Code, kinds: Any, values: Any, kind: int, edges: Any) -> None:
        self._code, self._kind, self._edges = code, kind, edges
        u = kinds[0]
        self._u = [code.data(u, values[0], axis) for axis in (0, 1)]
        self._table, self._ways, self._weights = (
            code.data(kind, value) for kind, value in zip(kinds[1:4], values[1:4], strict=True)
        )
        self._shrink = None if isinstance(kinds[4], types.NoneType) else code.data(kinds[4], values[4])
        self._slots, self._at, self._p, self._limit = values[5:9]
        self._here = [code.load(component, self._p) for component in self._u]
        self._own = [] if self._shrink is None else code.load(self._shrink, self._p)

    def run(self, reach: float | None, factors: tuple[float, ...], kept: Any) -> Any:
        """Emit the sum with the pull e g(e), g a polynomial valid up to |e| = `reach`; returns the results of
        `sum_row`."""
        code, builder = self._code, self._code.builder
        began, function = builder.block, builder.function
        head, add, leave = (function.append_basic_block(name) for name in ("head", "add", "leave"))
        builder.branch(head)
        builder.position_at_end(head)
        slot = builder.phi(INT)
        slot.add_incoming(INT(0), began)
        starts = (0.0, 0.0, -1.0, 0.0)  # an e is above -1
        sums = [code.merge([(code.same(start), began)]) for start in starts]
        builder.cbranch(builder.icmp_signed("<", slot, self._slots), add, leave)
        builder.position_at_end(add)
        after = self._added(slot, sums, factors)
        slot.add_incoming(builder.add(slot, INT(1)), add)
        for phis, totals in zip(sums, after, strict=True):
            for phi, total in zip(phis, totals, strict=True):
                phi.add_incoming(total, add)
        builder.branch(head)
        builder.position_at_end(leave)
        fx, fy, top, size = sums
        code.store(fx, kept, INT(0))
        code.store(fy, kept, INT(FY))
        over = builder.zext(code.some(code.above(top, code.same(self._limit))), INT)
        flags = builder.mul(over, INT(2))
        if reach is None:
            return flags
        far = builder.zext(code.some(code.above(size, code.same(reach))), INT)
        return builder.add(flags, far)

    def _added(self, slot: Any, sums: list[Any], factors: tuple[float, ...]) -> list[Any]:
        code, builder = self._code, self._code.builder
        row = builder.mul(slot, INT(8))
        xi_x, xi_y, x2, y2, inverse, stiffness = (
            code.same(builder.load(builder.gep(self._table, [builder.add(row, INT(c))]))) for c in range(6)
        )
        neighbour = builder.add(self._p, builder.load(builder.gep(self._ways, [slot])))
        eta_x, eta_y = (
            code.sub(code.load(component, neighbour), near) for component, near in zip(self._u, self._here, strict=True)
        )
        if self._shrink is not None:
            both = code.add(code.load(self._shrink, neighbour), self._own)
            eta_x, eta_y = code.fma(both, xi_x, eta_x), code.fma(both, xi_y, eta_y)
        along_x = code.mul(code.fma(inverse, eta_x, x2), eta_x)
        e = code.fma(code.fma(inverse, eta_y, y2), eta_y, along_x)
        if self._kind == MASKED:
            at, lane = builder.add(self._at, slot), builder.and_(self._p, INT(ROW - 1))
            has_bond, half = (code.bits(self._weights, where, lane) for where in (at, builder.add(at, self._slots)))
            stiffness = code.choose(half, code.mul(stiffness, code.same(0.5)), stiffness)
            stiffness = code.choose(has_bond, stiffness, code.same(0.0))
            e = code.choose(has_bond, e, code.same(0.0))
        elif self._kind == OWN:
            stiffness = code.load(self._weights, builder.add(self._at, builder.mul(slot, INT(ROW))))
            none = code.each(lambda one, zero: builder.fcmp_ordered("==", one, zero), stiffness, code.same(0.0))
            e = code.choose(none, code.same(0.0), e)
        over = e
        if self._edges is not None:
            over = code.sub(e, code.load(self._edges, builder.add(self._at, builder.mul(slot, INT(ROW)))))
        fx, fy, top, size = sums
        pull = code.mul(code.mul(stiffness, e), code.polynomial(factors, e))
        return [
            code.fma(pull, code.add(xi_x, eta_x), fx),
            code.fma(pull, code.add(xi_y, eta_y), fy),
            code.most(top, over),
            code.most(size, code.magnitude(e)),
        ]


def _generator(kind: int, which: int | None, varied: bool = False) -> Any:
    """A code generator for a row of this `kind`.

    `which` is the index of the polynomial (None: Green's strain); `varied` selects limits for each bond instead of one.
    """

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        kinds, values = list(signature.args), list(values)
        code, edges = Code(context, builder, kinds[0].dtype), None
        if varied:
            edges = code.data(kinds.pop(4), values.pop(4))
        loop = _Sum(code, kinds, values, kind, edges)
        scratch = code.data(kinds[9], values[9])
        if which is None:
            return loop.run(None, (0.5,), scratch)
        return loop.run((NARROW, WIDE)[which], code.coefficients[which], scratch)

    return generate


def _row(kind: int, which: int | None) -> Any:
    """The loop over a row of this `kind` for one limit; see `_generator`."""

    @intrinsic
    def add(typingctx, u, table, ways, weights, shrink, slots, at, p, limit, s):  # type: ignore[no-untyped-def]
        numbers = (types.int64,) * 3
        signature = types.int64(u, table, ways, weights, shrink, *numbers, u.dtype, s)
        return signature, _generator(kind, which)

    return add


def _row_of_edges(which: int) -> Any:
    """The loop over a row with its own stiffnesses and `edges` (., k, 16)."""

    @intrinsic
    def add(typingctx, u, table, ways, weights, edges, shrink, slots, at, p, limit, s):  # type: ignore[no-untyped-def]
        numbers = (types.int64,) * 3
        signature = types.int64(u, table, ways, weights, edges, shrink, *numbers, u.dtype, s)
        return signature, _generator(OWN, which, True)

    return add


# Sum the forces on a row whose lanes have all springs of the table, for |e| up to NARROW, and up to WIDE
sum_whole, sum_whole_wide = _row(WHOLE, 0), _row(WHOLE, 1)
# On a row whose lanes have springs of the table, half springs, or none; `weights` are masks
sum_masked, sum_masked_wide = _row(MASKED, 0), _row(MASKED, 1)
# On a row with its own stiffnesses
sum_own, sum_own_wide = _row(OWN, 0), _row(OWN, 1)
# Likewise; the result 2 means that an e exceeds the edge of its bond by more than `limit`
sum_edges, sum_edges_wide = _row_of_edges(0), _row_of_edges(1)
# On a coarse row by Green's strain, force k e / 2 (xi + eta): whole, and with its own stiffnesses
sum_green, sum_green_own = _row(WHOLE, None), _row(OWN, None)
