"""The conservative mode's correction of surfaces and of the faces of pre-cracks, beside one made bond by bond."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import sources

from pdmesh.model.lattice_calibration import hu_beta, offsets
from pdmesh.model.node_grid import Grid
from pdsolve.schemes import average_horizon
from pdsolve.schemes.average_horizon import ALL

COLUMNS, ROWS, DELTA = 13, 9, 1e-3
CRACKS = {
    "none": np.empty((0, 4)),
    "along x": np.array([[-1e-3, 3.5e-3, 6.4e-3, 3.5e-3]]),
    "along y": np.array([[5.5e-3, -1e-3, 5.5e-3, 4.3e-3]]),
    "two that cross": np.array([[2.2e-3, 1.3e-3, 8.9e-3, 5.6e-3], [3.1e-3, 6.7e-3, 7.4e-3, 0.7e-3]]),
}


def cracked(cracks: np.ndarray) -> Grid:
    """A plate that is wider than high, so that its axes differ."""
    return dataclasses.replace(square_grid(COLUMNS, ROWS, DELTA), cracks=cracks)


def crosses(a: np.ndarray, b: np.ndarray, crack: np.ndarray) -> bool:
    """Whether the segment from a to b passes through the crack; none here touches a node or a tip."""

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    c, d = crack[:2], crack[2:]
    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def weight(xi: np.ndarray, m: float, profile: str) -> float:
    """What a bond (2,), in spacings, is worth next to others, as a micromodulus and a share of a cell."""
    length = np.hypot(*xi)
    return float(max(1 - length / m, 0) if profile == "conical" else hu_beta(length, np.array(m), np.array(1.0)))


def factors(grid: Grid, m: float, profile: str) -> dict[tuple[int, int], float]:
    """The correction of every bond by the energy method, in uniform stretching along x and along y."""
    x = grid.position / DELTA

    def energy(xi: np.ndarray) -> np.ndarray:
        return weight(xi, m, profile) * xi**4 / np.hypot(*xi) ** 3

    full = sum(energy(xi)[0] for xi in offsets(m + 1))
    held = np.zeros((len(x), 2))
    bonds = []
    for i, a in enumerate(x):
        for j, b in enumerate(x):
            there = i != j and weight(b - a, m, profile) > 0
            if there and not any(crosses(a, b, crack / DELTA) for crack in grid.cracks):
                bonds.append((i, j))
                held[i] += energy(b - a)
    lack = np.where(held > 0, full / np.where(held > 0, held, 1.0), 1.0)
    found = {}
    for i, j in bonds:
        n = (x[j] - x[i]) / np.hypot(*(x[j] - x[i]))
        found[i, j] = float(np.hypot(*(n / ((lack[i] + lack[j]) / 2))) ** -1)
    return found


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("cracks", CRACKS)
@pytest.mark.parametrize(("m", "profile"), [(3, "conical"), (2.5, "constant")])
def test_every_bond_has_the_factor_of_the_energy_method(cracks: str, m: float, profile: str) -> None:
    """Bonds cut by a pre-crack are gone, and their energy is missing where the others' is made up for."""
    model = plate(cracked(CRACKS[cracks]), m, material=msgspec.structs.replace(GLASS, micromodulus=profile))
    corrected = average_horizon.fill(model).whole().bonds
    bare = average_horizon.fill(model, ALL._replace(surfaces=False)).whole().bonds
    assert np.array_equal(corrected.neighbour, bare.neighbour)
    pairs = list(zip(sources(bare).tolist(), bare.neighbour.tolist(), strict=True))
    expected = factors(model.grid, m, profile)
    assert set(pairs) == set(expected)
    made = corrected.stiffness / bare.stiffness
    assert made == pytest.approx([expected[pair] for pair in pairs], rel=1e-12)  # measured 4e-15
    assert made.max() > 1.9  # the corners


def test_a_crack_right_through_leaves_two_plates() -> None:
    """To the last bit but for round-off, bonds of the upper half are those of a plate that ends there."""
    model = plate(cracked(np.array([[-1e-3, 3.5e-3, 13e-3, 3.5e-3]])), 3)
    bonds = average_horizon.fill(model).whole().bonds
    alone = average_horizon.fill(plate(square_grid(COLUMNS, ROWS - 4, DELTA, y0=4e-3), 3)).whole().bonds
    first = 4 * COLUMNS
    assert np.array_equal(bonds.neighbour[bonds.start[first] :] - first, alone.neighbour)
    assert bonds.stiffness[bonds.start[first] :] == pytest.approx(alone.stiffness, rel=1e-13)


def test_a_node_without_an_intact_bond_spoils_nothing() -> None:
    """A crack through a node cuts all of its bonds; its neighbours go on with what is left."""
    model = plate(cracked(np.array([[5e-3, 3e-3, 7e-3, 3e-3]])), 3)
    bonds = average_horizon.fill(model).whole().bonds
    counts = np.diff(bonds.start)
    assert (counts == 0).sum() == 3
    assert np.isfinite(bonds.stiffness).all()
    assert (bonds.stiffness > 0).all()
