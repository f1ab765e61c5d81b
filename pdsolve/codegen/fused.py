"""A product and a sum in one rounding, where the processor can; in the order that is written, unlike `fastmath`."""

from __future__ import annotations

from typing import Any

from numba.extending import intrinsic, overload

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import call


def fused(a: Any, b: Any, c: Any) -> Any:
    """a b + c."""
    return a * b + c


@intrinsic
def _fused(typingctx, a, b, c):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return call(builder, "fmuladd", *values)

    return a(a, b, c), generate


@overload(fused, jit_options=INNER | {"forceinline": True})
def _fused_of(a, b, c):  # type: ignore[no-untyped-def]
    return lambda a, b, c: _fused(a, b, c)
