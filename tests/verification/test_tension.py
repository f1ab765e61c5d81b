"""A plate with free edges in tension: the stiffness of a body whose surfaces are a horizon deep."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import equilibrium

from pdmesh.model.document import Load
from pdmesh.model.lattice_calibration import calibration
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

STRESS = 1.0


class Stretch(NamedTuple):
    """Errors over the strain STRESS / E of a classical plate."""

    gauge: float  # of the strain over the middle half
    total: float  # of the strain from end to end


def pulled(mode: str, m: float, profile: str, fineness: int = 100, rows: int = 1) -> Stretch:
    """A plate of 1 x 0.5 m, `fineness` nodes a metre, pulled along x by a traction over `rows` columns of nodes."""
    delta, columns, height = 1 / fineness, fineness, fineness // 2
    grid = square_grid(columns, height, delta, x0=delta / 2, y0=delta / 2)
    ends = ((1 - rows * delta, 0.0, 1.0, 0.5), (0.0, 0.0, rows * delta, 0.5))
    loads = tuple(
        Load(box=box, traction=(sign * STRESS, 0.0), rows=rows, length=0.5)
        for box, sign in zip(ends, (1, -1), strict=True)
    )
    material = msgspec.structs.replace(GLASS, E=1.0, micromodulus=profile)
    problem = prepare(plate(grid, m, material=material, conditions=loads), Options(mode, threads=1))
    held = np.zeros((len(grid), 2), dtype=bool)
    middle = (height // 2) * columns + columns // 2
    held[middle] = True  # in place, and
    held[middle + columns // 4, 1] = True  # not turning
    u = equilibrium(problem, held, np.zeros((len(grid), 2)))[:, 0].reshape(height, columns).mean(axis=0)
    first, last = columns // 4, 3 * columns // 4 - 1
    gauge = (u[last] - u[first]) / ((last - first) * delta)
    return Stretch(float(gauge / STRESS - 1), float((u[-1] - u[0]) / ((columns - 1) * delta) / STRESS - 1))


def softness(m: float, profile: str, partial: bool) -> float:
    """Strain of the endless calibrated lattice in tension along its rows, over the classical one, less 1."""
    factor, _, _, found = calibration(m, msgspec.structs.replace(GLASS, micromodulus=profile), partial)
    c11, c12 = factor * 1.125 * found.c11, factor * 0.375 * found.c12
    return 1 / (c11 - c12**2 / c11) - 1


# mode, m, micromodulus: per cent of strain too much in the middle half | from end to end, one loaded column
MEASURED = {
    ("conservative", 3, "constant"): (-4.86, -5.13),
    ("conservative", 4, "constant"): (-1.75, -1.08),
    ("conservative", 3, "conical"): (-4.14, -4.84),
    ("conservative", 4, "conical"): (-1.67, -2.11),
}


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "m", "profile"), MEASURED)
def test_the_strain_of_a_plate_of_100_nodes(mode: str, m: int, profile: str) -> None:
    """Published for energy corrections without calibration: -1.4 | -2.0 (m = 3), -0.75 | -0.3 (m = 4), -0.8 | -1.5
    (m = 4, conical).

    Most of the error is the endless lattice's: calibrated so that the mean of C11, C12 and C66 is right, it is too
    stiff in tension along its rows. Without that, what surfaces do is below 0.7 per cent.
    """
    found = pulled(mode, m, profile)
    assert (100 * found.gauge, 100 * found.total) == pytest.approx(MEASURED[mode, m, profile], abs=0.02)
    assert -0.007 <= found.gauge - softness(m, profile, profile == "constant") <= 0  # measured -0.43 to -0.67 per cent


@pytest.mark.slow
def test_a_load_over_four_columns_too() -> None:
    """The strain of the middle is as good; the ends do stretch less, being loaded inside."""
    found = pulled("conservative", 4, "constant", rows=4)
    assert abs(found.gauge) <= 0.02  # measured -1.67 per cent


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("m", "profile", "measured"), [(3, "constant", -31.8), (4, "constant", -35.3), (4, "conical", -43.0)]
)
def test_the_thesis_mode_loses_its_load(m: int, profile: str, measured: float) -> None:
    """One loaded column: its softening coefficient divides the load (published: -45 per cent)."""
    found = pulled("thesis", m, profile, fineness=60)
    assert 100 * found.gauge == pytest.approx(measured, abs=0.1)


def order(x: tuple[int, ...], errors: list[float]) -> float:
    """The exponent of 1 / x that fits the errors best."""
    return float(-np.polyfit(np.log(x), np.log(np.abs(errors)), 1)[0])


@pytest.mark.slow
def test_delta_convergence() -> None:
    """m = 4, 20 to 160 nodes a metre: first order in the horizon, towards the lattice's own stiffness."""
    finenesses = (20, 40, 80, 160)
    errors = [pulled("conservative", 4, "constant", n).gauge - softness(4, "constant", True) for n in finenesses]
    assert errors == pytest.approx([-0.0372, -0.0171, -0.0084, -0.0041], abs=2e-4)  # measured to all digits
    assert order(finenesses, errors) == pytest.approx(1.06, abs=0.05)  # measured 1.055


@pytest.mark.slow
def test_m_convergence() -> None:
    """A horizon of 5 cm, loads over one horizon, m = 2, 3, 4, 6: the lattice's error goes, the surfaces' stays. The
    lattice of m = 2 is made isotropic, and has none."""
    ratios = (2, 3, 4, 6)
    gauge = [pulled("conservative", m, "constant", 20 * m, rows=m).gauge for m in ratios]
    assert gauge == pytest.approx([-0.0101, -0.0513, -0.0183, -0.0145], abs=2e-4)  # m = 8: -0.0130
    surfaces = [found - softness(m, "constant", True) for m, found in zip(ratios, gauge, strict=True)]
    assert surfaces[1:] == pytest.approx([-0.007] * 3, abs=1e-3)  # measured -0.75, -0.74, -0.69 per cent
    assert order(ratios[1:], [found + 0.0065 for found in gauge[1:]]) >= 1.8  # measured 2.6


def test_m_convergence_of_the_lattice() -> None:
    """The endless lattice in tension, m = 4 to 24: third order with the conical profile and partial cells, less in
    error and not so smooth with whole ones. m = 3 with partial cells is made isotropic."""
    ratios = (3, 4, 6, 8, 12, 16, 24)
    assert softness(3, "conical", True) == pytest.approx(0, abs=1e-12)  # 5.6 per cent with the mean alone
    partial, whole = ([softness(m, "conical", cells) for m in ratios[1:]] for cells in (True, False))
    assert order(ratios[1:], partial) == pytest.approx(3.10, abs=0.01)
    assert all(abs(less) < 0.77 * abs(more) for less, more in zip(whole, partial, strict=True))  # measured 0.23 to 0.76
    errors = [
        abs(softness(m, "constant", True)) for m in ratios
    ]  # no smooth way down: 4.4, 1.1, 0.8, 0.6, 0.03 ... per cent
    assert max(errors[3:]) <= 0.0063
    assert max(errors[4:]) <= 0.0006
