"""Vector code in LLVM: values of a few lanes, as many as stay in registers."""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import binding, ir
from numba.core import cgutils

ROW = 16  # lanes whose neighbours are looked for together

INT, _ID = ir.IntType(64), ir.IntType(32)


def has_feature(name: str) -> bool:
    """Whether the target has a feature, in LLVM's words."""
    features = numba.config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten() if numba.config.CPU_NAME in (None, "host") else ""
    return f"+{name}" in features.split(",")


def has_wide_vectors() -> bool:
    """Whether the target has vectors of 64 bytes, and 32 registers for them."""
    return has_feature("avx512f")


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


def lanes_of_register(bytes_each: int) -> int:
    """Number of lanes in a register."""
    return (64 if has_wide_vectors() else 32) // bytes_each


def split(builder: ir.IRBuilder, value: Any) -> list[Any]:
    """The parts of a vector of numbers or integers that fit into registers."""
    element = value.type.element
    bytes_each = element.width // 8 if isinstance(element, ir.IntType) else 4 if element == ir.FloatType() else 8
    width, nothing = lanes_of_register(bytes_each), ir.Constant(value.type, ir.Undefined)
    places = ([_ID(first + lane) for lane in range(width)] for first in range(0, value.type.count, width))
    return [builder.shuffle_vector(value, nothing, ir.Constant(ir.VectorType(_ID, width), which)) for which in places]


def join(builder: ir.IRBuilder, parts: list[Any]) -> Any:
    """One vector of the lanes of its parts: one, two or four of them."""
    if len(parts) > 1 and has_feature("avx"):
        # The compiler does not see where the parts are from: else it does to one after the other what is done to all
        # side by side, which takes a tenth longer; its own fence for numbers does not keep it from that
        parts = [builder.asm(ir.FunctionType(part.type, [part.type]), "", "=x,0", [part], False) for part in parts]
    while len(parts) > 1:
        count = 2 * parts[0].type.count
        which = ir.Constant(ir.VectorType(_ID, count), [_ID(lane) for lane in range(count)])
        parts = [builder.shuffle_vector(*pair, which) for pair in zip(parts[::2], parts[1::2], strict=True)]
    return parts[0]
