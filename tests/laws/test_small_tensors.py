"""Vectors and matrices as tuples: what Python computes and what is compiled instead, against NumPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pdsolve.laws import small_tensors

Array = NDArray[np.float64]
SYMMETRIC = {2: ([0, 0, 1], [0, 1, 1]), 3: ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])}  # rows and columns of components
CASES: dict[
    str, tuple[str, Callable[..., Array]]
] = {  # arguments: w a number, a a vector, A a matrix, S a symmetric one
    "with_dyad": ("Awab", lambda A, w, a, b: A + w * np.outer(a, b)),
    "product": ("AB", lambda A, B: A @ B),
    "summed": ("AB", lambda A, B: A + B),
    "mapped": ("wAazb", lambda w, A, x, z, y: w * (A @ x + z * y)),
    "mapped_both": ("wAaBb", lambda w, A, x, B, y: w * (A @ x + B @ y)),
    "along": ("wab", lambda w, x, y: w * (x + y)),
}


def given(kinds: str, d: int) -> list[Array]:
    """Random arguments of these kinds."""
    random = np.random.default_rng(d)
    return [random.uniform(-2, 2, {"w": (), "z": (), "a": d, "b": d}.get(kind, (d, d))) for kind in kinds]


def said(name: str, *arguments: object) -> list[object]:
    """What Python and what is compiled say of arguments."""
    compiled = getattr(small_tensors, f"_{name}")(*arguments)
    return [getattr(small_tensors, name)(*arguments), compiled(*arguments)]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", CASES)
def test_what_is_computed_is_what_numpy_computes(name: str, d: int) -> None:
    kinds, expected = CASES[name]
    arguments = given(kinds, d)
    tuples = [tuple(one.ravel().tolist()) if one.ndim else float(one) for one in arguments]
    for found in said(name, *tuples):
        assert found == pytest.approx(expected(*arguments).ravel().tolist(), rel=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_a_square_is_added_to_the_symmetric_matrix_behind_another(d: int) -> None:
    A, S, w, a = given("ASwa", d)
    S += S.T
    sums = (*A.ravel().tolist(), *S[SYMMETRIC[d]].tolist())
    for first, second in said("with_square", sums, float(w), tuple(a.tolist())):  # type: ignore[misc]
        assert first == tuple(A.ravel().tolist())
        assert second == pytest.approx((S + w * np.outer(a, a))[SYMMETRIC[d]].tolist(), rel=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_matrices_are_taken_from_rows_and_apart(d: int) -> None:
    like, m = (0.0,) * d, np.arange(60.0).reshape(2, 30)
    for found in said("square", m, 1, 5, like):
        assert found == tuple(range(35, 35 + d * d))
    both = tuple(range(30, 30 + 2 * d * d))
    for found in said("squares", m, 1, like):
        assert found == both
    for found in said("halves", both):
        assert found == (both[: d * d], both[d * d :])
