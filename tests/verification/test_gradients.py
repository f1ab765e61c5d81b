"""Gradients of higher order on a bent and turned square, and a rubber block stretched between clamps."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import by_row_sum

from pdmesh.model.document import Displacement, Run, Static
from pdsolve.laws.higher_order_correspondence import fit
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.rest.equilibrium import EquilibriumConditions
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.rest.relaxation import DynamicRelaxation
from pdsolve.run.prepare import prepare

TURN = np.radians(30)
EXACT = np.diag([-0.375, 0.0])  # Green's strain at the corner
FITTED = [  # rotation, degrees, and relative error of the strain by order, with the constant term; independent
    (1.3521, 0.9360),
    (35.4787, 0.5669),
    (31.3460, 0.06949),
    (29.8302, 0.009791),
    (29.9906, 6.398e-4),
    (30.0008, 4.483e-5),
    (30.0000, 1.803e-6),
]
BONDS = [  # the same through the corner itself
    (9.1890, 0.5079),
    (35.0764, 0.3030),
    (30.6439, 0.05821),
    (29.8463, 0.007278),
    (29.9947, 5.715e-4),
    (30.0008, 3.744e-5),
    (30.0000, 1.688e-6),
]


def bent(X: np.ndarray, Y: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """x = R(30 degrees) ((1/2 + Y) sin X, (1/2 + Y) cos X - 1/2)."""
    c, s = np.cos(TURN), np.sin(TURN)
    x, y = (0.5 + Y) * np.sin(X), (0.5 + Y) * np.cos(X) - 0.5
    return np.column_stack([c * x - s * y, s * x + c * y])


@pytest.mark.parametrize(("constant", "expected"), [(True, FITTED), (False, BONDS)])
def test_bending_and_turning_by_order(constant: bool, expected: list[tuple[float, float]]) -> None:
    """21 x 21 points of the unit square with unit weights, the gradient at the corner (0, 0), orders 1 to 7."""
    Y, X = (each.ravel()[1:] / 20 for each in np.mgrid[0:21, 0:21])
    eta = bent(X, Y) - bent(np.zeros(1), np.zeros(1)) - np.column_stack([X, Y])
    xi, root = np.column_stack([X, Y]), np.ones(len(X))
    for order, (degrees, error) in enumerate(expected, 1):
        Q, t, carried = fit(xi, root, order, 1.0 if constant else 0.0, 1.0)
        assert carried == order
        F = np.eye(2) + (Q[: len(xi)].T @ eta).T @ t
        turned = np.degrees(np.arctan2(F[1, 0] - F[0, 1], F[0, 0] + F[1, 1]))
        strain = (F.T @ F - np.eye(2)) / 2
        assert turned == pytest.approx(degrees, abs=1e-3)
        assert np.linalg.norm(strain - EXACT) / 0.375 == pytest.approx(error, rel=0.01)


def clamped(columns: int) -> Model:
    """A unit block of neo-Hooke, nu = 0.3, plane strain, pulled by a half between clamps that are its end columns."""
    delta = 1 / columns
    grid = square_grid(columns + 1, columns, delta, y0=delta / 2)
    grid = dataclasses.replace(grid, areas=np.full(len(grid), delta**2))
    solid = {"model": "correspondence", "solid": "neo hooke", "failure": "none", "nu": 0.3, "plane": "strain"}
    rubber = msgspec.structs.replace(GLASS, E=1.0, rho=1.0, **solid)
    ends = (
        Displacement(box=(-0.1 * delta, -1.0, 0.1 * delta, 2.0), x=0.0, y=0.0),
        Displacement(box=(1 - 0.1 * delta, -1.0, 2.0, 2.0), x=0.5, y=0.0, profile=((0.0, 0.0), (1.0, 1.0))),
    )
    run = Run(solver="static", steps=5, static=Static(load_steps=5))
    return plate(grid, 3, material=rubber, conditions=ends, run=run)


def reaction(columns: int) -> float:
    """What holds it, at rest."""
    system, state = prepare(clamped(columns), Options(threads=1))
    system.stepper.advance(state, 1, system.model.settings.run.steps + 1)
    out = np.zeros_like(state.value)
    system.operator.accumulate_force(state, out, 0, 0.0)
    return float(-out[system.model.grid.position[:, 0] > 1 - 0.1 / columns, 0].sum() / columns**2)


@pytest.mark.slow
def test_a_rubber_block_between_clamps() -> None:
    """Independent: 0.43931."""
    assert reaction(20) == pytest.approx(0.43931, rel=3e-3)  # measured 0.43931


@pytest.mark.slow
def test_a_rubber_block_approaches_finite_elements() -> None:
    """First order; extrapolated it is that of finite elements, 0.42257, within 0.3 per cent."""
    coarse, fine = reaction(20), reaction(40)
    assert fine == pytest.approx(0.43071, rel=3e-3)  # measured 0.43071
    assert 2 * fine - coarse == pytest.approx(0.42257, rel=3e-3)  # measured 0.42211


@pytest.mark.parametrize(
    ("columns", "known"),
    [(20, (27, 67, 109, 154)), (40, (43, 82, 124, 252))],
)
@pytest.mark.slow
def test_relaxation_of_a_rubber_block(columns: int, known: tuple[int, ...]) -> None:
    """Iterations to 1e-2, 1e-4, 1e-6, 1e-8 from a uniform stretch on, with 1.1 of the row sums of the first tangent: no
    more than an independent program's. That takes its damping from all of the displacement, this from what has moved
    since, and is sooner at rest; where Newton's method is."""
    system, state = prepare(clamped(columns), Options(threads=1))
    mass = 1.1 * by_row_sum(system.operator.tangent(state)).reshape(-1, 2)
    stepper = system.stepper
    assert isinstance(stepper, LoadSteps)
    x = system.model.grid.position[:, 0]
    at = np.column_stack([np.where(x > 1 - 0.1 / columns, 0.5, 0.0), 0 * x])
    asked, found = EquilibriumConditions(np.zeros_like(at), stepper.held, at), []
    for tolerance in (1e-2, 1e-4, 1e-6, 1e-8):
        state.value[:] = np.column_stack([x / 2, 0 * x])
        found.append(
            DynamicRelaxation(system.operator, tolerance, mass=mass)
            .solve_equilibrium(state, asked, lambda *_: None)
            .iterations
        )
    assert (np.array(found) <= 1.25 * np.array(known)).all()  # measured 26, 50, 73, 95
    assert found[0] == pytest.approx(known[0], rel=0.25)
    relaxed = state.value.copy()
    state.value[:] = 0
    system.stepper.advance(state, 1, system.model.settings.run.steps + 1)
    assert np.linalg.norm(relaxed - state.value) <= 1e-6 * np.linalg.norm(state.value)
