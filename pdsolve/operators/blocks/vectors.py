"""The innermost loops as vector code: a few lanes over the slots of a block, their sums kept in registers.

numba's own loops over lanes look at every slot whether arrays overlap and keep sums in memory; written as LLVM's vectors the
same sum takes half of the time. Each lane is computed alike, to the same bits, however wide a processor's vectors are.

    u, after       (2, m) displacements of all lanes, now and one step on        s   (ACROSS,) a thread's scratch:
    slots, ids, vectors, stiffness, near, edge     of `kernel.Blocks`                 sums of forces, x then y, then e
    lane           of the block, the first of `across` that are summed; own   its node
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from pdsolve.operators.blocks.pull import NARROW, WIDE, coefficients

ROW = 16  # lanes whose neighbours are looked for together
FIELDS = 8  # of a slot
VECTOR, PULL, BOUND = 4, 5, 6  # behind the bases of its four rows
FY, E = ROW, 2 * ROW  # where the sums along y, and e, begin in s
SCRATCH = 3 * ROW
FAR = 1 << 30  # more than any way between two nodes
SELDOM = (1, 1000)  # weights of a branch that is seldom taken, and of its other

_INT, _ID, _BYTE = ir.IntType(64), ir.IntType(32), ir.IntType(8).as_pointer()


def has_wide_vectors() -> bool:
    """Whether what is compiled for has vectors of 64 bytes, and 32 registers for them."""
    features = numba.config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten() if numba.config.CPU_NAME in (None, "host") else ""
    return "+avx512f" in features


def across(bytes_each: int) -> int:
    """How many lanes are summed at once: so many that their places and sums stay in registers."""
    return ROW if has_wide_vectors() or bytes_each == 4 else ROW // 2


class _Code:
    """What vector code is written with: values of `count` lanes, in as many vectors as that takes."""

    def __init__(self, context: Any, builder: ir.IRBuilder, kind: Any) -> None:
        single = kind == types.float32
        self.builder, self._context = builder, context
        self.size, self.element = (4, ir.FloatType()) if single else (8, ir.DoubleType())
        self._round = np.float32 if single else np.float64
        self.count = across(self.size)
        self.width = min(self.count, (64 if has_wide_vectors() else 32) // self.size)
        self.vector = ir.VectorType(self.element, self.width)
        self.coefficients = coefficients("float32" if single else "float64")

    def data(self, kind: Any, array: Any, axis: int = 0) -> Any:
        """Where a component of an array begins."""
        made = self._context.make_array(kind)(self._context, self.builder, array)
        if axis == 0:
            return made.data
        begin = self.builder.gep(self.builder.bitcast(made.data, _BYTE), [self.builder.extract_value(made.strides, 0)])
        return self.builder.bitcast(begin, made.data.type)

    def load(self, data: Any, at: Any) -> list[Any]:
        """The lanes from `at` on."""
        found = []
        for first in range(0, self.count, self.width):
            place = self.builder.gep(data, [self.builder.add(at, _INT(first))])
            value = self.builder.load(self.builder.bitcast(place, self.vector.as_pointer()))
            value.align = self.size
            found.append(value)
        return found

    def store(self, values: list[Any], data: Any, at: Any) -> None:
        """Keep lanes from `at` on."""
        for first, value in zip(range(0, self.count, self.width), values, strict=True):
            place = self.builder.gep(data, [self.builder.add(at, _INT(first))])
            done = self.builder.store(value, self.builder.bitcast(place, self.vector.as_pointer()))
            done.align = self.size

    def gather(self, data: Any, ids: Any, at: Any) -> list[Any]:
        """What the lanes' neighbours have that are listed from `at` on."""
        found = []
        for first in range(0, self.count, self.width):
            value = ir.Constant(self.vector, ir.Undefined)
            for lane in range(self.width):
                j = self.integer(ids, self.builder.add(at, _INT(first + lane)))
                one = self.builder.load(self.builder.gep(data, [j]))
                value = self.builder.insert_element(value, one, _ID(lane))
            found.append(value)
        return found

    def integer(self, data: Any, at: Any) -> Any:
        """An element of an array of int32."""
        return self.builder.sext(self.builder.load(self.builder.gep(data, [at])), _INT)

    def same(self, scalar: Any) -> list[Any]:
        """A number in all lanes."""
        if isinstance(scalar, float):
            value = ir.Constant(self.vector, [float(self._round(scalar))] * self.width)
        else:
            nothing = ir.Constant(self.vector, ir.Undefined)
            one = self.builder.insert_element(nothing, scalar, _ID(0))
            value = self.builder.shuffle_vector(
                one, nothing, ir.Constant(ir.VectorType(_ID, self.width), [0] * self.width)
            )
        return [value] * (self.count // self.width)

    def each(self, function: Callable[..., Any], *values: list[Any]) -> list[Any]:
        """A function of one vector, of all."""
        return [function(*vectors) for vectors in zip(*values, strict=True)]

    def add(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a + b"""
        return self.each(self.builder.fadd, a, b)

    def sub(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a - b"""
        return self.each(self.builder.fsub, a, b)

    def mul(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a b"""
        return self.each(self.builder.fmul, a, b)

    def fma(self, a: list[Any], b: list[Any], c: list[Any]) -> list[Any]:
        """a b + c, rounded once where the processor can."""
        return self._call("fmuladd", a, b, c)

    def magnitude(self, a: list[Any]) -> list[Any]:
        """|a|"""
        return self._call("fabs", a)

    def root(self, a: list[Any]) -> list[Any]:
        """The square root of a."""
        return self._call("sqrt", a)

    def least(self, a: list[Any], b: list[Any]) -> list[Any]:
        """The smaller of a and b."""
        return self._call("minnum", a, b)

    def _call(self, name: str, *values: list[Any]) -> list[Any]:
        kind = ir.FunctionType(self.vector, (self.vector,) * len(values))
        name = f"llvm.{name}.v{self.width}f{8 * self.size}"
        function = cgutils.get_or_insert_function(self.builder.module, kind, name)
        return self.each(lambda *vectors: self.builder.call(function, vectors), *values)

    def above(self, a: list[Any], b: list[Any]) -> list[Any]:
        """Whether a > b, or either is no number."""
        return self.each(lambda one, other: self.builder.fcmp_unordered(">", one, other), a, b)

    def choose(self, which: list[Any], a: list[Any], b: list[Any]) -> list[Any]:
        """a where it is true, else b."""
        return self.each(self.builder.select, which, a, b)

    def some(self, which: list[Any]) -> Any:
        """Whether it is true in any lane."""
        either = which[0]
        for other in which[1:]:
            either = self.builder.or_(either, other)
        bits = ir.IntType(self.width)
        return self.builder.icmp_unsigned("!=", self.builder.bitcast(either, bits), bits(0))

    def polynomial(self, factors: tuple[float, ...], e: list[Any]) -> list[Any]:
        """By Horner's rule."""
        value = self.same(factors[-1])
        for factor in factors[-2::-1]:
            value = self.fma(value, e, self.same(factor))
        return value

    def merge(self, incoming: list[tuple[list[Any], Any]]) -> list[Any]:
        """Values that come from one of several blocks of code."""
        found = [self.builder.phi(self.vector) for _ in incoming[0][0]]
        for values, block in incoming:
            for phi, value in zip(found, values, strict=True):
                phi.add_incoming(value, block)
        return found


class _Bonds:
    """The bonds of some lanes of a block, slot by slot."""

    def __init__(self, code: _Code, kinds: Any, values: Any) -> None:
        """`values` are those of the arguments of `add_slots`, of these `kinds`."""
        self._code = code
        arrays = zip(kinds[:7], values[:7], strict=True)
        self.u = [code.data(kinds[0], values[0], axis) for axis in (0, 1)]
        _, self._slots, self.ids, self._vectors, self._stiffness, self._near, self._edge = (
            code.data(kind, array) for kind, array in arrays
        )
        self._node, self._lane = values[-3:-1]
        self._row = code.builder.sdiv(self._lane, _INT(ROW))
        self.own = [code.load(component, self._node) for component in self.u]

    def way(self, slot: Any) -> Any:
        """From a node of the row to its neighbour; or FAR + row of ids."""
        return self._field(slot, self._row)

    def reference(self, slot: Any) -> list[list[Any]]:
        """xi and 2 xi / xi.xi, both components, and 1 / xi.xi."""
        code, at = self._code, self._code.builder.mul(self._field(slot, _INT(VECTOR)), _INT(FIELDS))
        return [code.same(self._element(self._vectors, code.builder.add(at, _INT(c)))) for c in range(5)]

    def beside(self, way: Any) -> list[list[Any]]:
        """Displacements of neighbours that are consecutive."""
        at = self._code.builder.add(self._node, way)
        return [self._code.load(component, at) for component in self.u]

    def listed(self, way: Any) -> list[list[Any]]:
        """Displacements of neighbours that are not."""
        builder = self._code.builder
        row = builder.mul(builder.sub(way, _INT(FAR)), _INT(ROW))
        at = builder.add(row, builder.srem(self._lane, _INT(ROW)))
        return [self._code.gather(component, self.ids, at) for component in self.u]

    def deformed(self, reference: list[list[Any]], there: list[list[Any]]) -> tuple[list[Any], list[Any], list[Any]]:
        """Both components of eta, and e."""
        code, (_, _, x2, y2, inverse) = self._code, reference
        eta_x, eta_y = (code.sub(far, near) for far, near in zip(there, self.own, strict=True))
        along_x = code.mul(code.fma(inverse, eta_x, x2), eta_x)
        return eta_x, eta_y, code.fma(code.fma(inverse, eta_y, y2), eta_y, along_x)

    def found(self, loop: _Loop) -> tuple[list[list[Any]], list[Any], list[Any], list[Any]]:
        """The reference of a slot whose neighbours may be anywhere, eta, and e, which is 0 without a bond."""
        code, builder, blocks = self._code, self._code.builder, loop.blocks
        way, reference = self.way(loop.slot), self.reference(loop.slot)
        builder.cbranch(builder.icmp_signed(">=", way, _INT(FAR)), blocks["listed"], blocks["beside"])
        loop.go_on("beside")
        beside = self.beside(way)
        builder.branch(blocks["found"])
        loop.go_on("listed")
        listed = self.listed(way)
        builder.branch(blocks["found"])
        loop.go_on("found")
        pairs = zip(beside, listed, strict=True)
        there = [code.merge([(a, blocks["beside"]), (b, blocks["listed"])]) for a, b in pairs]
        eta_x, eta_y, e = self.deformed(reference, there)
        nothing = code.each(lambda row: builder.fcmp_unordered("==", row, code.same(np.inf)[0]), self.near(loop.slot))
        return reference, eta_x, eta_y, code.choose(nothing, code.same(0.0), e)

    def stiffness(self, slot: Any) -> list[Any]:
        """w of each lane, 0 without a bond."""
        return self._code.load(self._stiffness, self._lane_of(self._field(slot, _INT(PULL))))

    def near(self, slot: Any) -> list[Any]:
        """Up to which |e| a lane needs no care, infinite without a bond."""
        return self._code.load(self._near, self._lane_of(self._field(slot, _INT(BOUND))))

    def edge(self, slot: Any) -> list[Any]:
        """Above which e something happens to a bond."""
        return self._code.load(self._edge, self._lane_of(self._field(slot, _INT(BOUND))))

    def pulled(
        self,
        slot: Any,
        reference: list[list[Any]],
        eta: tuple[list[Any], list[Any]],
        e: list[Any],
        g: list[Any],
        sums: list[list[Any]],
    ) -> list[list[Any]]:
        """The sums, the slot's forces added."""
        code = self._code
        pull = code.mul(code.mul(self.stiffness(slot), e), g)
        return [
            code.fma(pull, code.add(xi, along), total)
            for xi, along, total in zip(reference[:2], eta, sums, strict=True)
        ]

    def _field(self, slot: Any, number: Any) -> Any:
        builder = self._code.builder
        return self._code.integer(self._slots, builder.add(builder.mul(slot, _INT(FIELDS)), number))

    def _lane_of(self, row: Any) -> Any:
        builder = self._code.builder
        return builder.add(builder.mul(row, _INT(4 * ROW)), self._lane)

    def _element(self, data: Any, at: Any) -> Any:
        return self._code.builder.load(self._code.builder.gep(data, [at]))


def _signature(u: Any, slots: Any, ids: Any, vectors: Any, stiffness: Any, near: Any, edge: Any, s: Any) -> Any:
    numbers = (types.int64,) * 4
    return types.int64(u, slots, ids, vectors, stiffness, near, edge, *numbers, s)


class _Loop:
    """A loop over slots that leaves at the first one it cannot add."""

    def __init__(self, code: _Code, bonds: _Bonds, values: Any, kept: Any, names: tuple[str, ...]) -> None:
        """`values` are the arguments of `add_slots`; the blocks of code called so are there to be filled."""
        builder = code.builder
        began, function = builder.block, builder.function
        self._code, self._kept = code, kept
        self.blocks = {name: function.append_basic_block(name) for name in ("head", "look", *names, "add", "leave")}
        sums = [code.load(kept, _INT(at)) for at in (0, FY)]
        builder.branch(self.blocks["head"])
        self.go_on("head")
        self.slot = builder.phi(_INT)
        self.slot.add_incoming(values[7], began)
        self.sums = [code.merge([(total, began)]) for total in sums]
        builder.cbranch(builder.icmp_signed("<", self.slot, values[8]), self.blocks["look"], self.blocks["leave"])
        self.go_on("look")

    def go_on(self, name: str) -> None:
        """What follows is in this block of code."""
        self._code.builder.position_at_end(self.blocks[name])

    def unless(self, condition: Any, name: str) -> None:
        """Leave if it holds, which is seldom, else go on there."""
        branch = self._code.builder.cbranch(condition, self.blocks["leave"], self.blocks[name])
        branch.set_weights(SELDOM)
        self.go_on(name)

    def end(self, after: list[list[Any]]) -> Any:
        """On to the next slot with these sums; returns the slot that the loop leaves at."""
        builder, add = self._code.builder, self.blocks["add"]
        self.slot.add_incoming(builder.add(self.slot, _INT(1)), add)
        for phis, totals in zip(self.sums, after, strict=True):
            for phi, total in zip(phis, totals, strict=True):
                phi.add_incoming(total, add)
        builder.branch(self.blocks["head"])
        self.go_on("leave")
        for total, at in zip(self.sums, (0, FY), strict=True):
            self._code.store(total, self._kept, _INT(at))
        return self.slot


@intrinsic
def add_slots(typingctx, u, slots, ids, vectors, stiffness, near, edge, first, last, own, lane, s):  # type: ignore[no-untyped-def]
    """Add the forces of the slots `first` to `last` - 1 of a block to the sums in s, for the lanes from `lane` on.

    Returns the first slot whose neighbours are not consecutive or that has an |e| above `near`, or `last`.
    """

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = _Code(context, builder, u.dtype)
        bonds, kept = _Bonds(code, signature.args, values), code.data(s, values[-1])
        loop = _Loop(code, bonds, values, kept, ("beside",))
        way = bonds.way(loop.slot)
        loop.unless(builder.icmp_signed(">=", way, _INT(FAR)), "beside")
        reference = bonds.reference(loop.slot)
        *eta, e = bonds.deformed(reference, bonds.beside(way))
        loop.unless(code.some(code.above(code.magnitude(e), bonds.near(loop.slot))), "add")
        g = code.polynomial(code.coefficients[0], e)
        return loop.end(bonds.pulled(loop.slot, reference, tuple(eta), e, g, loop.sums))

    return _signature(u, slots, ids, vectors, stiffness, near, edge, s), generate


@intrinsic
def add_any(typingctx, u, slots, ids, vectors, stiffness, near, edge, first, last, own, lane, s):  # type: ignore[no-untyped-def]
    """The same for neighbours anywhere and |e| up to WIDE.

    Returns the first slot with an |e| beyond, or an e above `edge`, and those of its lanes in s; or `last`.
    """

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = _Code(context, builder, u.dtype)
        bonds, kept = _Bonds(code, signature.args, values), code.data(s, values[-1])
        loop = _Loop(code, bonds, values, kept, ("beside", "listed", "found", "strange", "usual", "wide"))
        slot, (reference, *eta, e) = loop.slot, bonds.found(loop)
        size = code.magnitude(e)
        known = code.least(bonds.edge(slot), code.same(WIDE))
        strange = code.each(builder.or_, code.above(e, known), code.above(size, code.same(WIDE)))
        builder.cbranch(code.some(strange), loop.blocks["strange"], loop.blocks["usual"]).set_weights(SELDOM)
        loop.go_on("strange")
        code.store(e, kept, _INT(E))
        builder.branch(loop.blocks["leave"])
        loop.go_on("usual")
        narrow, beyond = code.polynomial(code.coefficients[0], e), code.above(size, code.same(NARROW))
        builder.cbranch(code.some(beyond), loop.blocks["wide"], loop.blocks["add"])
        loop.go_on("wide")
        wide = code.choose(beyond, code.polynomial(code.coefficients[1], e), narrow)
        builder.branch(loop.blocks["add"])
        loop.go_on("add")
        g = code.merge([(narrow, loop.blocks["usual"]), (wide, loop.blocks["wide"])])
        return loop.end(bonds.pulled(slot, reference, tuple(eta), e, g, loop.sums))

    return _signature(u, slots, ids, vectors, stiffness, near, edge, s), generate


@intrinsic
def add_far(typingctx, u, slots, ids, vectors, stiffness, near, edge, first, last, own, lane, s):  # type: ignore[no-untyped-def]
    """The same whatever the stretches: all slots are added."""

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = _Code(context, builder, u.dtype)
        bonds, kept = _Bonds(code, signature.args, values), code.data(s, values[-1])
        loop = _Loop(code, bonds, values, kept, ("beside", "listed", "found"))
        slot, (reference, *eta, e) = loop.slot, bonds.found(loop)
        builder.branch(loop.blocks["add"])
        loop.go_on("add")
        size, one = code.magnitude(e), code.same(1.0)
        narrow, wide = (code.polynomial(factors, e) for factors in code.coefficients)
        g = code.choose(code.above(size, code.same(NARROW)), wide, narrow)
        q2 = code.add(one, e)
        exact = code.each(builder.fdiv, one, code.add(q2, code.root(q2)))
        g = code.choose(code.above(size, code.same(WIDE)), exact, g)
        return loop.end(bonds.pulled(slot, reference, tuple(eta), e, g, loop.sums))

    return _signature(u, slots, ids, vectors, stiffness, near, edge, s), generate


@intrinsic
def kick_and_drift(typingctx, u, after, v, lightness, dt, half, own, s):  # type: ignore[no-untyped-def]
    """From the sums in s, the last half of a step and the first of the next for the nodes from `own` on.

    To the same bits as one by one: kick and drift are two roundings, and never contracted. `lightness` (m,) is 1 / rho.
    """

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        code = _Code(context, builder, u.dtype)
        step, half_a_step = code.same(values[4]), code.same(values[5])
        at, kept = values[6], code.data(s, values[7])
        light = code.load(code.data(lightness, values[3]), at)
        for axis, first in enumerate((0, FY)):
            speeds = code.data(v, values[2], axis)
            kick = code.mul(half_a_step, code.mul(code.load(kept, _INT(first)), light))
            speed = code.add(code.add(code.load(speeds, at), kick), kick)
            code.store(speed, speeds, at)
            place = code.add(code.load(code.data(u, values[0], axis), at), code.mul(step, speed))
            code.store(place, code.data(after, values[1], axis), at)
        return context.get_dummy_value()

    return types.void(u, after, v, lightness, u.dtype, u.dtype, types.int64, s), generate
