"""The innermost loop in space as vector code: the lanes of a tile over all offsets, their sums kept in registers.

u           (3, m) displacements of all sites, m           offsets  (k,) from a site to its neighbour's
table       (k, FIELDS), see `Tiles`                       bits     (tiles, k) lanes whose bond is there
c, cells    (3, m), (2, m) of nodes, see `Tiles`           limits   three of e, see below
share       (r, k, 16) of tiles with a memory; row         the tile's
lane        of the tile, the first of those summed; own    its site
s           (SCRATCH,) a thread's scratch: sums of forces along x, y and z

`limits` are: |e| beyond which the wide polynomial is taken; e above which the share counts; e beyond which a slot is
left alone, as one whose bonds may break.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from pdsolve.codegen.pull import WIDE
from pdsolve.codegen.vector_code import INT, ROW, Code

FIELDS = 12  # of an offset
SCRATCH = 3 * ROW
SELDOM = (1, 1000)  # weights of a branch that is seldom taken, and of its other
X2, INVERSE, PULL, SHARES = 3, 6, 7, 8  # where 2 xi / xi.xi, 1 / xi.xi, w and w n_a^2 / 2 are in `table`


class _Slots:
    """The bonds of some lanes of a tile, offset by offset."""

    def __init__(self, code: Code, kinds: Any, values: Any, corrections: int, softened: bool) -> None:
        """`values` are the arguments of a loop, of these `kinds`; bonds have so many numbers of nodes in them."""
        self._code, self._corrections = code, corrections
        self._share = code.data(kinds[6], values[6]) if softened else None
        self._near, self._floor, self._edge = (code.builder.extract_value(values[7], n) for n in range(3))
        self._u = [_component(code, kinds[0], values[0], axis) for axis in range(3)]
        self._offsets, self._table, self._bits = (
            code.data(kind, array) for kind, array in zip(kinds[1:4], values[1:4], strict=True)
        )
        self._c = [_component(code, kinds[4], values[4], axis) for axis in range(3 if corrections else 0)]
        self._cells = [_component(code, kinds[5], values[5], row) for row in range(corrections - 3)]
        self._tile, self._site, self._lane, row, count = values[10:15]
        self._own_u = [code.load(component, self._site) for component in self._u]
        self._own_c = [code.load(component, self._site) for component in self._c]
        self._own_cells = [code.load(component, self._site) for component in self._cells]
        self._begin, self._memory = (code.builder.mul(index, count) for index in (self._tile, row))

    def deformed(self, slot: Any) -> tuple[list[list[Any]], list[list[Any]], list[Any]]:
        """Reference xi and eta (3), and e, which is 0 without a bond."""
        code, builder = self._code, self._code.builder
        at = builder.add(self._site, code.integer(self._offsets, slot))
        eta = [code.sub(code.load(far, at), near) for far, near in zip(self._u, self._own_u, strict=True)]
        field = builder.mul(slot, INT(FIELDS))
        xi, x2 = ([self._field(field, first + axis) for axis in range(3)] for first in (0, X2))
        inverse, e = self._field(field, INVERSE), code.same(0.0)
        for axis in range(3):
            e = code.fma(code.fma(inverse, eta[axis], x2[axis]), eta[axis], e)
        has_bond = code.bits(self._bits, builder.add(self._begin, slot), self._lane)
        return xi, eta, code.choose(has_bond, e, code.same(0.0))

    def is_empty(self, slot: Any) -> Any:
        """Whether no lane has a bond."""
        builder = self._code.builder
        word = builder.load(builder.gep(self._bits, [builder.add(self._begin, slot)]))
        return builder.icmp_unsigned("==", word, word.type(0))

    def factor(self, e: list[Any], leave: Any) -> list[Any]:
        """g(e), lane by lane, so that a sum does not depend on how many lanes are beside each other.

        Goes to the block `leave` where a lane is beyond the edge or WIDE; None: takes roots and divisions beyond WIDE.
        """
        code, builder = self._code, self._code.builder
        blocks = (builder.function.append_basic_block(name) for name in ("far", "wider", "done"))
        began, (far, wider, done) = builder.block, blocks
        narrow, size, near = code.polynomial(code.coefficients[0], e), code.magnitude(e), code.same(self._near)
        builder.cbranch(code.some(code.above(size, near)), far, done)
        builder.position_at_end(far)
        if leave is None:
            builder.branch(wider)
        else:
            beyond = code.either(code.above(e, code.same(self._edge)), code.above(size, code.same(WIDE)))
            builder.cbranch(code.some(beyond), leave, wider).set_weights(SELDOM)
        builder.position_at_end(wider)
        wide = code.polynomial(code.coefficients[1], e)
        if leave is None:
            q2 = code.add(code.same(1.0), e)
            root = code.each(builder.fdiv, code.same(1.0), code.add(q2, code.root(q2)))
            wide = code.choose(code.above(size, code.same(WIDE)), root, wide)
        wide = code.choose(code.above(size, near), wide, narrow)
        builder.branch(done)
        builder.position_at_end(done)
        return code.merge([(narrow, began), (wide, wider)])

    def stiffness(self, slot: Any, e: list[Any]) -> list[Any]:
        """Stiffness over length of bonds at e."""
        code, builder = self._code, self._code.builder
        field = builder.mul(slot, INT(FIELDS))
        w, at = self._field(field, PULL), builder.add(self._site, code.integer(self._offsets, slot))
        if self._corrections:
            ends = zip(self._c, self._own_c, strict=True)
            both = [code.add(code.load(component, at), near) for component, near in ends]
            w = code.mul(self._field(field, SHARES), both[0])
            for axis in (1, 2):
                w = code.fma(self._field(field, SHARES + axis), both[axis], w)
        if self._cells:
            volume, modulus = (code.load(component, at) for component in self._cells)
            w = code.mul(code.mul(w, volume), code.add(modulus, self._own_cells[1]))
        if self._share is not None:
            at = builder.add(builder.mul(builder.add(self._memory, slot), INT(ROW)), self._lane)
            counts = code.above(e, code.same(self._floor))
            w = code.mul(w, code.choose(counts, code.load(self._share, at), code.same(1.0)))
        return w

    def _field(self, begin: Any, number: int) -> list[Any]:
        builder = self._code.builder
        return self._code.same(builder.load(builder.gep(self._table, [builder.add(begin, INT(number))])))


def _component(code: Code, kind: Any, array: Any, number: int) -> Any:
    """Where row `number` of a matrix begins."""
    view = code._context.make_array(kind)(code._context, code.builder, array)
    columns = code.builder.extract_value(view.shape, 1)
    return code.builder.gep(view.data, [code.builder.mul(columns, INT(number))])


def _loop(corrections: int, exact: bool, softened: bool = False) -> Callable[..., Any]:
    """The loop for bonds with so many numbers of nodes in them; `exact`: with a root and a division beyond WIDE;
    `softened`: of tiles with a memory."""

    @intrinsic
    def add(  # type: ignore[no-untyped-def]
        typingctx, u, offsets, table, bits, c, cells, share, limits, first, last, tile, site, lane, row, count, s
    ):
        def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
            code = Code(context, builder, u.dtype)
            slots, scratch = _Slots(code, signature.args, values, corrections, softened), code.data(s, values[-1])
            head, leave = (builder.function.append_basic_block(name) for name in ("head", "leave"))
            look, began = builder.function.append_basic_block("look"), builder.block
            before = [code.load(scratch, INT(ROW * axis)) for axis in range(3)]
            builder.branch(head)
            builder.position_at_end(head)
            slot = builder.phi(INT)
            slot.add_incoming(values[8], began)
            sums = [code.merge([(total, began)]) for total in before]
            builder.cbranch(builder.icmp_signed("<", slot, values[9]), look, leave)
            builder.position_at_end(look)
            any_bond, skip = (builder.function.append_basic_block(name) for name in ("some", "skip"))
            builder.cbranch(slots.is_empty(slot), skip, any_bond)
            builder.position_at_end(skip)
            slot.add_incoming(builder.add(slot, INT(1)), skip)
            for phis in sums:
                for phi in phis:
                    phi.add_incoming(phi, skip)
            builder.branch(head)
            builder.position_at_end(any_bond)
            xi, eta, e = slots.deformed(slot)
            g = slots.factor(e, None if exact else leave)
            pull = code.mul(slots.stiffness(slot, e), code.mul(e, g))
            after = [code.fma(pull, code.add(x, y), total) for x, y, total in zip(xi, eta, sums, strict=True)]
            slot.add_incoming(builder.add(slot, INT(1)), builder.block)
            for phis, totals in zip(sums, after, strict=True):
                for phi, total in zip(phis, totals, strict=True):
                    phi.add_incoming(total, builder.block)
            builder.branch(head)
            builder.position_at_end(leave)
            for axis, total in enumerate(sums):
                code.store(total, scratch, INT(ROW * axis))
            return slot

        numbers_of = (types.int64,) * 7
        return types.int64(u, offsets, table, bits, c, cells, share, limits, *numbers_of, s), generate

    view: Callable[..., Any] = add
    return view


add_alike, add_corrected, add_general = (_loop(corrections, False) for corrections in (0, 3, 5))
add_alike_far, add_corrected_far, add_general_far = (_loop(corrections, True) for corrections in (0, 3, 5))
add_soft_alike, add_soft_corrected, add_soft_general = (_loop(corrections, False, True) for corrections in (0, 3, 5))
add_soft_alike_far, add_soft_corrected_far, add_soft_general_far = (
    _loop(corrections, True, True) for corrections in (0, 3, 5)
)
