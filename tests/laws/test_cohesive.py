"""Cohesive bonds: what they spend in a lattice of any kind, how they unload, and the fast kernel against the list."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid

from pdmesh.model.cohesive_softening import AREA, critical_opening, crossing, first_stretch, largest_horizon
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws import law_of
from pdsolve.laws.pair_laws import cohesive
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.schemes import average_horizon
from pdsolve.schemes.separation_energy import cost, patch
from pdsolve.state import State

CONCRETE = Material(E=30e9, rho=2400.0, G0=100.0, law="cohesive", f_t=3e6)
INTEGRALS = {  # cross(0) / E and cross(1) / (E horizon) of a continuum, by plane and micromodulus
    ("stress", "constant"): (6 / np.pi, 9 / (2 * np.pi)),
    ("stress", "conical"): (6 / np.pi, 18 / (5 * np.pi)),
    ("strain", "constant"): (6.4 / np.pi, 24 / (5 * np.pi)),
    ("strain", "conical"): (6.4 / np.pi, 96 / (25 * np.pi)),
    ("space", "constant"): (3.0, 12 / 5),
    ("space", "conical"): (3.0, 2.0),
}
shapes = pytest.mark.parametrize("shape", AREA)
SLOW = pytest.mark.slow
PEAK, LIMIT, STIFFNESS = 1e-4, 9e-4, 2.0


@pytest.mark.parametrize(("plane", "profile"), INTEGRALS)
def test_sums_over_bonds_that_cross_a_line(plane: str, profile: str) -> None:
    """Against c |xi|^p over all bonds across a line, or a plane, of a continuum."""
    ratio = 10.0 if plane == "space" else 24.0
    found = crossing(msgspec.structs.replace(CONCRETE, plane=plane, micromodulus=profile), ratio)
    assert found == pytest.approx(INTEGRALS[plane, profile], rel=8e-3)  # measured 5.4e-3 in space, 2e-3


@pytest.mark.slow
@shapes
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("m", [3.0, 4.0])
def test_halves_moved_apart_spend_G0(shape: str, profile: str, plane: str, m: float) -> None:
    """The bonds that cross an axis line, over G0, where l_ch is 2.5 horizons."""
    length, G0 = 2.5 * m, 1e-12
    f_t = float(np.sqrt(G0 / length))
    given = {"shape": shape, "micromodulus": profile, "plane": plane, "G0": G0, "f_t": f_t, "E": 1.0}
    material = msgspec.structs.replace(CONCRETE, **given)
    model = patch(material, m)
    bonds = average_horizon.fill(model).whole().bonds
    assert cost(law_of(model), model, bonds) / G0 == pytest.approx(1, abs=1e-6)  # measured 1e-12


@pytest.mark.slow
@shapes
@pytest.mark.parametrize("profile", ["constant", "conical"])
def test_halves_moved_apart_in_space_spend_G0(shape: str, profile: str) -> None:
    """The bonds of one column of a cubic lattice that cross a plane, over G0, where l_ch is 2.5 horizons."""
    m, G0 = 3, 1e-12
    given = {"shape": shape, "micromodulus": profile, "plane": "space", "G0": G0, "E": 1.0}
    material = msgspec.structs.replace(CONCRETE, f_t=float(np.sqrt(G0 / (2.5 * m))), **given)
    wide, high = np.arange(-2 * m, 2 * m + 1.0), np.arange(-3 * m - 1, 3 * m + 1) + 0.5
    position = np.stack(np.meshgrid(wide, wide, high, indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(position)
    nowhere = np.full(count, -1)
    grid = Grid(np.arange(count), position, np.ones(count), nowhere >= 0, nowhere, np.zeros((0, 9)))
    model = Model(grid, Settings(material=material, horizon=Horizon(m)))
    whole = average_horizon.fill(model).whole().bonds
    source, middle = np.repeat(np.arange(count), np.diff(whole.start)), (position[:, :2] == 0).all(axis=1)
    column = middle[source] | middle[whole.neighbour]
    start = np.searchsorted(source[column], np.arange(count + 1))
    bonds = Bonds(start, *(part[column] for part in whole[1:]))
    assert cost(law_of(model), model, bonds) / G0 == pytest.approx(1, abs=1e-6)  # measured 2e-9


def one_bond(shape: str) -> tuple[BondList, State]:
    """Two nodes 1 m apart, bonded by a curve of this shape."""
    each, xi = np.ones(2), np.array([[1.0, 0.0], [-1.0, 0.0]])
    limits = STIFFNESS * each, PEAK * each, LIMIT * each
    bonds = Bonds(np.array([0, 1, 2]), np.array([1, 0], np.int32), xi, *limits, each)
    model = plate(square_grid(2, 1), material=msgspec.structs.replace(CONCRETE, shape=shape))
    operator = BondList(law_of(model), model, bonds, True)
    return operator, State(*np.zeros((3, 2, 2)), *np.zeros((3, 2)))


def pulled(operator: BondList, state: State, stretch: float) -> float:
    """Force over stiffness at a stretch, which the bond remembers."""
    state.value[1, 0], out = stretch, np.zeros((2, 2))
    operator.accumulate_force(state, out, 1, 0.0)
    return float(out[0, 0]) / STIFFNESS


@pytest.mark.parametrize(
    ("shape", "left"),  # g at t = 0.5: by hand
    [("linear", 0.5), ("bilinear", 3 / 14), ("exponential", (np.exp(-4) - np.exp(-8)) / (1 - np.exp(-8)))],
)
def test_a_bond_unloads_to_the_origin_and_is_elastic_in_compression(shape: str, left: float) -> None:
    operator, state = one_bond(shape)
    kappa = (PEAK + LIMIT) / 2
    assert pulled(operator, state, PEAK) == pytest.approx(PEAK, rel=1e-12)
    top = pulled(operator, state, kappa)
    assert top == pytest.approx(PEAK * left, rel=1e-9)
    spent = operator.energies(state)[1].sum()
    for share in (0.5, 0.1, 0.9, 1.0):
        assert pulled(operator, state, share * kappa) == pytest.approx(share * top, rel=1e-9)
    assert pulled(operator, state, -kappa) == pytest.approx(-kappa, rel=1e-9)
    held, again = operator.energies(state)
    assert held.sum() == pytest.approx(STIFFNESS * kappa**2 / 2, rel=1e-9)
    assert again.sum() == spent > 0


@shapes
def test_the_slope_is_that_of_the_curve(shape: str) -> None:
    """By central differences of secant times stretch, away from the kink of two lines."""
    pair = cohesive.LAWS[shape].pair
    assert pair is not None
    assert pair.softening is not None
    assert pair.secant is not None
    t, step = np.array([0.05, 0.2, 0.25, 0.6, 0.95]), 1e-9
    kappa = PEAK + t * (LIMIT - PEAK)
    low, high = (pair.secant(None, at, at, PEAK, LIMIT) * at for at in (kappa - step, kappa + step))
    slope = pair.softening.softening_slope(None, kappa, PEAK, LIMIT)
    assert slope == pytest.approx((high - low) / (2 * step), rel=1e-6)


def test_the_largest_horizon_leaves_nothing_to_softening() -> None:
    largest = largest_horizon(CONCRETE, 3.0)
    beside = critical_opening(CONCRETE, 3.0, largest * np.array([0.99, 1.0, 1.01]))
    assert beside[0] > 0 > beside[2]
    assert beside[1] == pytest.approx(0, abs=1e-12 * beside[0])
    # of a continuum with a conical micromodulus; the lattice's sum is 0.7 % off
    assert largest == pytest.approx(5 * np.pi / 9 * 1.3**2 * 30e9 * 100 / 3e6**2, rel=0.01)
    assert first_stretch(CONCRETE) == 3e6 / (1.3 * 30e9)


def shaken(kernel: str, shape: str) -> tuple[list[NDArray[np.float64]], list[tuple[int, ...]]]:
    """A plate some steps after random displacements and velocities: states and energies, and what broke when."""
    glass = msgspec.structs.replace(GLASS, law="cohesive", G0=60.0, f_t=30e6, shape=shape)
    problem = prepare(plate(square_grid(37, 29), 3, material=glass, run=Run(time_step=2e-8)), Options(kernel=kernel))
    system, state = problem
    assert system.operator.name == kernel
    random = np.random.default_rng(3)
    state.value[:] = 5e-7 * random.standard_normal(state.value.shape)
    state.rate[:] = 12 * random.standard_normal(state.value.shape)
    problem.advance(1, 30)
    broken, worst = system.operator.broken(), np.sort(system.operator.checkpoint_arrays()["worst"])
    arrays = [*state[:4], *system.operator.energies(state), worst, system.operator.tangent(state).toarray()]
    return arrays, sorted(zip(*(column.tolist() for column in broken), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [shape if shape == "linear" else pytest.param(shape, marks=SLOW) for shape in AREA])
def test_the_fast_kernel_is_the_list(shape: str) -> None:
    """States, energies, what bonds remember, and the tangent, to round-off; the same bonds break."""
    (fast, gone), (listed, expected) = shaken("blocks", shape), shaken("listed", shape)
    assert gone == expected
    assert len(gone) > 50
    assert len(fast[6]) > 1000
    for one, other in zip(fast, listed, strict=True):
        assert np.abs(one - other).max() <= 1e-12 * np.abs(other).max()  # measured 1e-14


def test_broken_bonds_that_close_push_in_no_kernel() -> None:
    """A plate softened and torn along x, then closed by less than any bond needs care for. Measured: 2e-15 of the
    largest force."""
    glass = msgspec.structs.replace(GLASS, law="cohesive", G0=60.0, f_t=30e6)
    forces = []
    for kernel in ("blocks", "listed"):
        system, state = prepare(plate(square_grid(20, 16), 3, material=glass), Options(kernel=kernel, threads=1))
        for step, strain in ((1, 1e-3), (2, 5e-2), (3, 5e-2), (4, -1e-6)):
            state.value[:], out = (strain, 1e-6) * system.model.grid.position, np.zeros_like(state.value)
            system.operator.accumulate_force(state, out, step, 1e-8)
        assert len(system.operator.broken().step) > 1000
        forces.append(out)
    assert np.abs(forces[1]).max() > 0
    assert np.abs(forces[0] - forces[1]).max() <= 1e-13 * np.abs(forces[1]).max()
