"""The protocol admits more than bonds: springs to the ground, two operators on one cloud, contents that leak."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from node_clouds import idle
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from scipy.sparse import csr_array, diags_array

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import InitialVelocity
from pdsolve.conditions import drive_of, entries
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.operators.together import Together
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import count_fragments
from pdsolve.run.subdomain import team_of
from pdsolve.run.system import PreparedRun
from pdsolve.state import Broken, State, Unknown
from pdsolve.steppers.euler import ForwardEuler
from pdsolve.steppers.theta import ThetaSteps
from pdsolve.steppers.verlet import Verlet

NOTHING = np.zeros(0, dtype=np.int64)


class Grounded:
    """Every node hangs on a spring of its own; it holds k |u|^2 / 2 and never breaks."""

    name = "grounded"
    symmetric = True

    def __init__(self, stiffness: NDArray[np.float64], width: int) -> None:
        """`stiffness` (n,) N/m^4, in `width` components."""
        self.unknowns: tuple[Unknown, ...] = (Unknown("u", width, 2),)
        self._stiffness = stiffness[:, None]

    def to_own_layout(self, state: State) -> State:
        return state

    def accumulate_force(self, state: State, out: NDArray[np.float64], step: int, dt: float) -> None:
        out -= self._stiffness * state.value

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        held = (self._stiffness * state.value**2).sum(axis=1) / 2
        return held, np.zeros_like(held)

    def stiffness_bound(self) -> NDArray[np.float64]:
        return self._stiffness[:, 0] / 2  # omega^2 = k / rho, and a step is stable up to 2 / omega

    def tangent(self, state: State) -> csr_array:
        return diags_array(np.repeat(self._stiffness[:, 0], state.value.shape[1])).tocsr()

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        return {}

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return NOTHING, NOTHING

    def broken(self, after_step: int = 0) -> Broken:
        return Broken(NOTHING, NOTHING, NOTHING)

    def checkpoint_arrays(self) -> CheckpointArrays:
        return {}

    def restore(self, kept: CheckpointArrays, broken: Broken) -> None:
        assert not len(broken.step)

    def bytes(self) -> int:
        return self._stiffness.nbytes


class Leaking(Grounded):
    """A content that leaves each node by itself: its rate is -k c, of which it is the tangent and the bound, too."""

    name = "leaking"

    def __init__(self, pace: NDArray[np.float64]) -> None:
        """`pace` k (n,) 1/s."""
        super().__init__(pace, 1)
        self.unknowns = (Unknown("c", 1, 1),)
        self.volume = np.ones(len(pace))

    def potential(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        return value

    def follows(self, value: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.ones(len(value), dtype=np.bool_)

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        out -= self._stiffness[:, 0] * potential


PACE, SUPPLIED, DT, STEPS = np.array([0.5, 1.0, 2.0, 4.0]), 3.0, 0.1, 25


@pytest.mark.parametrize("theta", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("factored", [True, False])
def test_what_leaks_from_nodes_dies_out_as_its_stepper_has_it(theta: float, factored: bool) -> None:
    """By the stepper's own factor of each step towards what is supplied over the pace; a node is held, by a profile.

    Explicit, implicit and between, by factors and by conjugate gradients; measured 3e-15.
    """
    source, held = entries(np.array([1, 2]), 0, SUPPLIED, 0), entries(np.array([0]), 0, 2.0, 1)
    drive = drive_of([(), ((0.0, 0.0), (DT * STEPS, 1.0))], [source], [held], (4, 1))
    operator = Leaking(PACE)
    euler = ForwardEuler(operator, drive, DT)
    stepper = ThetaSteps(operator, drive, DT, theta, factored) if theta else euler
    state = State(np.ones((4, 1)), np.zeros((4, 1)), np.zeros((4, 0)), *np.zeros((3, 4)))
    state.value[0] = 0.0
    stepper.advance(state, 1, STEPS + 1)
    factor = (1 - (1 - theta) * DT * PACE) / (1 + theta * DT * PACE)
    rest = np.array([0.0, SUPPLIED, SUPPLIED, 0.0]) / PACE
    expected = rest + (1 - rest) * factor**STEPS
    assert state.value[1:, 0] == pytest.approx(expected[1:], rel=1e-12)
    assert state.value[0, 0] == pytest.approx(2.0, rel=1e-12)
    assert state.work == pytest.approx([0.0, SUPPLIED * DT * STEPS, SUPPLIED * DT * STEPS, 0.0], rel=1e-12)
    weights = np.arange(STEPS) + theta  # of the ramp that node 0 holds, from where it leaks
    assert state.dissipated == pytest.approx([-PACE[0] * DT * 2.0 * weights.sum() / STEPS, 0, 0, 0], rel=1e-12)


def seen(march: Callable[[int, int], None], value: Callable[[], float], steps: int) -> float:
    """omega dt of what swings as a cosine, by cos((n + 1) w) + cos((n - 1) w) = 2 cos(w) cos(n w)."""
    found = [value()]
    for step in range(1, steps + 1):
        march(step, step + 1)
        found.append(value())
    c = np.array(found)
    return float(np.arccos((c[2:] + c[:-2]) @ c[1:-1] / (2 * c[1:-1] @ c[1:-1])))


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_on_springs_swing_as_verlet_has_it(dimension: int) -> None:
    """sin(omega dt / 2) is the oscillator's own half angle: each node at its own pace, in the plane and in space."""
    stiffness, rho, dt = np.array([1e12, 4e12, 9e12]), np.full(3, 1e3), 2e-5
    operator = Grounded(stiffness, dimension)
    state = State(*np.zeros((3, 3, dimension)), *np.zeros((3, 3)))
    state.value[:] = 1e-3
    state.second[:] = -(stiffness / rho)[:, None] * state.value
    verlet = Verlet(operator, idle(3, dimension), rho, dt)
    for node in range(3):
        state.value[:], state.rate[:], state.second[:] = 1e-3, 0, -(stiffness / rho)[:, None] * 1e-3
        found = seen(
            lambda first, last: verlet.advance(state, first, last), lambda i=node: float(state.value[i, 0]), 200
        )
        expected = 2 * np.arcsin(np.sqrt(stiffness[node] / 1e3) * dt / 2)
        assert found == pytest.approx(expected, rel=1e-12)  # measured 4e-16


def on_the_ground(kernel: str, share: float) -> PreparedRun:
    """A glass plate that flies off its ground at 1 m/s, the ground `share` times as stiff as its bonds."""
    start = InitialVelocity(box=(-1.0, -1.0, 1.0, 1.0), x=1.0)
    system, state = prepare(plate(square_grid(12, 9), conditions=(start,)), Options(kernel=kernel, threads=1))
    ground = Grounded(share * system.operator.stiffness_bound(), 2)
    both = Together(system.operator, ground)
    dt = 0.5 * float(np.sqrt(2 * GLASS.rho / both.stiffness_bound().max()))
    stepper = Verlet(both, system.drive, system.model.rho, dt)
    return PreparedRun(
        dataclasses.replace(system, operator=both, stepper=stepper, time_step=dt), both.to_own_layout(state)
    )


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["listed", "blocks"])
def test_a_plate_on_the_ground_swings_as_one(kernel: str) -> None:
    """Bonds are not stretched where all of it moves alike: the frequency is the ground's, to round-off."""
    system, state = prepare(plate(square_grid(12, 9)), Options(kernel=kernel, threads=1))
    pull = 1e-3 * float(system.operator.stiffness_bound().max())
    both = Together(system.operator, Grounded(np.full(len(system.area), pull), 2))
    dt = 0.5 * system.stable_time_step
    verlet = Verlet(both, system.drive, system.model.rho, dt)
    state.value[:] = 1e-6
    state.second[:] = -pull / GLASS.rho * state.value
    found = seen(lambda first, last: verlet.advance(state, first, last), lambda: float(state.value[50, 1]), 300)
    assert found == pytest.approx(2 * np.arcsin(np.sqrt(pull / GLASS.rho) * dt / 2), rel=1e-10)  # measured 4e-13


@pytest.mark.parametrize("kernel", ["listed", "blocks"])
def test_measures_take_two_operators_for_one(kernel: str) -> None:
    """Energy is kept by both together; tangent, bound and bonds are those of the sum."""
    prepared = on_the_ground(kernel, 0.3)
    system, state = prepared
    start = compute_energy_balance_row(system, state, 0)
    prepared.advance(1, 401)
    end = compute_energy_balance_row(system, state, 400)
    assert end.kinetic < 0.9 * start.kinetic  # measured 0.67
    assert end.kinetic + end.strain + end.dissipated == pytest.approx(
        start.kinetic, rel=0.02
    )  # measured 1e-2, Verlet's own
    assert (compute_node_damage(system).max(), count_fragments(team_of(*prepared))) == (0, 1)
    K = system.operator.tangent(state._replace(value=np.zeros_like(state.value))).toarray()
    largest = float(np.abs(np.linalg.eigvals(K)).max())
    assert 1 < largest / system.operator.stiffness_bound().max() <= 2  # measured 1.55
