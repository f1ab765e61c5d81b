"""A product and a sum in one rounding, where the processor can; in the order that is written, unlike `fastmath`."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic, overload

from pdsolve.numerics.inner_functions import INNER


def fused(a: Any, b: Any, c: Any) -> Any:
    """a b + c."""
    return a * b + c


@intrinsic
def _fused(typingctx, a, b, c):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        kind = ir.DoubleType()
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(kind, (kind, kind, kind)), "llvm.fmuladd.f64"
        )
        return builder.call(function, values)

    return a(a, b, c), generate


@overload(fused, jit_options=INNER | {"forceinline": True})
def _fused_of(a, b, c):  # type: ignore[no-untyped-def]
    return lambda a, b, c: _fused(a, b, c)
