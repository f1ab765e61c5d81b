"""Ordinary and micropolar solids: what lattices hold, strips and holes at any Poisson's ratio, and what a crack costs.

Numbers that are compared with "independent" ones are of another program on the same lattices.
"""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from cracked_strips import torn
from effective_length import LAWS, OVER, STRIP, length_of
from kirsch import solved
from plates import GLASS, plate, square_grid
from static_solution import strip

import pdsolve.laws
from benchmarks import ties
from pdmesh.model.document import Material
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

UNIT = msgspec.structs.replace(GLASS, E=1.0, rho=1.0, model="ordinary", failure="none", nu=0.3)
STRAIN = msgspec.structs.replace(UNIT, plane="strain")


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ordinary solid without what makes it exact at surfaces and on lattices."""
    monkeypatch.setitem(pdsolve.laws.MODELS, "ordinary", ties.published())


def held(material: Material, ratio: float) -> list[float]:
    """Energy in uniaxial strain, shear and equibiaxial strain over that of Hooke's plate, deep inside."""
    side, nu = 2 * int(2 * ratio + 3) + 1, material.nu or 0.0
    system, state = prepare(plate(square_grid(side, side, 1.0), ratio, material=material), Options(threads=1))
    position, middle, found = system.model.grid.position, side**2 // 2, []
    C11, C12 = (1, nu) if material.plane == "stress" else ((1 - nu), nu)
    factor = 1 / (1 - nu**2) if material.plane == "stress" else 1 / ((1 + nu) * (1 - 2 * nu))
    exact = (factor * C11 / 2, 1 / (4 * (1 + nu)), factor * (C11 + C12))
    for gradient, expected in zip(([[1, 0], [0, 0]], [[0, 0.5], [0.5, 0]], [[1, 0], [0, 1]]), exact, strict=True):
        state.value[:] = 0
        state.value[:, :2] = 1e-6 * (position - position[middle]) @ np.array(gradient).T
        found.append(float(system.operator.energies(state)[0][middle] / 1e-12 / expected))
    return found


@pytest.mark.slow
@pytest.mark.quick_cases(2)
@pytest.mark.usefixtures("published")
@pytest.mark.parametrize(
    ("ratio", "stretched", "sheared"), [(2, 1.0098, 0.9658), (3, 1.0104, 0.9638), (4, 1.0017, 0.9940)]
)
def test_what_a_lattice_of_the_published_solid_holds(ratio: float, stretched: float, sheared: float) -> None:
    assert held(STRAIN, ratio) == pytest.approx([stretched, sheared, 1.0], abs=1e-4)  # independent
    assert held(UNIT, ratio)[1] == pytest.approx(sheared, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [2, 3])
def test_what_the_corrected_solid_holds(ratio: float) -> None:
    assert held(STRAIN, ratio) == pytest.approx([1, 1, 1], abs=2e-6)  # measured 1e-6: strain is 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "nu", "expected"),
    [(3, 0.0, (0.9436, 0.9423, 1.0201)), (3, 0.2, (0.9971, 0.9624, 1.0201)), (6, 0.0, (0.9659, 0.9757, 1.0059))],
)
def test_what_a_lattice_of_beams_holds(ratio: float, nu: float, expected: tuple[float, ...]) -> None:
    beams = msgspec.structs.replace(UNIT, model="micropolar", nu=nu)
    assert held(beams, ratio) == pytest.approx(expected, abs=1e-4)  # independent


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("nu", [0.2, 0.45])
def test_a_strip_has_the_poisson_ratio_that_is_said(nu: float) -> None:
    """Correspondence within 1e-3, the ordinary solid within 2 per cent; plane stress."""
    for model, tight in (("correspondence", 1e-3), ("ordinary", 0.02)):
        E, lateral = strip(msgspec.structs.replace(UNIT, model=model, nu=nu))
        assert pytest.approx(1, abs=tight) == E
        assert lateral == pytest.approx(nu, abs=tight)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("nu", "E", "lateral"), [(0.0, 0.8995, 0.0803), (0.2, 0.9493, 0.2268), (1 / 3, 1.0096, 0.3159)]
)
def test_a_strip_of_beams(nu: float, E: float, lateral: float) -> None:
    found = strip(msgspec.structs.replace(UNIT, model="micropolar", nu=nu))
    assert found == pytest.approx((E, lateral), abs=2e-3)  # independent


@pytest.mark.slow
def test_a_hole_in_a_nearly_incompressible_plate() -> None:
    """nu = 0.45, plane strain: the stress a horizon above the hole."""
    found = solved(16, 3, msgspec.structs.replace(STRAIN, nu=0.45))
    assert found.exact == pytest.approx(2.109, abs=1e-3)
    assert found.stress == pytest.approx(found.exact, rel=0.05)  # measured 2.123; 1.536 as published
    assert found.error <= 0.0042  # measured 0.0035


@pytest.mark.slow
@pytest.mark.usefixtures("published")
def test_holes_in_plates_of_the_published_solid() -> None:
    """Independent: 0.90, 0.50 per cent; a stress of 1.5 where 2.109 is exact."""
    errors = [solved(fineness, 3, UNIT).error for fineness in (8, 16)]
    assert errors == pytest.approx([0.0090, 0.0050], abs=1e-4)
    assert solved(16, 3, msgspec.structs.replace(STRAIN, nu=0.45)).stress == pytest.approx(1.536, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("control", "error"),
    [
        ("silling", 0.0110),
        pytest.param("breitzman-dayal", 0.0135, marks=pytest.mark.slow),
        pytest.param("wan", 0.0111, marks=pytest.mark.slow),
    ],
)
def test_a_hole_under_correspondence(control: str, error: float) -> None:
    """Independent, eight nodes a radius, plane stress."""
    found = solved(8, 3, msgspec.structs.replace(UNIT, model="correspondence", control=control))
    assert found.error <= 1.2 * error


@pytest.mark.slow
@pytest.mark.parametrize(("failure", "over"), [("stretch", 1.02), ("energy", 1.1)])
def test_a_straight_crack_costs_what_it_should(failure: str, over: float) -> None:
    """What is spent, over G0 and the length that is cracked; energy is kept.

    Bonds book their own energy, which overstates a slow crack by the energy that the balance lacks: .01, .02.
    """
    found = torn(msgspec.structs.replace(GLASS, model="ordinary", nu=0.3, failure=failure), over=over)
    assert found.through > 0.5  # it ran: measured 0.66, 0.99
    assert found.cost / found.through == pytest.approx(1, abs=0.065)  # measured 1.052, 1.057
    assert found.balance <= 0.045  # measured 0.020, 0.042, half of it of how the ends begin to move


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("law", "ratio", "length"),
    [("bonds, constant", 3, 2.225), ("ordinary, cubic spline", 3, 1.449), ("correspondence, cubic spline", 4, 3.171)],
)
def test_effective_lengths(law: str, ratio: float, length: float) -> None:
    """Those that long waves see; the page has them."""
    assert length_of(LAWS[law], ratio) == pytest.approx(length, abs=5e-4)


@pytest.mark.slow
def test_a_chain_of_springs_is_as_long_as_they_are() -> None:
    """Bonds to next neighbours alone, of a horizon of one spacing."""
    assert length_of(msgspec.structs.replace(LAWS["bonds, constant"]), 1.0) == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
def test_a_crack_needs_two_spacings_of_effective_length() -> None:
    """Why the influence of an ordinary solid is constant unless it is set; the page has more."""
    through = {}
    for influence in ("constant", "cubic spline"):
        solid = msgspec.structs.replace(GLASS, model="ordinary", nu=1 / 3, influence=influence, failure="stretch")
        through[influence] = torn(solid, 3.0, *STRIP, over=OVER).through
    assert through["constant"] > 0.95  # measured 1.00
    assert through["cubic spline"] < 0.05  # measured 0.012
