"""Vector code in LLVM: values of a few lanes, as many as stay in registers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils

from pdsolve.codegen.pull import coefficients

ROW = 16  # lanes whose neighbours are looked for together

INT, _ID, _BYTE = ir.IntType(64), ir.IntType(32), ir.IntType(8).as_pointer()


def has_wide_vectors() -> bool:
    """Whether the target has vectors of 64 bytes, and 32 registers for them."""
    features = numba.config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten() if numba.config.CPU_NAME in (None, "host") else ""
    return "+avx512f" in features


def lanes_at_once(bytes_each: int) -> int:
    """Number of lanes summed at once, such that their data stay in registers."""
    return ROW if has_wide_vectors() or bytes_each == 4 else ROW // 2


def call(builder: ir.IRBuilder, name: str, *values: Any) -> Any:
    """Call LLVM's function `name` of numbers or vectors of one type."""
    kind = values[0].type
    element, count = (kind.element, f"v{kind.count}") if isinstance(kind, ir.VectorType) else (kind, "")
    suffix = f"{count}f{32 if isinstance(element, ir.FloatType) else 64}"
    function = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(kind, (kind,) * len(values)), f"llvm.{name}.{suffix}"
    )
    return builder.call(function, values)


def repeat(builder: ir.IRBuilder, vector: Any, scalar: Any) -> Any:
    """A number in all lanes of a vector of this type."""
    nothing = ir.Constant(vector, ir.Undefined)
    first_lane = builder.insert_element(nothing, scalar, _ID(0))
    return builder.shuffle_vector(
        first_lane, nothing, ir.Constant(ir.VectorType(_ID, vector.count), [0] * vector.count)
    )


class Code:
    """A writer of vector code: values of `count` lanes, in as many vectors as needed."""

    def __init__(self, context: Any, builder: ir.IRBuilder, kind: Any) -> None:
        single = kind == types.float32
        self.builder, self._context = builder, context
        self.size, self.element = (4, ir.FloatType()) if single else (8, ir.DoubleType())
        self._round = np.float32 if single else np.float64
        self.count = lanes_at_once(self.size)
        self.width = min(self.count, (64 if has_wide_vectors() else 32) // self.size)
        self.vector = ir.VectorType(self.element, self.width)
        self.coefficients = coefficients("float32" if single else "float64")

    def data(self, kind: Any, array: Any, axis: int = 0) -> Any:
        """Address of the beginning of an array component."""
        view = self._context.make_array(kind)(self._context, self.builder, array)
        if axis == 0:
            return view.data
        way = self.builder.mul(self.builder.extract_value(view.strides, 0), INT(axis))
        begin = self.builder.gep(self.builder.bitcast(view.data, _BYTE), [way])
        return self.builder.bitcast(begin, view.data.type)

    def load(self, data: Any, at: Any) -> list[Any]:
        """The lanes from `at` on."""
        vectors = []
        for first in range(0, self.count, self.width):
            place = self.builder.gep(data, [self.builder.add(at, INT(first))])
            value = self.builder.load(self.builder.bitcast(place, self.vector.as_pointer()))
            value.align = self.size
            vectors.append(value)
        return vectors

    def store(self, values: list[Any], data: Any, at: Any) -> None:
        """Store lanes from `at` on."""
        for first, value in zip(range(0, self.count, self.width), values, strict=True):
            place = self.builder.gep(data, [self.builder.add(at, INT(first))])
            done = self.builder.store(value, self.builder.bitcast(place, self.vector.as_pointer()))
            done.align = self.size

    def gather(self, data: Any, ids: Any, at: Any) -> list[Any]:
        """Values of the lanes' neighbours listed from `at` on."""
        vectors = []
        for first in range(0, self.count, self.width):
            value = ir.Constant(self.vector, ir.Undefined)
            for lane in range(self.width):
                j = self.integer(ids, self.builder.add(at, INT(first + lane)))
                scalar = self.builder.load(self.builder.gep(data, [j]))
                value = self.builder.insert_element(value, scalar, _ID(lane))
            vectors.append(value)
        return vectors

    def integer(self, data: Any, at: Any) -> Any:
        """An element of an array of int32."""
        return self.builder.sext(self.builder.load(self.builder.gep(data, [at])), INT)

    def same(self, scalar: Any) -> list[Any]:
        """A number in all lanes."""
        if isinstance(scalar, float):
            value = ir.Constant(self.vector, [float(self._round(scalar))] * self.width)
        else:
            value = repeat(self.builder, self.vector, scalar)
        return [value] * (self.count // self.width)

    def each(self, function: Callable[..., Any], *values: list[Any]) -> list[Any]:
        """A function of a vector applied to all vectors."""
        return [function(*vectors) for vectors in zip(*values, strict=True)]

    def add(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a + b in each lane."""
        return self.each(self.builder.fadd, a, b)

    def sub(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a - b in each lane."""
        return self.each(self.builder.fsub, a, b)

    def mul(self, a: list[Any], b: list[Any]) -> list[Any]:
        """a b in each lane."""
        return self.each(self.builder.fmul, a, b)

    def fma(self, a: list[Any], b: list[Any], c: list[Any]) -> list[Any]:
        """a b + c, rounded once where the processor can."""
        return self._call("fmuladd", a, b, c)

    def magnitude(self, a: list[Any]) -> list[Any]:
        """|a| in each lane."""
        return self._call("fabs", a)

    def root(self, a: list[Any]) -> list[Any]:
        """The square root of a."""
        return self._call("sqrt", a)

    def least(self, a: list[Any], b: list[Any]) -> list[Any]:
        """The smaller of a and b."""
        return self._call("minnum", a, b)

    def _call(self, name: str, *values: list[Any]) -> list[Any]:
        return self.each(lambda *vectors: call(self.builder, name, *vectors), *values)

    def above(self, a: list[Any], b: list[Any]) -> list[Any]:
        """Whether a > b, or either is NaN."""
        return self.each(lambda one, other: self.builder.fcmp_unordered(">", one, other), a, b)

    def choose(self, which: list[Any], a: list[Any], b: list[Any]) -> list[Any]:
        """a where `which` is true, else b."""
        return self.each(self.builder.select, which, a, b)

    def some(self, which: list[Any]) -> Any:
        """Whether any lane is true."""
        either = which[0]
        for mask in which[1:]:
            either = self.builder.or_(either, mask)
        bits = ir.IntType(self.width)
        return self.builder.icmp_unsigned("!=", self.builder.bitcast(either, bits), bits(0))

    def polynomial(self, factors: tuple[float, ...], e: list[Any]) -> list[Any]:
        """A polynomial with these coefficients in each lane, by Horner's rule."""
        value = self.same(factors[-1])
        for factor in factors[-2::-1]:
            value = self.fma(value, e, self.same(factor))
        return value

    def merge(self, incoming: list[tuple[list[Any], Any]]) -> list[Any]:
        """Values that arrive from one of several blocks of code."""
        phis = [self.builder.phi(self.vector) for _ in incoming[0][0]]
        for values, block in incoming:
            for phi, value in zip(phis, values, strict=True):
                phi.add_incoming(value, block)
        return phis
