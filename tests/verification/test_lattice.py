"""What a full square lattice makes of the continuum: stiffness and fracture energy, on paper and in the solver."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, stiffness

from pdmesh.model.lattice_calibration import calibration, full_family, lattice_ratios
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

# m, micromodulus: per cent of C11 and C66 too much, whole cells up to the horizon | Hu's beta, half a spacing beyond
STIFFNESS = {
    (3, "constant"): (5.3, 0.5, 3.27, -1.75),
    (4, "constant"): (-2.6, -7.3, 1.58, 0.37),
    (6, "constant"): (-0.9, 2.4, 0.80, -0.04),
    (12, "constant"): (-3.6, -4.1, 0.22, 0.26),
    (3, "conical"): (-3.3, -7.3, -4.3, -10.3),
    (4, "conical"): (-1.2, -2.4, -1.9, -3.9),
    (6, "conical"): (-0.4, -0.7, -0.85, -1.65),
}
# m, micromodulus, Hu's beta: energy of a crack along a row | at 45 degrees, over G0
FRACTURE = {
    (3, "constant", True): (1.034, 1.050),
    (4, "constant", True): (1.021, 1.028),
    (6, "constant", True): (1.009, 1.013),
    (3, "constant", False): (1.026, 1.048),
    (4, "constant", False): (0.929, 0.957),
    (3, "conical", True): (0.907, 0.915),
    (4, "conical", True): (0.959, 0.961),
    (6, "conical", True): (0.980, 0.982),
}
# The thesis's own choice, beta inside |xi| <= horizon only: per cent of C11 and C66 too much
THESIS = {
    (3, "constant"): (-13.3, -12.6),
    (4, "constant"): (-12.3, -11.2),
    (6, "constant"): (-7.8, -4.5),
    (12, "constant"): (-5.4, -5.2),
    (3, "conical"): (-4.3, -10.3),
    (4, "conical"): (-1.9, -3.9),
    (6, "conical"): (-0.85, -1.65),
}


def last_digit(printed: float) -> float:
    """Half a unit of the last printed digit, and the round-off of saying so."""
    return 0.5 * 10.0 ** -len(str(printed).split(".")[1]) * (1 + 1e-9)


@pytest.mark.parametrize(("m", "profile"), STIFFNESS)
def test_stiffness(m: int, profile: str) -> None:
    """Every printed digit of the table: 5e-4 of the stiffness at worst, 5e-5 where two decimals are printed."""
    whole = lattice_ratios(m, profile, "stress", False)
    partial = lattice_ratios(m, profile, "stress", True)
    found = (whole.c11, whole.c66, partial.c11, partial.c66)
    for value, printed in zip(found, STIFFNESS[m, profile], strict=True):
        assert 100 * (value - 1) == pytest.approx(printed, abs=1.1 * last_digit(printed))  # measured: all digits
    assert partial.c12 == partial.c66


@pytest.mark.parametrize(("m", "profile", "partial"), FRACTURE)
def test_fracture_energy(m: int, profile: str, partial: bool) -> None:
    found = lattice_ratios(m, profile, "stress", partial)
    assert (found.row, found.diagonal) == pytest.approx(FRACTURE[m, profile, partial], abs=5.5e-4)  # all digits


def test_the_lattice_becomes_the_continuum() -> None:
    for profile in ("constant", "conical"):
        coarse, fine = (np.abs(np.array(lattice_ratios(m, profile, "stress", True)) - 1).max() for m in (6, 24))
        assert fine < coarse / 8  # measured 1.3e-3 of 2.1e-2 (constant), and so on
        assert fine < 2e-3


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("m", [3, 4, 6, 12])
@pytest.mark.parametrize("partial", [True, False])
def test_calibration_leaves_no_mean_error(m: int, profile: str, plane: str, partial: bool) -> None:
    """Mean stiffness and mean fracture energy are those of the material."""
    material = msgspec.structs.replace(GLASS, micromodulus=profile, plane=plane)
    factors = calibration(m, material, partial)
    found = factors.ratios
    mean_stiffness = factors.stiffness * (found.c11 + found.c12 + found.c66) / 3
    mean_energy = factors.stiffness * factors.stretch**2 * (found.row + found.diagonal) / 2
    assert mean_stiffness == pytest.approx(1, rel=1e-12)  # measured 2e-16
    assert mean_energy == pytest.approx(1, rel=1e-12)  # measured 4e-16


def inner_node(mode: str, m: int, profile: str) -> tuple[tuple[float, float, float], int]:
    """C11, C22, C66 over the material's, and the bonds, of the middle node of a plate made by the solver."""
    side = max(21, 4 * m + 5)
    material = msgspec.structs.replace(GLASS, micromodulus=profile)
    problem = prepare(plate(square_grid(side, side), m, material=material), Options(mode))
    middle = (side * side - 1) // 2
    c11, c22, c66 = stiffness(bonds_of(problem), middle)
    E, start = material.E, bonds_of(problem).start
    return (c11 / (1.125 * E), c22 / (1.125 * E), c66 / (0.375 * E)), int(start[middle + 1] - start[middle])


@pytest.mark.quick_cases(6)
@pytest.mark.parametrize(("m", "profile"), THESIS)
def test_a_node_of_the_thesis_mode(m: int, profile: str) -> None:
    (c11, c22, c66), bonds = inner_node("thesis", m, profile)
    for value, printed in zip((c11, c66), THESIS[m, profile], strict=True):
        assert 100 * (value - 1) == pytest.approx(printed, abs=1.1 * last_digit(printed))  # measured: all digits
    assert c22 == pytest.approx(c11, rel=1e-12)
    assert bonds == full_family(m)


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("m", "profile"),
    [(3, "constant"), (4, "constant"), (6, "constant"), (3, "conical"), (4, "conical"), (6, "conical")],
)
def test_a_node_of_the_conservative_mode(m: int, profile: str) -> None:
    """The lattice, calibrated, to round-off: partial cells with a constant micromodulus, whole ones with a conical one;
    surfaces and their correction do not reach it."""
    found, bonds = inner_node("conservative", m, profile)
    partial = profile == "constant"
    lattice = lattice_ratios(m, profile, "stress", partial)
    factor = calibration(m, msgspec.structs.replace(GLASS, micromodulus=profile), partial).stiffness
    expected = (factor * lattice.c11, factor * lattice.c11, factor * lattice.c66)
    assert found == pytest.approx(expected, rel=1e-12)  # measured 1e-14
    # Bonds without stiffness are left out, whatever round-off makes of the length of those at the horizon.
    assert (
        bonds
        == {
            ("constant", 3): 36,
            ("constant", 4): 68,
            ("constant", 6): 136,
            ("conical", 3): 24,
            ("conical", 4): 44,
            ("conical", 6): 108,
        }[profile, m]
    )


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("m", [3.0, 4.0, 4.5])
def test_families_do_not_depend_on_round_off(mode: str, profile: str, m: float) -> None:
    """All nodes of the interior see as many, and the corners of a plate as many as each other."""
    side = 21
    model = plate(
        square_grid(side, side, delta=1e-3 / 3, x0=0.1),
        m,
        material=msgspec.structs.replace(GLASS, micromodulus=profile),
    )
    family = prepare(model, Options(mode)).system.family_sizes.reshape(side, side)
    deep = int(m) + 1
    assert len(np.unique(family[deep:-deep, deep:-deep])) == 1
    for turned in (family.T, family[::-1], family[:, ::-1]):
        assert np.array_equal(family, turned)
