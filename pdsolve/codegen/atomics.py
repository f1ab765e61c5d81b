"""Counters that several threads share, and calls of system functions, for compiled code."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def take(typingctx: Any, counts: Any, at: Any) -> Any:
    """Atomically increment an element; returns its previous value."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = context.make_array(counts)(context, builder, values[0]).data
        return builder.atomic_rmw("add", builder.gep(data, [values[1]]), ir.IntType(64)(1), "seq_cst")

    return types.int64(counts, types.int64), generate


@intrinsic
def counted(typingctx: Any, counts: Any, at: Any) -> Any:
    """Atomically read an element."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = context.make_array(counts)(context, builder, values[0]).data
        return builder.load_atomic(builder.gep(data, [values[1]]), "seq_cst", 8)

    return types.int64(counts, types.int64), generate


@intrinsic
def call(typingctx: Any, address: Any, number: Any) -> Any:
    """Call a function of an integer, given its address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(32), (ir.IntType(32),))
        word = builder.trunc(values[1], ir.IntType(32))
        return builder.call(builder.inttoptr(values[0], kind.as_pointer()), [word])

    return types.int32(types.int64, types.int64), generate
