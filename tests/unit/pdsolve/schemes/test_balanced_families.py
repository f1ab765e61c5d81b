"""Uniform stress near borders of spacings is in equilibrium, in correspondence."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pdmesh import Body, Box, Material, Run, Scene, box, build
from pdsolve import Model
from pdsolve.bonds.assembly import Bonds
from pdsolve.schemes import families
from pdsolve.schemes.balanced_families import NO_FACTORS, border_factors

STEEL = Material(E=171e9, rho=1580, G0=1e3, failure="none", model="correspondence", nu=0.32)


def unbalanced(bonds: Bonds) -> NDArray[np.float64]:
    """Force density of a uniform stress at each node over the sum of that of its bonds: at most 1."""
    source, weight = bonds.source, bonds.weight
    nodes = len(bonds.start) - 1
    K = np.zeros((nodes, bonds.xi.shape[1], bonds.xi.shape[1]))
    np.add.at(K, source, weight[:, None, None] * bonds.xi[:, :, None] * bonds.xi[:, None, :])
    inverse = np.linalg.inv(K)
    way = weight[:, None] * np.einsum("bij,bj->bi", inverse[source] + inverse[bonds.neighbour], bonds.xi)
    r, size = np.zeros((nodes, way.shape[1])), np.zeros(nodes)
    np.add.at(r, source, way)
    np.add.at(size, source, np.linalg.norm(way, axis=1))
    return np.asarray(np.linalg.norm(r, axis=1) / size)


def bonds_and_places(scene: Scene | Body) -> tuple[Bonds, NDArray[np.float64]]:
    built = build(scene)
    return families.fill(Model(built.grid, built.settings)).whole().bonds, built.grid.position


def test_a_plate_of_two_spacings() -> None:
    """Measured 1.5e-3; 0.17 with equal influences, 0.12 without factors."""
    scene = Scene(box(-0.014, -0.01, 0.014, 0.01), 1e-3, STEEL, run=Run(duration=1e-6))
    bonds, place = bonds_and_places(scene.zone(box(0, -0.01, 0.014, 0.01), 5e-4))
    inside = (np.abs(place[:, 0]) < 9e-3) & (np.abs(place[:, 1]) < 5e-3)
    assert unbalanced(bonds)[inside].max() < 4e-3
    assert bonds.weight.min() > 0


@pytest.mark.slow
def test_a_body_of_two_spacings() -> None:
    scene = Body(Box((-0.02, -0.012, -0.012), (0.02, 0.012, 0.012)), 2e-3, STEEL, run=Run(duration=1e-6))
    bonds, place = bonds_and_places(scene.zone(Box((0, -0.012, -0.012), (0.02, 0.012, 0.012)), 1e-3))
    inside = (np.abs(place[:, 0]) < 0.01) & (np.abs(place[:, 1:]) < 5e-3).all(axis=1)
    assert unbalanced(bonds)[inside].max() < 4e-3


def test_one_spacing_has_no_factors() -> None:
    built = build(Scene(box(0, 0, 0.01, 0.01), 1e-3, STEEL, run=Run(duration=1e-6)))
    model = Model(built.grid, built.settings)
    source = families.fill(model)
    assert border_factors(built.grid, model.horizons, source.pairs, lambda rows: rows[:0], source.area) is NO_FACTORS


def test_bodies_of_different_spacings_have_no_factors() -> None:
    """A hammer near a plate: no bond goes from one to the other, so that their free faces stay as they are."""
    scene = Scene(box(0, 0, 0.01, 0.01), 1e-3, STEEL, run=Run(duration=1e-6))
    weights = []
    for spacing, gap in ((1e-3, 1e-4), (5e-4, 1e-4), (5e-4, 0.05)):
        hammer = box(0.01 + gap, 0, 0.016 + gap, 0.01)
        built = build(scene.rigid(hammer, "hammer", mass=1.0, velocity=(-5.0, 0.0), spacing=spacing))
        model = Model(built.grid, built.settings)
        bonds = families.fill(model).whole().bonds
        of_plate = built.grid.position[bonds.source, 0] < 0.01
        weights.append(bonds.weight[of_plate] / bonds.weight.max())
    assert weights[0] == pytest.approx(weights[1])
    assert weights[1].tolist() == weights[2].tolist()
