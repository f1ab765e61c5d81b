"""The exponential function in sums and products: libraries' differ in the last bit, this one is the same everywhere."""

from __future__ import annotations

from numba.extending import register_jitable

from pdsolve.codegen.inner_functions import INNER


@register_jitable(**INNER)
def exponential(x):  # type: ignore[no-untyped-def]
    """e^x for x from -8 to 0, to 5e-15 of it: the Taylor series at y = x / 16, squared four times; exactly 1 at 0.

    Of numbers or arrays, in double precision. All bits are the same where each product and each sum is rounded: by
    numpy, in compiled functions without `fastmath`, in OpenCL C without contraction.
    """
    y = x / 16
    s = (y * (1 / 87178291200) + 1 / 6227020800) * y + 1 / 479001600
    s = ((s * y + 1 / 39916800) * y + 1 / 3628800) * y + 1 / 362880
    s = ((s * y + 1 / 40320) * y + 1 / 5040) * y + 1 / 720
    s = ((s * y + 1 / 120) * y + 1 / 24) * y + 1 / 6
    s = ((s * y + 1 / 2) * y + 1) * y + 1
    s = s * s
    s = s * s
    s = s * s
    return s * s
