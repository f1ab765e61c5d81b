"""A crack that a plane wave runs into: its stress intensity grows with the root of time until waves come back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Run
from pdmesh.model.material_constants import BONDS_NU, pressure_speed
from pdsolve.fracture.domain_integrals import Ring
from pdsolve.measures.stress_intensities import TipIntensityHistory, follow_tip_intensities
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

PUSH, RAMP, STEP = 1e-6, 6.0, 0.4  # Pa; spacings that a wave goes while it rises; s
SOLID = Material(E=1.0, rho=1.0, G0=1e9, plane="strain")


def hit(reach: int, ratio: float) -> Model:
    """A square of 1 m spacings, eight times `reach` wide and more; its crack is half-way through. Waves of PUSH start
    at the top and the bottom, and meet at the crack; the sides slide, so that waves stay plane."""
    side = 10 * reach
    half = side / 2
    grid = square_grid(side, side, 1.0, (1 - side) / 2, (1 - side) / 2)
    corners = half * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    grid = dataclasses.replace(grid, cracks=np.array([[-float(side), 0, 0, 0]]), outline=(corners,))
    rise = ((0.0, 0.0), (RAMP / pressure_speed(SOLID), 1.0))
    conditions = (
        Load(box=(-half, half - 0.6, half, half), body_force=(0.0, PUSH), profile=rise),
        Load(box=(-half, -half, half, 0.6 - half), body_force=(0.0, -PUSH), profile=rise),
        Displacement(box=(-half, -half, 0.6 - half, half), x=0.0),
        Displacement(box=(half - 0.6, -half, half, half), x=0.0),
    )
    steps = int((half + 8 * reach) / pressure_speed(SOLID) / STEP)
    run = Run(time_step=STEP, steps=steps, every=int(reach / pressure_speed(SOLID) / STEP))
    return plate(grid, ratio, material=SOLID, conditions=conditions, run=run)


def expected(since: np.ndarray) -> np.ndarray:
    """K1 at times (s) since the waves met, of a stress of 2 PUSH that rises over RAMP.

    A step: K1 = 2 s sqrt(c t (1 - 2 nu) / pi) / (1 - nu) (L. B. Freund, Dynamic Fracture Mechanics, 1990, section
    2.5). It is 2 s F sqrt(2 t / pi) with F^2 = 2 a (b^2 - a^2) / b^4, a and b the slownesses of P and S waves, as the
    Wiener-Hopf technique gives it; b^2 / a^2 = 2 (1 - nu) / (1 - 2 nu). A ramp is the mean of steps.
    """
    nu, c = BONDS_NU["strain"], pressure_speed(SOLID)
    steps = [np.maximum(since - late, 0.0) ** 1.5 * 2 / 3 for late in (0.0, RAMP / c)]
    return 2 * 2 * PUSH * np.sqrt(c * (1 - 2 * nu) / np.pi) / (1 - nu) * (steps[0] - steps[1]) * c / RAMP


def felt(reach: int, ratio: float) -> tuple[TipIntensityHistory, np.ndarray, np.ndarray]:
    """What the tip feels, times since the waves met over those that one takes through the ring, K1 expected."""
    c = pressure_speed(SOLID)
    with simulate(hit(reach, ratio), None, Options(threads=1)) as results:
        steps = results.frames()[0]
        since = steps * STEP - (5 * reach - 0.5) / c
        used = since > 2 * reach / c
        (found,) = follow_tip_intensities(results, steps[used].tolist(), ring=Ring(2 * ratio, reach))
    return found, since[used] * c / reach, expected(since[used])


def test_the_wiener_hopf_factor_is_freunds() -> None:
    """Of the two forms that `expected` speaks of."""
    for nu in (0.1, 0.25, 0.4):
        b2 = 2 * (1 - nu) / (1 - 2 * nu)  # a = 1 = c
        F = np.sqrt(2 * (b2 - 1)) / b2
        assert F * np.sqrt(2 / np.pi) == pytest.approx(np.sqrt((1 - 2 * nu) / np.pi) / (1 - nu), rel=1e-12)


@pytest.mark.slow
def test_a_suddenly_loaded_crack() -> None:
    """From two to eight transits of the ring, four horizons wide: within 5 % of Freund's."""
    found, transits, exact = felt(12, 3.0)
    assert len(transits) >= 6
    assert 2 <= transits[0] < 3
    assert transits[-1] > 7.5
    assert found.value["K1"] / exact == pytest.approx(1.0, abs=0.05)  # measured 0.982 to 0.984
    assert np.ptp(found.value["K1"] / exact) < 0.005  # measured 0.002; without what inertia adds 0.023
    modulus = SOLID.E / (1 - BONDS_NU["strain"] ** 2)
    assert np.sqrt(found.value["J"] * modulus) / exact == pytest.approx(1.0, abs=0.05)  # 0.983 to 0.986
    assert np.abs(found.value["K2"] / exact).max() < 1e-8


@pytest.mark.slow
def test_a_suddenly_loaded_crack_with_a_wide_ring() -> None:
    found, transits, exact = felt(32, 4.0)
    assert transits[-1] > 7
    assert found.value["K1"] / exact == pytest.approx(1.0, abs=0.02)  # measured 0.991 to 0.998
