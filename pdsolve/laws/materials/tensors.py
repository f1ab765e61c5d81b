"""Tensors in space as tuples of nine numbers, row by row, and symmetric ones of six: xx, yy, zz, xy, xz, yz."""

from __future__ import annotations

from numba import njit

from pdsolve.laws.law import INNER


@njit(**INNER)
def det(a):  # type: ignore[no-untyped-def]
    return a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) + a[2] * (a[3] * a[7] - a[4] * a[6])


@njit(**INNER)
def inverse(a):  # type: ignore[no-untyped-def]
    c = 1 / det(a)
    return (
        c * (a[4] * a[8] - a[5] * a[7]),
        c * (a[2] * a[7] - a[1] * a[8]),
        c * (a[1] * a[5] - a[2] * a[4]),
        c * (a[5] * a[6] - a[3] * a[8]),
        c * (a[0] * a[8] - a[2] * a[6]),
        c * (a[2] * a[3] - a[0] * a[5]),
        c * (a[3] * a[7] - a[4] * a[6]),
        c * (a[1] * a[6] - a[0] * a[7]),
        c * (a[0] * a[4] - a[1] * a[3]),
    )


@njit(**INNER)
def transposed(a):  # type: ignore[no-untyped-def]
    return (a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8])


@njit(**INNER)
def rotation(F):  # type: ignore[no-untyped-def]
    """R of F = R U by N. J. Higham, SIAM J. Sci. Stat. Comput. 7 (1986) 1160-1174.

    Accurate to round-off if U stretches by factors of at most 30.
    """
    R = F
    for _ in range(10):
        R = mean(R, transposed(inverse(R)))
    return R


@njit(**INNER)
def symmetric(a):  # type: ignore[no-untyped-def]
    """The symmetric part of nine components, as six."""
    return (a[0], a[4], a[8], (a[1] + a[3]) / 2, (a[2] + a[6]) / 2, (a[5] + a[7]) / 2)


@njit(**INNER)
def full(s):  # type: ignore[no-untyped-def]
    """The nine components of a symmetric tensor from its six."""
    return (s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2])


@njit(**INNER)
def grown(h):  # type: ignore[no-untyped-def]
    """The deformation gradient I + h of a displacement gradient h."""
    return (1 + h[0], h[1], h[2], h[3], 1 + h[4], h[5], h[6], h[7], 1 + h[8])


@njit(**INNER)
def contracted(a, b):  # type: ignore[no-untyped-def]
    """a : b of two symmetric tensors, six components each."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@njit(**INNER)
def hooke(first, shear, e):  # type: ignore[no-untyped-def]
    """lambda tr e I + 2 mu e."""
    p = first * (e[0] + e[1] + e[2])
    s = 2 * shear
    return (p + s * e[0], p + s * e[1], p + s * e[2], s * e[3], s * e[4], s * e[5])


@njit(**INNER)
def compliant(first, shear, s):  # type: ignore[no-untyped-def]
    """The strain of a stress by Hooke's law."""
    p, c = first / (3 * first + 2 * shear) * (s[0] + s[1] + s[2]), 1 / (2 * shear)
    return (c * (s[0] - p), c * (s[1] - p), c * (s[2] - p), c * s[3], c * s[4], c * s[5])


@njit(**INNER)
def with_zz(e, zz):  # type: ignore[no-untyped-def]
    return (e[0], e[1], zz, e[3], e[4], e[5])


@njit(**INNER)
def difference(a, b):  # type: ignore[no-untyped-def]
    return (
        a[0] - b[0],
        a[1] - b[1],
        a[2] - b[2],
        a[3] - b[3],
        a[4] - b[4],
        a[5] - b[5],
        a[6] - b[6],
        a[7] - b[7],
        a[8] - b[8],
    )


@njit(**INNER)
def mean(a, b):  # type: ignore[no-untyped-def]
    return (
        (a[0] + b[0]) / 2,
        (a[1] + b[1]) / 2,
        (a[2] + b[2]) / 2,
        (a[3] + b[3]) / 2,
        (a[4] + b[4]) / 2,
        (a[5] + b[5]) / 2,
        (a[6] + b[6]) / 2,
        (a[7] + b[7]) / 2,
        (a[8] + b[8]) / 2,
    )


@njit(**INNER)
def added(a, b):  # type: ignore[no-untyped-def]
    """The sum of two symmetric tensors of six components each."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])
