"""Two materials in a plate: whose bonds, whose mass, and what a wave makes of it."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from periodic_plates import joined
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, equilibrium, matrix, sources

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Material, Region
from pdmesh.model.lattice_calibration import calibration
from pdmesh.model.material_constants import critical_stretch
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws import law_of, limits
from pdsolve.laws.law import Sizes
from pdsolve.laws.pair_laws import brittle
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.schemes import average_horizon

SOFT = Material(E=20e9, rho=1200.0, G0=500.0, law="bilinear", kr=4.0)
HALF = 12


def layered(height: int = 12, columns: int = 2 * HALF, stiff: Material = GLASS, soft: Material = SOFT) -> Model:
    """Stiff left of x = 0, soft right of it."""
    grid = square_grid(columns, height, x0=-(columns - 1) / 2e3)
    region = Region(box=(0.0, -1.0, 1.0, 1.0), material=soft)
    return plate(grid, 3, material=stiff, regions=(region,))


def between(bonds: Bonds, left: int, right: int) -> int:
    """The place of the bond from one node to another."""
    own = range(bonds.start[left], bonds.start[left + 1])
    return next(k for k in own if bonds.neighbour[k] == right)


def test_density_is_that_of_the_region() -> None:
    model = layered()
    left = model.grid.position[:, 0] < 0
    problem = prepare(model, Options(threads=1))
    assert np.array_equal(problem.system.model.rho, np.where(left, 2235.0, 1200.0))
    problem.state.rate[:, 0] = 2.0
    mass = 1e-6 * 12 * HALF * (2235 + 1200)
    assert compute_energy_balance_row(*problem, 0).kinetic == pytest.approx(mass / 2 * 4, rel=1e-14)
    assert compute_energy_balance_row(*problem, 0).momentum_x == pytest.approx(mass * 2, rel=1e-14)


def test_the_conservative_rule_at_an_interface() -> None:
    """Each end brings half its stiffness; peak and limit keep the mean energy up to the peak and of the whole."""
    model = layered(height=25, columns=40)
    bonds = bonds_of(prepare(model, Options(threads=1)))
    left, right = 12 * 40 + 19, 12 * 40 + 20  # across the interface, in the middle of the plate
    pure = [bonds_of(prepare(plate(model.grid, 3, material=m), Options(threads=1))) for m in (GLASS, SOFT)]
    k = [between(b, left, right) for b in pure]
    c = [b.stiffness[i] for b, i in zip(pure, k, strict=True)]
    peak, limit = ([getattr(b, name)[i] for b, i in zip(pure, k, strict=True)] for name in ("peak", "limit"))
    at = between(bonds, left, right)
    there, back = bonds.stiffness[at], bonds.stiffness[between(bonds, right, left)]
    assert there == pytest.approx(back, rel=1e-14)  # equal areas
    mean = (c[0] + c[1]) / 2
    assert there / mean == pytest.approx(0.925, abs=1e-3)  # what the energy correction makes of it
    own_peak = np.sqrt((c[0] * peak[0] ** 2 + c[1] * peak[1] ** 2) / (2 * mean))
    own_limit = (c[0] * peak[0] * limit[0] + c[1] * peak[1] * limit[1]) / (2 * mean * own_peak)
    assert bonds.peak[at] == pytest.approx(own_peak, rel=1e-12)
    assert bonds.limit[at] == pytest.approx(own_limit, rel=1e-12)
    spent = mean * bonds.peak[at] * bonds.limit[at]
    assert spent == pytest.approx((c[0] * peak[0] * limit[0] + c[1] * peak[1] * limit[1]) / 2, rel=1e-12)


def test_the_conservative_rule_gives_equal_pairs() -> None:
    """c_ij = c_ji, s_p and s_0 alike both ways: momentum is kept, and a bond breaks as one."""
    bonds = bonds_of(prepare(layered(), Options(threads=1)))
    n = len(bonds.start) - 1
    table = np.zeros((3, n, n))
    for layer, column in enumerate((bonds.stiffness, bonds.peak, bonds.limit)):
        table[layer, sources(bonds), bonds.neighbour] = column
    for layer in table:
        assert np.allclose(layer, layer.T, rtol=1e-14, atol=0)


def test_the_thesis_rule_at_an_interface() -> None:
    """A bond has the constants of its own node's material: two halves that differ."""
    model = layered(height=25, columns=40)
    bonds = bonds_of(prepare(model, Options("thesis", threads=1)))
    left, right = 12 * 40 + 19, 12 * 40 + 20
    there, back = between(bonds, left, right), between(bonds, right, left)
    assert bonds.stiffness[there] / bonds.stiffness[back] == pytest.approx(65 / 20, rel=1e-12)
    for at, material in ((there, GLASS), (back, SOFT)):
        horizon = np.array([3e-3])
        own = limits(material, Sizes(critical_stretch(material, horizon), horizon / 3, horizon, 3.0))
        assert (bonds.peak[at], bonds.limit[at]) == pytest.approx((own.peak[0], own.limit[0]), rel=1e-14)


def test_far_from_the_interface_each_material_is_itself() -> None:
    """Bonds, peak and limit of a node deep in either half are those of a plate of that material alone."""
    model = layered(height=25, columns=60)
    problem = prepare(model, Options(threads=1))
    for material, node in ((GLASS, 12 * 60 + 12), (SOFT, 12 * 60 + 47)):
        alone = plate(model.grid, 3, material=material)
        one, two = (bonds_of(p) for p in (problem, prepare(alone, Options(threads=1))))
        own = slice(one.start[node], one.start[node + 1]), slice(two.start[node], two.start[node + 1])
        for name in ("stiffness", "peak", "limit"):
            assert getattr(one, name)[own[0]] == pytest.approx(getattr(two, name)[own[1]], rel=1e-12)
    found = calibration(3, GLASS), calibration(3, SOFT)
    assert found[0] == found[1]  # of the lattice, not of E


def test_a_bar_of_two_halves_stretches_as_springs_in_series() -> None:
    """Held at its ends, no lateral motion: u at the interface divides as the compliances, up to the horizon's width."""
    columns = 80
    model = layered(height=25, columns=columns, soft=msgspec.structs.replace(SOFT, law="brittle"))
    whole = prepare(model, Options(threads=1))
    strip = joined(whole, (-np.inf, 12e-3, np.inf, 13e-3))
    x = strip.system.model.grid.position[:, 0]
    held, at = np.zeros((columns, 2), dtype=bool), np.zeros((columns, 2))
    held[:, 1] = True
    ends = np.abs(x) > 36.9e-3
    held[ends, 0] = True
    at[ends, 0] = 1e-6 * np.sign(x[ends])
    u = equilibrium(strip, held, at)[:, 0]
    slope = {
        side: np.polyfit(x[far], u[far], 1)[0]
        for side, far in (("stiff", (x > -30e-3) & (x < -10e-3)), ("soft", (x < 30e-3) & (x > 10e-3)))
    }
    assert slope["soft"] / slope["stiff"] == pytest.approx(65 / 20, rel=1e-6)  # measured 4e-10
    stress = {side: slope[side] * E for side, E in (("stiff", 65e9), ("soft", 20e9))}
    classical = 2e-6 / (37e-3 / 65e9 + 37e-3 / 20e9)
    assert stress["stiff"] == pytest.approx(classical, rel=0.05)  # measured 1.6e-2
    assert (
        np.abs(matrix(strip) @ np.column_stack([u, 0 * u]).ravel()).reshape(-1, 2)[~ends, 0].max()
        < 1e-6 * 65e9 * 1e-6 / 1e-3
    )


def test_bonds_between_two_brittle_materials_are_brittle() -> None:
    """No round-off between peak and limit that would make them soften."""
    model = layered(soft=msgspec.structs.replace(SOFT, law="brittle", E=6e9, G0=20.0))
    bonds = average_horizon.fill(model).whole().bonds
    assert np.array_equal(bonds.peak, bonds.limit)
    assert law_of(model) is brittle.LAW
