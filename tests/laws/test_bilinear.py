"""The bilinear law: its shape, what it spends, and that nothing heals."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from plates import GLASS

from pdmesh.model.document import Material
from pdmesh.model.lattice_calibration import lattice_ratios, offsets
from pdmesh.model.material_constants import critical_stretch, micromodulus
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.laws.pair_laws.bilinear import dissipated_share, intact_share

MARAGING = Material(E=191e9, rho=8000.0, G0=1e4, law="bilinear", kr=1.638, keep_G0=False)


def sizes(critical: NDArray[np.float64]) -> Sizes:
    """Bonds (b,) of these critical stretches, whose lengths and horizons the law does not ask for."""
    return Sizes(critical, np.ones(len(critical)), np.ones(len(critical)), 3.0)


def law(kr: float, keep: bool = True) -> tuple[float, float]:
    """Peak and limit where the critical stretch is 1e-3."""
    material = msgspec.structs.replace(GLASS, law="bilinear", kr=kr, keep_G0=keep)
    peak, limit = limits(material, sizes(np.array([1e-3])))
    return float(peak[0]), float(limit[0])


@pytest.mark.parametrize(("delta", "peak", "limit"), [(1e-3, 0.00337, 0.00552), (2e-3, 0.00238, 0.00390)])
def test_the_thesis_table_6(delta: float, peak: float, limit: float) -> None:
    """Kalthoff and Winkler's plate, m = 3, conical: all printed digits."""
    found = limits(MARAGING, sizes(critical_stretch(MARAGING, np.array([3 * delta]))))
    assert f"{found.peak[0]:.5f} {found.limit[0]:.5f}" == f"{peak:.5f} {limit:.5f}"


@pytest.mark.parametrize("kr", [1.0, 1.638, 4.154])
def test_the_limits_of_both_recipes(kr: float) -> None:
    kept, thesis = law(kr), law(kr, keep=False)
    assert kept[0] * kept[1] == pytest.approx(1e-6, rel=1e-14)  # s_p s_0 = s_c^2: the brittle law's energy
    assert thesis == pytest.approx((1e-3 / kr, 1e-3), rel=1e-14)
    assert kept[1] / kept[0] == pytest.approx(kr, rel=1e-14)


def test_kr_1_is_the_brittle_law() -> None:
    assert law(1.0) == law(1.0, keep=False) == (1e-3, 1e-3)


@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("profile", ["constant", "conical"])
def test_a_crack_spends_g0_or_g0_over_kr(keep: bool, profile: str) -> None:
    """The bonds of a full lattice that cross a row: their c xi s_p s_0 / 2 add up to the lattice's share of G0."""
    material = msgspec.structs.replace(MARAGING, keep_G0=keep, micromodulus=profile)
    m, delta = 3, 1e-3
    xi = offsets(m)
    length, horizon = delta * np.hypot(*xi.T), np.full(len(xi), m * delta)
    c = micromodulus(material, length, horizon)
    peak, limit = limits(material, sizes(critical_stretch(material, horizon)))
    # a bond that rises by y spacings crosses the crack from y rows: delta y a unit of area
    spent = float(np.sum(c * length * peak * limit / 2 * delta**2 * delta * np.maximum(xi[:, 1], 0)))
    row = lattice_ratios(m, profile, "stress", False).row
    expected = material.G0 * row / (1 if keep else material.kr)
    assert spent == pytest.approx(expected, rel=1e-12)  # measured 4e-16


LAWS = st.tuples(st.floats(1e-5, 1e-1), st.floats(1.001, 100.0)).map(lambda pair: (pair[0], pair[0] * pair[1]))
SHARES = st.floats(0.0, 1.0)


@given(LAWS, SHARES, SHARES)
def test_softening_goes_one_way(law: tuple[float, float], a: float, b: float) -> None:
    """Between peak and limit the share that is left is in 0 to 1 and falls, what is spent rises from 0 to 1."""
    peak, limit = law
    less, more = (peak + share * (limit - peak) for share in sorted((a, b)))
    kept, spent = (
        [intact_share(w, peak, limit) for w in (less, more)],
        [dissipated_share(w, peak, limit) for w in (less, more)],
    )
    assert -1e-12 <= kept[1] <= kept[0] <= 1 + 1e-12
    assert -1e-12 <= spent[0] <= spent[1] <= 1 + 1e-12


@given(LAWS)
def test_the_branches_meet(law: tuple[float, float]) -> None:
    peak, limit = law
    assert intact_share(peak, peak, limit) == pytest.approx(1, rel=1e-12)
    assert intact_share(limit, peak, limit) == 0
    assert dissipated_share(peak, peak, limit) == 0
    assert dissipated_share(limit, peak, limit) == 1


@given(LAWS, SHARES)
def test_energy_is_the_area_below_the_curve(law: tuple[float, float], share: float) -> None:
    """Held and spent energy at `worst` are the area up to it, over c xi: the trapezoid from the peak on."""
    peak, limit = law
    worst = peak + share * (limit - peak)
    pull = peak * (limit - worst) / (limit - peak)
    area = peak * peak / 2 + (peak + pull) / 2 * (worst - peak)
    held = intact_share(worst, peak, limit) * worst**2 / 2
    spent = peak * limit / 2 * dissipated_share(worst, peak, limit)
    assert held + spent == pytest.approx(area, rel=1e-9)


@given(st.floats(1.0, 100.0), st.booleans())
def test_both_recipes_order_their_limits(kr: float, keep: bool) -> None:
    peak, limit = law(kr, keep)
    assert 0 < peak <= limit * (1 + 1e-15)
