"""Vectors and matrices of two or three dimensions as tuples, row by row, which compilers keep in registers.

Components are numbers of any kind, or lanes of many bonds (`pdsolve.codegen.lanes`).
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from pdsolve.laws.law import INLINE


def with_dyad(A: Any, w: Any, a: Any, b: Any) -> Any:
    """A + w a b^T."""
    d = len(a)
    return tuple(A[d * r + c] + (w * b[c]) * a[r] for r in range(d) for c in range(d))


def with_square(sums: Any, w: Any, a: Any) -> tuple[Any, Any]:
    """Add w a a^T to the symmetric matrix (xx, xy, yy or xx, yy, zz, xy, xz, yz) that follows a matrix; returns
    both."""
    d = len(a)
    pairs = [(0, 0), (0, 1), (1, 1)] if d == 2 else [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    return sums[: d * d], tuple(s + (w * a[r]) * a[c] for s, (r, c) in zip(sums[d * d :], pairs, strict=True))


def with_moments(sums: Any, w: Any, a: Any, x: Any, p: Any) -> Any:
    """Add w a x^T, w a a^T, w p a^T and w p p^T to the sums; the second and the last are symmetric, as in
    `with_square`."""
    d = len(a)
    every = [(r, c) for r in range(d) for c in range(d)]
    pairs = [(0, 0), (0, 1), (1, 1)] if d == 2 else [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    products = [(a[r], x[c]) for r, c in every] + [(a[r], a[c]) for r, c in pairs]
    products += [(p[r], a[c]) for r, c in every] + [(p[r], p[c]) for r, c in pairs]
    return tuple(s + w * first * second for s, (first, second) in zip(sums, products, strict=True))


def summed(A: Any, B: Any) -> Any:
    """A + B, four or nine components each."""
    return tuple(a + b for a, b in zip(A, B, strict=True))


def product(A: Any, B: Any) -> Any:
    """A B, four or nine components each."""
    d = 2 if len(A) == 4 else 3
    return tuple(sum(A[d * r + k] * B[d * k + c] for k in range(d)) for r in range(d) for c in range(d))


def mapped(w: Any, A: Any, x: Any, z: Any, y: Any) -> Any:
    """w (A x + z y), with a number z."""
    d = len(x)
    return tuple(w * (sum(A[d * r + c] * x[c] for c in range(d)) + z * y[r]) for r in range(d))


def mapped_both(w: Any, A: Any, x: Any, B: Any, y: Any) -> Any:
    """w (A x + B y)."""
    d = len(x)
    return tuple(w * sum(A[d * r + c] * x[c] + B[d * r + c] * y[c] for c in range(d)) for r in range(d))


def halves(both: Any) -> Any:
    """The two consecutive matrices in a tuple."""
    return both[: len(both) // 2], both[len(both) // 2 :]


def squares(m: Any, i: Any, like: Any) -> Any:
    """The two consecutive matrices at the beginning of row i of m."""
    return tuple(m[i, : 2 * len(like) ** 2])


def along(w: Any, x: Any, y: Any) -> Any:
    """w (x + y)."""
    return tuple(w * (a + b) for a, b in zip(x, y, strict=True))


def square(m: Any, i: Any, at: Any, like: Any) -> Any:
    """The matrix in row i of m, from `at` on, as a tuple; `like` is a vector of its width."""
    return tuple(m[i, at : at + len(like) ** 2])


def blank_square(like: Any, none: Any) -> Any:
    """A zero matrix as a tuple; `like` is a vector of its width, `none` the 0 it consists of."""
    return (none,) * len(like) ** 2


def blank_symmetric(like: Any, none: Any) -> Any:
    """A symmetric zero matrix as a tuple."""
    return (none,) * (3 * len(like) - 3)


def blank_moments(like: Any, none: Any) -> Any:
    """The sums of `with_moments` without a bond."""
    return (none,) * (2 * len(like) ** 2 + 2 * (3 * len(like) - 3))


def blank(like: Any, none: Any) -> Any:
    """A zero vector as a tuple."""
    return (none,) * len(like)


@overload(with_dyad, jit_options=INLINE)
def _with_dyad(A, w, a, b):  # type: ignore[no-untyped-def]
    if len(a) == 2:

        def plane(A, w, a, b):  # type: ignore[no-untyped-def]
            x, y = w * b[0], w * b[1]
            return (A[0] + x * a[0], A[1] + y * a[0], A[2] + x * a[1], A[3] + y * a[1])

        return plane

    def space(A, w, a, b):  # type: ignore[no-untyped-def]
        x, y, z = w * b[0], w * b[1], w * b[2]
        return (
            A[0] + x * a[0],
            A[1] + y * a[0],
            A[2] + z * a[0],
            A[3] + x * a[1],
            A[4] + y * a[1],
            A[5] + z * a[1],
            A[6] + x * a[2],
            A[7] + y * a[2],
            A[8] + z * a[2],
        )

    return space


@overload(with_square, jit_options=INLINE)
def _with_square(sums, w, a):  # type: ignore[no-untyped-def]
    if len(a) == 2:

        def plane(sums, w, a):  # type: ignore[no-untyped-def]
            x, y = w * a[0], w * a[1]
            return sums[:4], (sums[4] + x * a[0], sums[5] + x * a[1], sums[6] + y * a[1])

        return plane

    def space(sums, w, a):  # type: ignore[no-untyped-def]
        x, y, z = w * a[0], w * a[1], w * a[2]
        return sums[:9], (
            sums[9] + x * a[0],
            sums[10] + y * a[1],
            sums[11] + z * a[2],
            sums[12] + x * a[1],
            sums[13] + x * a[2],
            sums[14] + y * a[2],
        )

    return space


@overload(with_moments, jit_options=INLINE)
def _with_moments(sums, w, a, x, p):  # type: ignore[no-untyped-def]
    if len(a) == 2:

        def plane(sums, w, a, x, p):  # type: ignore[no-untyped-def]
            A = with_dyad(sums[:4], w, a, x)
            A, B = with_square(A + sums[4:7], w, a)
            D, C = with_square(with_dyad(sums[7:11], w, p, a) + sums[11:], w, p)
            return A + B + D + C

        return plane

    def space(sums, w, a, x, p):  # type: ignore[no-untyped-def]
        A = with_dyad(sums[:9], w, a, x)
        A, B = with_square(A + sums[9:15], w, a)
        D, C = with_square(with_dyad(sums[15:24], w, p, a) + sums[24:], w, p)
        return A + B + D + C

    return space


@overload(summed, jit_options=INLINE)
def _summed(A, B):  # type: ignore[no-untyped-def]
    if len(A) == 2:
        return lambda A, B: (A[0] + B[0], A[1] + B[1])
    if len(A) == 3:
        return lambda A, B: (A[0] + B[0], A[1] + B[1], A[2] + B[2])
    if len(A) == 4:
        return lambda A, B: (A[0] + B[0], A[1] + B[1], A[2] + B[2], A[3] + B[3])

    def space(A, B):  # type: ignore[no-untyped-def]
        return (
            A[0] + B[0],
            A[1] + B[1],
            A[2] + B[2],
            A[3] + B[3],
            A[4] + B[4],
            A[5] + B[5],
            A[6] + B[6],
            A[7] + B[7],
            A[8] + B[8],
        )

    return space


@overload(product, jit_options=INLINE)
def _product(A, B):  # type: ignore[no-untyped-def]
    if len(A) == 4:
        return lambda A, B: (
            A[0] * B[0] + A[1] * B[2],
            A[0] * B[1] + A[1] * B[3],
            A[2] * B[0] + A[3] * B[2],
            A[2] * B[1] + A[3] * B[3],
        )

    def space(A, B):  # type: ignore[no-untyped-def]
        return (
            A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
            A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
            A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
            A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
            A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
            A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
            A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
            A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
            A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
        )

    return space


@overload(mapped, jit_options=INLINE)
def _mapped(w, A, x, z, y):  # type: ignore[no-untyped-def]
    if len(x) == 2:
        return lambda w, A, x, z, y: (
            w * (A[0] * x[0] + A[1] * x[1] + z * y[0]),
            w * (A[2] * x[0] + A[3] * x[1] + z * y[1]),
        )

    def space(w, A, x, z, y):  # type: ignore[no-untyped-def]
        return (
            w * (A[0] * x[0] + A[1] * x[1] + A[2] * x[2] + z * y[0]),
            w * (A[3] * x[0] + A[4] * x[1] + A[5] * x[2] + z * y[1]),
            w * (A[6] * x[0] + A[7] * x[1] + A[8] * x[2] + z * y[2]),
        )

    return space


@overload(mapped_both, jit_options=INLINE)
def _mapped_both(w, A, x, B, y):  # type: ignore[no-untyped-def]
    if len(x) == 2:
        return lambda w, A, x, B, y: (
            w * (A[0] * x[0] + A[1] * x[1] + B[0] * y[0] + B[1] * y[1]),
            w * (A[2] * x[0] + A[3] * x[1] + B[2] * y[0] + B[3] * y[1]),
        )

    def space(w, A, x, B, y):  # type: ignore[no-untyped-def]
        return (
            w * (A[0] * x[0] + A[1] * x[1] + A[2] * x[2] + B[0] * y[0] + B[1] * y[1] + B[2] * y[2]),
            w * (A[3] * x[0] + A[4] * x[1] + A[5] * x[2] + B[3] * y[0] + B[4] * y[1] + B[5] * y[2]),
            w * (A[6] * x[0] + A[7] * x[1] + A[8] * x[2] + B[6] * y[0] + B[7] * y[1] + B[8] * y[2]),
        )

    return space


@overload(halves, jit_options=INLINE)
def _halves(both):  # type: ignore[no-untyped-def]
    if len(both) == 8:
        return lambda both: (both[:4], both[4:])
    return lambda both: (both[:9], both[9:])


@overload(squares, jit_options=INLINE)
def _squares(m, i, like):  # type: ignore[no-untyped-def]
    count = len(like) ** 2
    return lambda m, i, like: square(m, i, 0, like) + square(m, i, count, like)


@overload(along, jit_options=INLINE)
def _along(w, x, y):  # type: ignore[no-untyped-def]
    if len(x) == 2:
        return lambda w, x, y: (w * (x[0] + y[0]), w * (x[1] + y[1]))
    return lambda w, x, y: (w * (x[0] + y[0]), w * (x[1] + y[1]), w * (x[2] + y[2]))


@overload(square, jit_options=INLINE)
def _square(m, i, at, like):  # type: ignore[no-untyped-def]
    if len(like) == 2:
        return lambda m, i, at, like: (m[i, at], m[i, at + 1], m[i, at + 2], m[i, at + 3])

    def space(m, i, at, like):  # type: ignore[no-untyped-def]
        return (
            m[i, at],
            m[i, at + 1],
            m[i, at + 2],
            m[i, at + 3],
            m[i, at + 4],
            m[i, at + 5],
            m[i, at + 6],
            m[i, at + 7],
            m[i, at + 8],
        )

    return space


@overload(blank_square, jit_options=INLINE)
def _blank_square(like, none):  # type: ignore[no-untyped-def]
    if len(like) == 2:
        return lambda like, none: (none, none, none, none)
    return lambda like, none: (none, none, none, none, none, none, none, none, none)


@overload(blank_symmetric, jit_options=INLINE)
def _blank_symmetric(like, none):  # type: ignore[no-untyped-def]
    if len(like) == 2:
        return lambda like, none: (none, none, none)
    return lambda like, none: (none, none, none, none, none, none)


@overload(blank_moments, jit_options=INLINE)
def _blank_moments(like, none):  # type: ignore[no-untyped-def]
    def blanks(like, none):  # type: ignore[no-untyped-def]
        half = blank_square(like, none) + blank_symmetric(like, none)
        return half + half

    return blanks


@overload(blank, jit_options=INLINE)
def _blank(like, none):  # type: ignore[no-untyped-def]
    if len(like) == 0:
        return lambda like, none: ()
    if len(like) == 2:
        return lambda like, none: (none, none)
    return lambda like, none: (none, none, none)
