"""Materials behind correspondence: closed forms of one node's response, and what a node remembers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import brentq

from pdsolve.laws.materials import solid as solids
from pdsolve.laws.materials.solid import ALPHA_RATE, J2, LINEAR, NEO_HOOKE, SVK, Response, SolidColumns

NU = 0.3


def node(
    kind: int,
    E: float = 1.0,
    nu: float = NU,
    yields: float = np.inf,
    H: float = 0.0,
    flat: bool = False,
    rate: bool = False,
) -> SolidColumns:
    """One node of a material, in space or in plane strain, or `flat`: in plane stress."""
    numbers = (np.array([value]) for value in (E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu)), yields, H))
    history = np.zeros((1, 16 if rate else 7))
    if rate:
        history[0, [0, 4, 8]] = 1
    return SolidColumns(np.array([kind], np.int8), *numbers, history, flat, rate)


@njit
def _respond(solid: Any, h: Any) -> Any:
    return solids.respond(solid, 0.0, 0, h, 0.0)


@njit
def _keep(solid: Any, h: Any) -> None:
    solids.update_history_of(solid, 0.0, 0, h, 0.0)


def response(solid: SolidColumns, h: NDArray[np.float64]) -> Response:
    return Response(*_respond(solid, tuple(np.asarray(h).ravel().tolist())))


def keep(solid: SolidColumns, h: NDArray[np.float64]) -> None:
    _keep(solid, tuple(np.asarray(h, dtype=float).ravel().tolist()))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stretch", "lateral", "first", "true"),
    [
        (0.8, 1.067338, -0.240005, -0.210677),
        (1.1, 0.971493, 0.093077, 0.098620),
        (1.5, 0.880175, 0.378280, 0.488288),
        (2.0, 0.798078, 0.646745, 1.015413),
    ],
)
def test_neo_hooke_in_uniaxial_stress(stretch: float, lateral: float, first: float, true: float) -> None:
    """E = 1, nu = 0.3: lateral stretch, P and sigma along; in space, and in plane stress, which finds it by itself."""

    def pulled(solid: SolidColumns, out: float) -> Response:
        return response(solid, np.diag([stretch - 1, out - 1, out - 1 if not solid.plane_stress else 0.0]))

    for solid in (node(NEO_HOOKE), node(NEO_HOOKE, flat=True)):
        found = brentq(lambda out, solid=solid: pulled(solid, out).P[4], 0.5, 1.2, xtol=1e-14)
        here = pulled(solid, found)
        assert found == pytest.approx(lateral, abs=1e-6)
        assert (here.P[0], here.sigma[0]) == pytest.approx((first, true), abs=1e-6)
        assert here.F[8] == pytest.approx(found, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("stretch", "first"), [(0.8, -0.333998), (1.1, 0.123414), (1.5, 0.476461), (2.0, 0.776869)])
def test_neo_hooke_in_uniaxial_strain_and_shear(stretch: float, first: float) -> None:
    assert response(node(NEO_HOOKE), np.diag([stretch - 1, 0, 0])).P[0] == pytest.approx(first, abs=1e-6)
    mu, gamma = 1 / 2.6, stretch
    sheared = response(node(NEO_HOOKE), np.array([[0, gamma, 0], [0, 0, 0], [0, 0, 0]]))
    assert sheared.P[:4] == pytest.approx((0, mu * gamma, 0, mu * gamma), abs=1e-14)
    assert (sheared.sigma[0], sheared.sigma[3]) == pytest.approx((mu * gamma**2, mu * gamma), abs=1e-14)


@pytest.mark.slow
def test_j2() -> None:
    """E = 200 GPa, nu = 0.3, sigma_y = 250 MPa, strain or shear angle 0.01; MPa."""
    steel = {"E": 200e3, "yields": 250.0}
    strained = response(node(J2, **steel), np.diag([0.01, 0, 0])).sigma
    assert strained[:2] == pytest.approx((1833.333, 1583.333), abs=1e-3)
    assert response(node(J2, **steel), np.diag([250 / 200e3 * 1.3 - 1e-9, 0, 0])).more == 0  # yields at sigma_y / 2 G
    assert response(node(J2, **steel), np.diag([250 / 200e3 * 1.3 + 1e-9, 0, 0])).more > 0
    sheared = response(node(J2, **steel, H=1e3), np.array([[0, 0.01, 0], [0, 0, 0], [0, 0, 0]])).sigma
    assert sheared[3] == pytest.approx(147.0338, abs=1e-4)
    flat = node(J2, **steel, H=1e3, flat=True)
    out = brentq(lambda y: response(flat, np.diag([0.01, y, 0])).sigma[1], -0.01, 0, xtol=1e-16)
    pulled = response(flat, np.diag([0.01, out, 0]))
    assert pulled.sigma[0] == pytest.approx(258.7065, abs=1e-4)
    assert pulled.more * np.sqrt(2 / 3) == pytest.approx(0.008706, abs=1e-6)
    assert abs(pulled.sigma[2]) <= 1e-9


@pytest.mark.slow
def test_j2_remembers() -> None:
    """Pulled beyond yield and back: what is left is what Hooke takes from the stress; nothing flows twice."""
    steel = node(J2, 200e3, yields=250.0, H=1e3)
    keep(steel, np.diag([0.01, 0, 0]))
    alpha = steel.history[0, 6]
    assert alpha > 0
    loaded = response(steel, np.diag([0.01, 0, 0]))
    assert loaded.more == pytest.approx(0, abs=1e-16)
    lame, mu = steel.first[0], steel.shear[0]
    back = response(steel, np.diag([0.0099, 0, 0])).sigma[0] - loaded.sigma[0]
    assert back == pytest.approx(-1e-4 * (lame + 2 * mu), rel=1e-9)


def turned(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c - 1, -s, 0], [s, c - 1, 0], [0, 0, 0]])


def test_rates_are_objective() -> None:
    """lambda = mu = 1. A turn of 90 degrees makes no stress, and turns the one that is there, in steps of any size; a
    stretch of 1.5 makes 3 ln 1.5; a shear of 4 makes sin 4 (Jaumann's rate)."""
    for steps in (10, 100):
        plain, pulled = node(LINEAR, 2.5, 0.25, rate=True), node(LINEAR, 2.5, 0.25, rate=True)
        pulled.history[0, 9] = 1
        for step in range(1, steps + 1):
            keep(plain, turned(np.pi / 2 * step / steps))
            keep(pulled, turned(np.pi / 2 * step / steps))
        assert np.abs(plain.history[0, 9:15]).max() <= 1e-15  # measured 4e-17
        assert pulled.history[0, 9:15] == pytest.approx([0, 1, 0, 0, 0, 0], abs=1e-13)  # measured 5e-16
    stretched, sheared = node(LINEAR, 2.5, 0.25, rate=True), node(LINEAR, 2.5, 0.25, rate=True)
    for step in range(1, 1001):
        keep(stretched, np.diag([0.5 * step / 1000, 0, 0]))
        keep(sheared, np.array([[0, 4 * step / 1000, 0], [0, 0, 0], [0, 0, 0]]))
    assert stretched.history[0, 9] == pytest.approx(1.216395, abs=1e-6)
    assert sheared.history[0, 12] == pytest.approx(np.sin(4.0), abs=5e-6)  # measured 1e-6


def test_steps_of_a_rate_are_of_second_order() -> None:
    """Simple shear of 2, sin 2 = 0.9093 of the shear modulus: 0.9100 in 20 steps; turned on one side only, 0.9797."""
    errors = []
    for steps in (20, 40):
        sheared = node(LINEAR, 2.5, 0.25, rate=True)
        for step in range(1, steps + 1):
            keep(sheared, np.array([[0, 2 * step / steps, 0], [0, 0, 0], [0, 0, 0]]))
        errors.append(sheared.history[0, 12] - np.sin(2.0))
    assert errors[0] == pytest.approx(7.4e-4, rel=0.02)  # measured
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)  # measured


def test_a_rate_that_flows_is_j2_where_strains_are_small() -> None:
    """In space and in plane stress: as the total form, less what strains of 1e-5 make of it."""
    for flat in (False, True):
        steel = {"E": 200e3, "yields": 0.5, "H": 1e3, "flat": flat}
        total, rate = node(J2, **steel), node(J2, **steel, rate=True)
        h = 1e-5 * np.array([[1.0, 0.4, 0], [-0.2, 0.3, 0], [0, 0, 0]])
        for step in range(1, 51):
            keep(rate, h * step / 50)
            keep(total, h * step / 50)
        expected = np.array(response(total, h).sigma)
        assert rate.history[0, 9:15] == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())
        assert rate.history[0, ALPHA_RATE] == pytest.approx(total.history[0, 6], rel=1e-3)


@pytest.mark.parametrize("kind", [LINEAR, SVK, NEO_HOOKE])
@pytest.mark.parametrize("flat", [False, True])
def test_small_strains_are_hookes(kind: int, flat: bool) -> None:
    h, nu = 1e-8 * np.array([[1.0, 0.4, 0], [-0.2, 0.3, 0], [0, 0, 0]]), NU
    factor = 1 / (1 - nu**2) if flat else (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    side = nu if flat else nu / (1 - nu)
    expected = 1e-8 * np.array([factor * (1 + side * 0.3), factor * (0.3 + side), 0.1 / (1 + nu)])
    found = response(node(kind, flat=flat), h)
    assert [found.sigma[0], found.sigma[1], found.sigma[3]] == pytest.approx(expected, rel=1e-7)
    assert (found.sigma[2] == pytest.approx(0, abs=1e-20)) == flat
