"""The force of a bond without a root and a division.

It is w e g(e) (xi + eta) with e = (2 xi.eta + eta.eta) / xi.xi, the stiffness over length w, and

    g(e) = 1 / (1 + e + sqrt(1 + e))

which is free of cancellation. Polynomials replace g with the accuracy of a root and a division: of degree 5 for |e| up
to `NARROW`, enough for most bonds of brittle materials, and of degree 10 up to `WIDE` (in single precision 2 and 4).
They interpolate g at Chebyshev points.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, localcontext
from functools import cache
from math import cos, pi

NARROW, WIDE = 1 / 256, 1 / 16  # of |e|
DEGREES = {"float64": (5, 10), "float32": (2, 4)}
DIGITS = 50


@cache
def coefficients(precision: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The coefficients of 1, e, e^2 ... of the force polynomials for |e| up to NARROW and up to WIDE."""
    narrow, wide = DEGREES[precision]
    return _interpolated(_pull, NARROW, narrow), _interpolated(_pull, WIDE, wide)


@cache
def stretch_coefficients(precision: str = "float64") -> tuple[float, ...]:
    """The coefficients of 1, e, e^2 ... of the polynomial for the stretch over e, for |e| up to NARROW."""
    return _interpolated(lambda e: 1 / (1 + (1 + e).sqrt()), NARROW, DEGREES[precision][0])


def _pull(e: Decimal) -> Decimal:
    return 1 / (1 + e + (1 + e).sqrt())


def _interpolated(function: Callable[[Decimal], Decimal], reach: float, degree: int) -> tuple[float, ...]:
    """The interpolating polynomial of a function of e at degree + 1 points, by Newton's differences."""
    with localcontext() as context:
        context.prec = DIGITS
        points = [Decimal(reach * cos(pi * (2 * k + 1) / (2 * degree + 2))) for k in range(degree + 1)]
        differences = [function(e) for e in points]
        for order in range(1, degree + 1):
            for k in range(degree, order - 1, -1):
                differences[k] = (differences[k] - differences[k - 1]) / (points[k] - points[k - order])
        polynomial = [Decimal(0)]
        for difference, point in zip(reversed(differences), reversed(points), strict=True):
            shifted = [Decimal(0), *polynomial]
            polynomial = [high - point * low for high, low in zip(shifted, [*polynomial, Decimal(0)], strict=True)]
            polynomial[0] += difference
        return tuple(float(value) for value in polynomial[: degree + 1])
