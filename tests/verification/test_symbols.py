"""What a checkerboard and stripes meet under each control of correspondence: its symbol tells one from the other.

E = rho = spacing = 1, cubic spline; numbers of an independent program, from the symbol of an infinite lattice.
"""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

SIDE = 21
UNIT = msgspec.structs.replace(GLASS, E=1.0, rho=1.0, model="correspondence", failure="none", nu=0.2)


def made(ratio: float, **material: object) -> PreparedRun:
    kind = msgspec.structs.replace(UNIT, **material)
    return prepare(plate(square_grid(SIDE, SIDE, 1.0), ratio, material=kind), Options(threads=1))


def eigenvalues(problem: PreparedRun, kx: int, ky: int) -> list[float]:
    """Those of the symbol at (kx pi, ky pi), by the forces on the middle node."""
    system, state = problem
    middle, found = SIDE**2 // 2, []
    i, j = np.arange(SIDE**2) % SIDE, np.arange(SIDE**2) // SIDE
    for axis in (0, 1):
        state.value[:] = 0
        state.value[:, axis] = 1e-8 * (-1.0) ** (kx * i + ky * j)
        out = np.zeros_like(state.value)
        system.operator.accumulate_force(state, out, 0, 0.0)
        found.append(float(-out[middle, axis] / state.value[middle, axis]))
    return sorted(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "material", "checkerboard", "stripes"),
    [
        (3, {"control": "none"}, 0.0, (0.0, 0.0)),
        (3, {"control_factor": 0.1}, 0.2508, (0.2445, 0.2445)),
        (3, {}, 1.2542, (1.2227, 1.2227)),
        (3, {"control_factor": 1.0}, 2.5083, (2.4454, 2.4454)),
        (3, {"control": "wan"}, 3.5010, (3.4132, 3.4132)),
        (3, {"control": "breitzman-dayal"}, 1.6735, (0.9258, 1.6164)),
        (3, {"control": "wan", "nu": 0.25, "plane": "strain"}, 4.4813, None),
        (3, {"control": "breitzman-dayal", "nu": 0.25, "plane": "strain"}, 1.8361, None),
        (4, {}, 0.6331, None),
        (4, {"control": "wan"}, 1.9711, None),
        (4, {"control": "breitzman-dayal"}, 1.1839, None),
    ],
)
def test_controls(
    ratio: float, material: dict[str, object], checkerboard: float, stripes: tuple[float, ...] | None
) -> None:
    problem = made(ratio, **material)
    tight = 1e-14 if material.get("control") == "none" else 1e-4
    assert eigenvalues(problem, 1, 1) == pytest.approx([checkerboard] * 2, abs=tight)
    if stripes is not None:
        assert eigenvalues(problem, 1, 0) == pytest.approx(stripes, abs=tight)


@pytest.mark.slow
@pytest.mark.parametrize("control", ["silling", "wan", "breitzman-dayal"])
def test_uniform_strain_meets_nothing_inside(control: str) -> None:
    """And holds the energy of Hooke's plate, whatever Poisson's ratio."""
    system, state = made(3, control=control, nu=0.45, plane="strain")
    gradient = 1e-6 * np.array([[1.0, 0.3], [-0.7, 0.4]])
    state.value[:] = system.model.grid.position @ gradient.T
    out = np.zeros_like(state.value)
    system.operator.accumulate_force(state, out, 0, 0.0)
    inside = np.abs(out).reshape(SIDE, SIDE, 2)[9:12, 9:12]
    assert inside.max() <= 1e-12 * np.abs(out).max()  # measured 2e-15
    e, nu = (gradient + gradient.T) / 2, 0.45
    lame, mu = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    expected = lame / 2 * np.trace(e) ** 2 + mu * (e * e).sum()
    assert system.operator.energies(state)[0][SIDE**2 // 2] == pytest.approx(expected, rel=1e-12)
