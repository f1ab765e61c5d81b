"""Gradients fitted together with curvatures."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pdmesh.model.neighbours import tree_of
from pdsolve.fracture.gradients import curved_gradients_of, gradients_of


def families(position: NDArray[np.float64], reach: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    near = [sorted({*some} - {i}) for i, some in enumerate(tree_of(position).query_ball_point(position, reach))]
    return np.cumsum([0, *map(len, near)]), np.concatenate([np.array(some, dtype=np.int64) for some in near])


@pytest.mark.parametrize("counts", [(12, 9), (8, 7, 6)])
def test_quadratic_values_have_their_gradients_at_edges_too(counts: tuple[int, ...]) -> None:
    d, h = len(counts), 2e-3
    x = h * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, d).astype(float)
    draw = np.random.default_rng(1)
    slope, curve = draw.normal(size=(2, d)), draw.normal(size=(2, d, d)) / h
    curve = curve + curve.transpose(0, 2, 1)
    values = x @ slope.T + np.einsum("na,kab,nb->nk", x, curve, x) / 2
    exact = slope + np.einsum("kab,nb->nka", curve, x)
    volume, bonds = np.full(len(x), h**d), families(x, 3.01 * h)
    found = curved_gradients_of(x, volume, values, *bonds)
    near = ((x < 2.5 * h) | (x > (np.array(counts) - 3.5) * h)).sum(axis=1)  # axes along which it is beside an edge
    most = np.abs(exact).max()
    assert np.abs(found - exact)[near <= 1].max() < 1e-9 * most  # measured: 2e-13
    flat = gradients_of(x, volume, values, *bonds)
    assert np.abs(flat - exact)[near == 1].max() > 0.05 * most
    assert np.array_equal(found[near != 1], flat[near != 1])


def test_a_family_of_few_bonds_is_fitted_without_curvatures() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [5.0, 5.0]])
    start, neighbour = np.array([0, 2, 4, 6, 6]), np.array([1, 2, 0, 2, 0, 1])
    found = curved_gradients_of(x, np.ones(4), x[:, :1] + 2 * x[:, 1:], start, neighbour)
    assert found[:3, 0] == pytest.approx(np.tile([1.0, 2.0], (3, 1)))
    assert np.isnan(found[3]).all()
