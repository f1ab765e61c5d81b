"""Solids that flow: what balances, what is derived from what, and what a node's control yields by."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from node_clouds import GLASS, cubic_grid
from numba import njit
from numpy.typing import NDArray
from plates import plate, square_grid

from pdsolve.bonds.assembly import listed
from pdsolve.laws import law_of
from pdsolve.laws.materials import j2
from pdsolve.laws.materials.tensors import contracted
from pdsolve.operators.bond_list import BondList
from pdsolve.schemes import SCHEMES
from pdsolve.state import State, zero_state

STEEL = msgspec.structs.replace(
    GLASS, E=200e9, nu=0.3, plane="strain", model="correspondence", solid="j2", failure="none", yield_stress=250e6
)


@njit
def _returned(trial: Any, alpha: float, H: float, b: float, ease: float) -> Any:
    return j2.returned(trial, alpha, 80.0, 0.25, H, b, ease)


@njit
def _thinned(trial: Any, H: float, b: float) -> float:
    return j2.thinned(trial, 0.01, 120.0, 80.0, 0.25, H, b, 4.0)


@pytest.mark.parametrize("H", [0.0, 2.0])
@pytest.mark.parametrize("b", [0.0, 0.02, 3.0])
def test_stress_and_deviations_return_together(H: float, b: float) -> None:
    """Onto the yield surface, along its normal, in GPa; x is that of the flow, at small and at large steps."""
    for size in (1.0, 100.0):
        trial = tuple(size * np.array([0.5, -0.1, 0.2, 0.3, 0.1, -0.2]))
        sigma, more, x = _returned(trial, 0.01, H, size * b, 4.0)
        s, s_trial = (np.array(each) - np.array([1, 1, 1, 0, 0, 0]) * sum(each[:3]) / 3 for each in (sigma, trial))
        assert sum(sigma[:3]) == pytest.approx(sum(trial[:3]), rel=1e-14)
        assert s == pytest.approx(s_trial / (1 + x), rel=1e-12)
        squared = contracted(s, s) + 4 * size * b / (1 + 4 * x) ** 2
        assert squared == pytest.approx(2 / 3 * (0.25 + H * (0.01 + np.sqrt(2 / 3) * more)) ** 2, rel=1e-11)
        assert x == pytest.approx(2 * 80 * more / np.sqrt(squared), rel=1e-12)


@pytest.mark.parametrize("b", [0.0, 0.02, 3.0])
def test_a_plate_that_flows_has_no_stress_out_of_its_plane(b: float) -> None:
    trial = np.array([0.9, -0.3, 0.4, 0.3, 0.0, 0.0])
    zz = _thinned(tuple(trial), 2.0, b)
    trial[:3] += 120 * zz
    trial[2] += 160 * zz
    assert abs(_returned(tuple(trial), 0.01, 2.0, b, 4.0)[0][2]) <= 1e-12


class Body(NamedTuple):
    """A square of 36 nodes, or a cube of 64, that has flowed and is deformed further."""

    operator: BondList
    position: NDArray[np.float64]  # (n, d) m
    cell: NDArray[np.float64]  # (n,) m^d
    value: NDArray[np.float64]  # (n, d) m

    def forces(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces (n, d), N."""
        out = np.zeros_like(value)
        self.operator.accumulate_force(_state(value), out, 0, 0.0)
        return out * self.cell[:, None]

    def energy(self, value: NDArray[np.float64]) -> float:
        """Stored and dissipated energy, J."""
        return float(sum(self.cell @ each for each in self.operator.energies(_state(value))))


def _state(value: NDArray[np.float64]) -> State:
    return zero_state(*value.shape)._replace(value=value)


def flowing(plane: str, **settings: str) -> Body:
    """A body of steel. Gradients of 0.4 % and noise make its nodes and its deviations flow."""
    material = msgspec.structs.replace(STEEL, plane=plane, hardening=1e9, **settings)
    grid, extent = square_grid(6, 6), 2
    if plane == "space":
        grid, extent = cubic_grid(4), 3
    model = plate(grid, 3, material=material)
    assembled = listed(SCHEMES["conservative"].fill(model).parts(), model.grid.cells)
    operator = BondList(law_of(model), model, assembled.bonds, True)
    x, random = grid.position, np.random.default_rng(3)
    way = np.array([[1.0, 0.3, 0.1], [-0.2, -0.5, 0.2], [0.0, 0.3, -0.4]])[:extent, :extent]
    first, second = (4e-3 * x @ way.T + 2e-6 * random.standard_normal(x.shape) for _ in range(2))
    operator.update_history(_state(first))
    assert np.abs(operator.columns.slip).max() > 1e-7
    return Body(operator, x, assembled.area, first + second)


BODIES = [("strain", "silling"), ("strain", "wan"), ("stress", "silling"), ("stress", "wan"), ("space", "silling")]


@pytest.mark.slow
@pytest.mark.parametrize(("plane", "control"), BODIES)
def test_forces_are_the_slope_of_stored_and_dissipated_energy(plane: str, control: str) -> None:
    """Flow is associated, of control and stress together; and the tangent is the slope of the forces, symmetric."""
    body = flowing(plane, control=control)
    way = np.random.default_rng(5).standard_normal(body.value.shape)
    step, force = 1e-11, body.forces(body.value)
    slope = (body.energy(body.value + step * way) - body.energy(body.value - step * way)) / (2 * step)
    assert -(force * way).sum() == pytest.approx(slope, rel=1e-6)
    tangent = body.operator.tangent(_state(body.value)) * np.repeat(body.cell, len(way[0]))[:, None]
    assert abs(tangent - tangent.T).max() <= 1e-9 * abs(tangent).max()
    more = (body.forces(body.value + step * way) - body.forces(body.value - step * way)) / (2 * step)
    assert tangent @ way.ravel() == pytest.approx(-more.ravel(), abs=1e-5 * np.abs(more).max())


@pytest.mark.slow
@pytest.mark.parametrize("form", ["total", "rate"])
@pytest.mark.parametrize(("plane", "control"), BODIES)
def test_momentum_is_conserved(plane: str, control: str, form: str) -> None:
    """No net force, and no net torque: about places of the start for small strains, about those of now for rates."""
    body = flowing(plane, control=control, form=form)
    force, place = body.forces(body.value), body.position + (body.value if form == "rate" else 0)
    size = np.abs(force).sum()
    torque = np.einsum("na,nb->ab", place - place.mean(axis=0), force)
    assert np.abs(force.sum(axis=0)).max() <= 1e-12 * size
    assert np.abs(torque - torque.T).max() <= 1e-11 * size * np.ptp(place)


@pytest.mark.slow
def test_a_turned_body_has_turned_forces() -> None:
    """In the form of rates, what has flowed turns with its node."""
    for control in ("silling", "wan"):
        body, turn = flowing("strain", control=control, form="rate"), np.array([[0.6, -0.8], [0.8, 0.6]])
        body.operator.update_history(_state(body.value))  # as a step that turns and stretches is not exact
        force = body.forces(body.value)
        turned = (body.position + body.value) @ turn.T - body.position
        assert body.forces(turned) == pytest.approx(force @ turn.T, abs=1e-9 * np.abs(force).max())


@pytest.mark.slow
def test_what_has_flowed_stays_without_a_gradient_where_bonds_break() -> None:
    """Plastic deviations are those that no gradient makes, of the bonds that are left."""
    body = flowing("strain", control="silling")
    law, bonds = body.operator.columns, body.operator._list
    law.broken[np.flatnonzero(bonds.neighbour % 5 == 0)] = 1
    body.operator.law.update_after_breakage(law, bonds, np.arange(36))
    own = np.repeat(np.arange(36), np.diff(bonds.start))
    w = np.where(law.broken == 0, law.weight, 0.0)
    sums = np.array([np.bincount(own, w * p * x, minlength=36) for p in law.slips for x in bonds.xi])
    size = np.bincount(own, w * np.abs(law.slip).max() * bonds.length, minlength=36)
    stands = law.inverse.any(axis=1)
    assert stands.sum() > 10
    assert (np.abs(sums) <= 1e-12 * size)[:, stands].all()
    assert np.abs(law.slip).max() > 1e-7
