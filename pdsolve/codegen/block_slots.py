"""The innermost loops as vector code: a few lanes over the slots of a block, their sums kept in registers.

numba's own loops over lanes look at every slot whether arrays overlap and keep sums in memory; written as LLVM's
vectors the same sum takes half of the time. Each lane is computed alike, to the same bits, however wide a processor's
vectors are.

    axes           as many entries as there are axes, d
    u, after       (d, m) displacements of all lanes, now and one step on        s   (ACROSS,) a thread's scratch:
    slots, ids, vectors, stiffness, near, edge,                                       sums of forces, axis by axis,
    whole, of_rows of `kernel.Blocks`                                                 then e
    table          the axes, u, and the arrays of blocks, in this order
    shrink         (m,) minus half the strain of a free node: a bond is relieved of that of both ends; or None
    lane           of the block, the first of `across` that are summed; own   its node
    turn           a slot of the block; in space the place in `of_rows` of one in which the row of lanes has bonds
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from pdsolve.codegen.pull import NARROW, WIDE
from pdsolve.codegen.vector_code import INT, ROW, Code

LANES = 4 * ROW  # of a block
FIELDS = 8  # of a slot
VECTOR, PULL, BOUND = 4, 5, 6  # behind the bases of its four rows
FAR = 1 << 30  # more than any way between two nodes
SELDOM = (1, 1000)  # weights of a branch that is seldom taken, and of its other
# Numbers of a reference vector in a dimension: xi, 2 xi / xi.xi, 1 / xi.xi, |xi| and its inverse; to a round number
VECTOR_WIDTH = {2: 8, 3: 9}


class _Bonds:
    """The bonds of some lanes of a block, slot by slot."""

    def __init__(self, code: Code, kinds: Any, values: Any) -> None:
        """`values` are the arguments of `add_slots`, of the types `kinds`."""
        self._code = code
        table = list(zip(kinds[0].types, cgutils.unpack_tuple(code.builder, values[0]), strict=True))
        self.axes = len(kinds[0].types[0])
        self.u = [code.data(*table[1], axis) for axis in range(self.axes)]
        if not isinstance(kinds[1], types.NoneType):
            self.u.append(code.data(kinds[1], values[1]))
        arrays = (code.data(*array) for array in table[2:])
        self._slots, self.ids, self._vectors, self._stiffness, self._near, self._edge, self._whole, self._of_rows = (
            arrays
        )
        self._node, self._lane = values[-3:-1]
        self._row = code.builder.sdiv(self._lane, INT(ROW))
        self.own = [code.load(component, self._node) for component in self.u]

    def slot(self, turn: Any) -> Any:
        """The slot whose turn it is."""
        return turn if self.axes == 2 else self._code.integer(self._of_rows, turn)

    def way(self, slot: Any) -> Any:
        """Offset from a node of the row to its neighbour; or FAR + row of ids."""
        return self._field(slot, self._row)

    def reference(self, slot: Any) -> list[list[Any]]:
        """xi and 2 xi / xi.xi, all components, and 1 / xi.xi."""
        code, d = self._code, self.axes
        at = code.builder.mul(self._field(slot, INT(VECTOR)), INT(VECTOR_WIDTH[d]))
        return [code.same(self._element(self._vectors, code.builder.add(at, INT(c)))) for c in range(2 * d + 1)]

    def beside(self, way: Any) -> list[list[Any]]:
        """Displacements of consecutive neighbours, and their shrinkage, if there is any."""
        at = self._code.builder.add(self._node, way)
        return [self._code.load(component, at) for component in self.u]

    def listed(self, way: Any) -> list[list[Any]]:
        """Displacements of listed neighbours, and their shrinkage, if there is any."""
        builder = self._code.builder
        row = builder.mul(builder.sub(way, INT(FAR)), INT(ROW))
        at = builder.add(row, builder.srem(self._lane, INT(ROW)))
        return [self._code.gather(component, self.ids, at) for component in self.u]

    def deformed(self, reference: list[list[Any]], neighbour_values: list[list[Any]]) -> list[list[Any]]:
        """All components of eta, and e."""
        code, d, inverse = self._code, self.axes, reference[-1]
        eta = [code.sub(far, near) for far, near in zip(neighbour_values[:d], self.own[:d], strict=True)]
        for far, near in zip(neighbour_values[d:], self.own[d:], strict=True):
            shrink = code.add(far, near)
            eta = [code.fma(shrink, xi, along) for xi, along in zip(reference[:d], eta, strict=True)]
        e = code.mul(code.fma(inverse, eta[0], reference[d]), eta[0])
        for along, doubled in zip(eta[1:], reference[d + 1 : 2 * d], strict=True):
            e = code.fma(code.fma(inverse, along, doubled), along, e)
        return [*eta, e]

    def deformation(self, loop: _Loop) -> tuple[list[list[Any]], list[list[Any]], list[Any]]:
        """Reference of a slot with neighbours anywhere, eta, and e, which is 0 without a bond."""
        code, builder, blocks = self._code, self._code.builder, loop.blocks
        way, reference = self.way(loop.slot), self.reference(loop.slot)
        builder.cbranch(builder.icmp_signed(">=", way, INT(FAR)), blocks["listed"], blocks["beside"])
        loop.go_on("beside")
        consecutive = self.beside(way)
        builder.branch(blocks["found"])
        loop.go_on("listed")
        listed = self.listed(way)
        builder.branch(blocks["found"])
        loop.go_on("found")
        pairs = zip(consecutive, listed, strict=True)
        neighbour_values = [code.merge([(a, blocks["beside"]), (b, blocks["listed"])]) for a, b in pairs]
        *eta, e = self.deformed(reference, neighbour_values)
        nothing = code.each(lambda row: builder.fcmp_unordered("==", row, code.same(np.inf)[0]), self.near(loop.slot))
        return reference, eta, code.choose(nothing, code.same(0.0), e)

    def stiffness(self, slot: Any) -> list[Any]:
        """w of each lane, 0 without a bond."""
        return self._code.load(self._stiffness, self._lane_of(self._field(slot, INT(PULL))))

    def whole(self, slot: Any) -> list[Any]:
        """w of each lane before any of its bonds softened or broke."""
        return self._code.load(self._stiffness, self._lane_of(self._code.integer(self._whole, slot)))

    def near(self, slot: Any) -> list[Any]:
        """Largest |e| of a lane for the narrow polynomial, infinite without a bond."""
        return self._code.load(self._near, self._lane_of(self._field(slot, INT(BOUND))))

    def edge(self, slot: Any) -> list[Any]:
        """The e above which a bond breaks or softens."""
        return self._code.load(self._edge, self._lane_of(self._field(slot, INT(BOUND))))

    def pulled(
        self,
        slot: Any,
        reference: list[list[Any]],
        eta: Sequence[list[Any]],
        e: list[Any],
        g: list[Any],
        sums: list[list[Any]],
        one_sided: bool = False,
    ) -> list[list[Any]]:
        """The sums plus the slot's forces; `one_sided`: shortened bonds have all their stiffness."""
        code = self._code
        w = self.stiffness(slot)
        if one_sided:
            w = code.choose(code.above(e, code.same(0.0)), w, self.whole(slot))
        pull = code.mul(code.mul(w, e), g)
        return [
            code.fma(pull, code.add(xi, along), total)
            for xi, along, total in zip(reference[: self.axes], eta, sums, strict=True)
        ]

    def _field(self, slot: Any, number: Any) -> Any:
        builder = self._code.builder
        return self._code.integer(self._slots, builder.add(builder.mul(slot, INT(FIELDS)), number))

    def _lane_of(self, row: Any) -> Any:
        builder = self._code.builder
        return builder.add(builder.mul(row, INT(LANES)), self._lane)

    def _element(self, data: Any, at: Any) -> Any:
        return self._code.builder.load(self._code.builder.gep(data, [at]))


def _signature(table: Any, shrink: Any, s: Any) -> Any:
    """Types of what the loops read, of four numbers and of the scratch; a turn comes back."""
    return types.int64(table, shrink, types.int64, types.int64, types.int64, types.int64, s)


class _Loop:
    """A loop over slots that stops at the first one it cannot add."""

    def __init__(self, code: Code, bonds: _Bonds, values: Any, scratch: Any, names: tuple[str, ...]) -> None:
        """`values` are the arguments of `add_slots`; `names` are the blocks of code to fill."""
        builder = code.builder
        began, function = builder.block, builder.function
        self._code, self._kept, self._at_sums = code, scratch, [INT(ROW * axis) for axis in range(bonds.axes)]
        self.blocks = {name: function.append_basic_block(name) for name in ("head", "look", *names, "add", "leave")}
        sums = [code.load(scratch, at) for at in self._at_sums]
        builder.branch(self.blocks["head"])
        self.go_on("head")
        self._turn = builder.phi(INT)
        self._turn.add_incoming(values[2], began)
        self.sums = [code.merge([(total, began)]) for total in sums]
        builder.cbranch(builder.icmp_signed("<", self._turn, values[3]), self.blocks["look"], self.blocks["leave"])
        self.go_on("look")
        self.slot = bonds.slot(self._turn)

    def go_on(self, name: str) -> None:
        """Write the following code into this block."""
        self._code.builder.position_at_end(self.blocks[name])

    def unless(self, condition: Any, name: str) -> None:
        """Leave the loop if the rare `condition` holds, else continue in the block `name`."""
        branch = self._code.builder.cbranch(condition, self.blocks["leave"], self.blocks[name])
        branch.set_weights(SELDOM)
        self.go_on(name)

    def end(self, after: list[list[Any]]) -> Any:
        """Go to the next slot with these sums; returns the turn at which the loop stopped."""
        builder, add = self._code.builder, self.blocks["add"]
        self._turn.add_incoming(builder.add(self._turn, INT(1)), add)
        for phis, totals in zip(self.sums, after, strict=True):
            for phi, total in zip(phis, totals, strict=True):
                phi.add_incoming(total, add)
        builder.branch(self.blocks["head"])
        self.go_on("leave")
        for total, at in zip(self.sums, self._at_sums, strict=True):
            self._code.store(total, self._kept, at)
        return self._turn


@intrinsic
def add_slots(typingctx, table, shrink, first, last, node, lane, s):  # type: ignore[no-untyped-def]
    """Add the forces of the turns `first` to `last` - 1 of a block to the sums in s, for the lanes from `lane` on.

    Returns the first turn with neighbours that are not consecutive or with an |e| above `near`, or `last`.
    """

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = Code(context, builder, s.dtype)
        bonds, scratch = _Bonds(code, signature.args, values), code.data(s, values[-1])
        loop = _Loop(code, bonds, values, scratch, ("beside",))
        way = bonds.way(loop.slot)
        loop.unless(builder.icmp_signed(">=", way, INT(FAR)), "beside")
        reference = bonds.reference(loop.slot)
        *eta, e = bonds.deformed(reference, bonds.beside(way))
        loop.unless(code.some(code.above(code.magnitude(e), bonds.near(loop.slot))), "add")
        g = code.polynomial(code.coefficients[0], e)
        return loop.end(bonds.pulled(loop.slot, reference, eta, e, g, loop.sums))

    return _signature(table, shrink, s), generate


def _adding_any(one_sided: bool) -> Callable[..., Any]:
    """The loop for neighbours anywhere and |e| up to WIDE; `one_sided` as in `_Bonds.pulled`."""

    @intrinsic
    def add(typingctx, table, shrink, first, last, node, lane, s):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
            code = Code(context, builder, s.dtype)
            bonds, scratch = _Bonds(code, signature.args, values), code.data(s, values[-1])
            loop = _Loop(code, bonds, values, scratch, ("beside", "listed", "found", "strange", "usual", "wide"))
            slot, (reference, eta, e) = loop.slot, bonds.deformation(loop)
            size = code.magnitude(e)
            usual_limit = code.least(bonds.edge(slot), code.same(WIDE))
            strange = code.each(builder.or_, code.above(e, usual_limit), code.above(size, code.same(WIDE)))
            builder.cbranch(code.some(strange), loop.blocks["strange"], loop.blocks["usual"]).set_weights(SELDOM)
            loop.go_on("strange")
            code.store(e, scratch, INT(ROW * bonds.axes))
            builder.branch(loop.blocks["leave"])
            loop.go_on("usual")
            narrow, beyond = code.polynomial(code.coefficients[0], e), code.above(size, code.same(NARROW))
            builder.cbranch(code.some(beyond), loop.blocks["wide"], loop.blocks["add"])
            loop.go_on("wide")
            wide = code.choose(beyond, code.polynomial(code.coefficients[1], e), narrow)
            builder.branch(loop.blocks["add"])
            loop.go_on("add")
            g = code.merge([(narrow, loop.blocks["usual"]), (wide, loop.blocks["wide"])])
            return loop.end(bonds.pulled(slot, reference, eta, e, g, loop.sums, one_sided))

        return _signature(table, shrink, s), generate

    view: Callable[..., Any] = add
    return view


def _adding_far(one_sided: bool) -> Callable[..., Any]:
    """The loop for any stretch; `one_sided` as in `_Bonds.pulled`."""

    @intrinsic
    def add(typingctx, table, shrink, first, last, node, lane, s):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
            code = Code(context, builder, s.dtype)
            bonds, scratch = _Bonds(code, signature.args, values), code.data(s, values[-1])
            loop = _Loop(code, bonds, values, scratch, ("beside", "listed", "found"))
            slot, (reference, eta, e) = loop.slot, bonds.deformation(loop)
            builder.branch(loop.blocks["add"])
            loop.go_on("add")
            size, ones = code.magnitude(e), code.same(1.0)
            narrow, wide = (code.polynomial(factors, e) for factors in code.coefficients)
            g = code.choose(code.above(size, code.same(NARROW)), wide, narrow)
            q2 = code.add(ones, e)
            exact = code.each(builder.fdiv, ones, code.add(q2, code.root(q2)))
            g = code.choose(code.above(size, code.same(WIDE)), exact, g)
            return loop.end(bonds.pulled(slot, reference, eta, e, g, loop.sums, one_sided))

        return _signature(table, shrink, s), generate

    view: Callable[..., Any] = add
    return view


# Add the forces of the turns `first` to `last` - 1 to the sums in s, for neighbours anywhere and |e| up to WIDE.
# Returns the first turn with a larger |e|, or with an e above `edge` (its lanes are stored in s); or `last`.
add_any, add_any_one_sided = _adding_any(False), _adding_any(True)
# Likewise for any stretch
add_far, add_far_one_sided = _adding_far(False), _adding_far(True)


@intrinsic
def kick_and_drift(typingctx, u, after, v, lightness, dt, half, node, s):  # type: ignore[no-untyped-def]
    """The second half kick of a step and the first half kick and drift of the next, from the sums in s.

    For the nodes from `node` on, to the same bits as one by one: kick and drift are rounded separately and never
    contracted. `lightness` (m,) is 1 / rho.
    """

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = Code(context, builder, u.dtype)
        step, half_a_step = code.same(values[4]), code.same(values[5])
        at, scratch = values[6], code.data(s, values[7])
        light = code.load(code.data(lightness, values[3]), at)
        for axis, first in enumerate((0, ROW)):
            speeds = code.data(v, values[2], axis)
            kick = code.mul(half_a_step, code.mul(code.load(scratch, INT(first)), light))
            speed = code.add(code.add(code.load(speeds, at), kick), kick)
            code.store(speed, speeds, at)
            place = code.add(code.load(code.data(u, values[0], axis), at), code.mul(step, speed))
            code.store(place, code.data(after, values[1], axis), at)
        return context.get_dummy_value()

    return types.void(u, after, v, lightness, u.dtype, u.dtype, types.int64, s), generate
