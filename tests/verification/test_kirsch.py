"""A large plate with a circular hole in tension: the classical solution, approached as the horizon shrinks."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from system_checks import equilibrium

from pdmesh.model.document import Material
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

UNIT = msgspec.structs.replace(GLASS, E=1.0, micromodulus="constant")
CONICAL = msgspec.structs.replace(UNIT, micromodulus="conical")
RADIUS = 1.0
NU = 1 / 3  # of plane stress


def classical(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 2) of an infinite plate with a hole of radius 1 under unit tension along x, E = 1 (Kirsch)."""
    G, kappa = 1 / (2 * (1 + NU)), (3 - NU) / (1 + NU)
    r, angle = np.hypot(*position.T), np.arctan2(position[:, 1], position[:, 0])
    cos, sin = np.cos(2 * angle), np.sin(2 * angle)
    radial = ((kappa - 1) * r + 2 * r * cos + 2 / r * (1 + (kappa + 1) * cos - cos / r**2)) / (8 * G)
    around = -(2 * r + 2 / r * (kappa - 1 + 1 / r**2)) * sin / (8 * G)
    x, y = np.cos(angle), np.sin(angle)
    return np.column_stack([radial * x - around * y, radial * y + around * x])


def solved(fineness: int, m: float, material: Material = UNIT, mode: str = "conservative") -> tuple[float, float]:
    """A square of half-width 3, `fineness` nodes a radius, the classical displacements imposed in the outer layer of
    (m + 1/2) spacings: relative L2 error of displacement, and of the largest |u| at the edge of the hole."""
    delta, side = RADIUS / fineness, 6 * fineness
    full = square_grid(side, side, delta)
    position = delta * (np.column_stack([np.arange(side**2) % side, np.arange(side**2) // side]) - (side - 1) / 2)
    keep = np.hypot(*position.T) >= RADIUS
    angle = 2 * np.pi * np.arange(360) / 360
    grid = dataclasses.replace(
        full,
        **{name: getattr(full, name)[keep] for name in ("ids", "delta", "border", "hole_id")},
        position=position[keep],
        outline=(3.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),),
        holes=(RADIUS * np.column_stack([np.cos(angle), np.sin(angle)]),),
    )
    problem = prepare(plate(grid, m, material=material), Options(mode, threads=1))
    exact = classical(grid.position)
    outer = np.abs(grid.position).max(axis=1) > 3 - (m + 0.5) * delta
    found = equilibrium(problem, np.column_stack([outer, outer]), exact)
    inner = ~outer
    error = float(np.linalg.norm((found - exact)[inner]) / np.linalg.norm(exact[inner]))
    edge = np.hypot(*grid.position.T) < RADIUS + delta
    return error, float(np.hypot(*found[edge].T).max() / np.hypot(*exact[edge].T).max() - 1)


def order(fineness: tuple[int, ...], errors: list[float]) -> float:
    """The exponent of the spacing that fits the errors best."""
    return float(-np.polyfit(np.log(fineness), np.log(errors), 1)[0])


@pytest.mark.slow
def test_coarse() -> None:
    """Eight nodes a radius, published for the energy correction: 1.4 per cent."""
    error, edge = solved(8, 3)
    assert error == pytest.approx(0.0140, abs=5e-4)  # measured 0.01395
    assert abs(edge) <= 0.024  # published without correction; measured 0.0166
    assert solved(8, 4)[0] <= 0.0150  # measured 0.01447
    assert solved(8, 4, CONICAL)[0] <= 0.0085  # measured 0.00817


@pytest.mark.slow
def test_the_thesis_mode_coarse() -> None:
    """Published without correction: 1.8 per cent."""
    assert solved(8, 3, UNIT, "thesis")[0] <= 0.018  # measured 0.0148
    assert solved(8, 4, CONICAL, "thesis")[0] <= 0.018  # measured 0.0170


@pytest.mark.slow
def test_delta_convergence_m_3() -> None:
    """Published for m = 3, constant, energy correction, 8, 16, 32 nodes a radius: 1.4, 0.7, 0.52 per cent.

    Not order 1: what is left at m = 3 is the lattice, 5 per cent stiffer to stretch than to shear.
    """
    errors = [solved(fineness, 3)[0] for fineness in (8, 16, 32)]
    assert errors == pytest.approx([0.014, 0.007, 0.0052], abs=5e-4)  # measured 0.01395, 0.00728, 0.00515
    assert order((8, 16, 32), errors) == pytest.approx(0.72, abs=0.05)  # measured 0.718


@pytest.mark.slow
@pytest.mark.parametrize(
    ("material", "measured"),
    [(UNIT, (0.01447, 0.00588, 0.00290)), (CONICAL, (0.00817, 0.00318, 0.00177))],
    ids=["constant", "conical"],
)
def test_delta_convergence_m_4(material: Material, measured: tuple[float, ...]) -> None:
    """First order in the horizon, as long as the lattice's own error is the smaller part."""
    errors = [solved(fineness, 4, material)[0] for fineness in (8, 16, 32)]
    assert errors == pytest.approx(measured, rel=0.02)
    assert order((8, 16), errors[:2]) >= 1.2  # measured 1.30, 1.36
    assert order((8, 16, 32), errors) >= 0.95  # measured 1.16, 1.10


@pytest.mark.slow
def test_m_convergence() -> None:
    """A horizon of a quarter radius, m = 2, 3, 4, 6: the error falls to what the horizon itself makes, 0.5 per cent."""
    errors = [solved(4 * m, m)[0] for m in (2, 3, 4, 6)]
    assert errors == pytest.approx([0.00959, 0.00826, 0.00588, 0.00540], rel=0.02)  # m = 8: 0.00501
    assert order((3, 4, 6), [error - 0.0049 for error in errors[1:]]) >= 2.5  # measured 2.68
