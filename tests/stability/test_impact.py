"""Impact."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from plates import STEEL, struck_plate

from pdmesh.model.document import Material
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import list_breaks_since

DURATION = 50e-6  # s
NOTCH, MIDDLE = 75.5e-3, 100e-3  # m from an end of the plate
TOUGH = Material(E=191e9, rho=8000.0, G0=42408.0)  # J/m^2: K_Ic of 90 MPa m^0.5
PLACES = {  # m: x from, to; distance from the middle of the plate from, to
    "behind the far edge": (90e-3, 101e-3, 0.0, 20e-3),
    "in a branch ahead of the cracks": (68e-3, 88e-3, 20e-3, 45e-3),
    "at the far edge's ends": (90e-3, 101e-3, 50e-3, 101e-3),
}


class Torn(NamedTuple):
    """What breaks at a place."""

    bonds: int  # directed
    first: float  # s; infinite without
    detour: float  # m from the struck edge to the first by way of an end of the plate, at least


def torn(clamped: bool, material: Material = STEEL) -> dict[str, Torn]:
    """Solve the struck plate and look at each of PLACES."""
    problem = prepare(struck_plate(clamped=clamped, material=material), Options(threads=1))
    problem.advance(1, round(DURATION / problem.system.time_step) + 1)
    broke = list_breaks_since(problem.system, 0)
    x, y = problem.system.model.grid.position[broke.node - 1].T
    off = np.abs(y - MIDDLE)

    def at(there: NDArray[np.bool_]) -> Torn:
        if not there.any():
            return Torn(0, float("inf"), float("inf"))
        detour = np.hypot(x[there][0], NOTCH + MIDDLE - off[there][0])
        return Torn(int(there.sum()), float(broke.step[there][0]) * problem.system.time_step, float(detour))

    return {
        name: at((x > left) & (x < right) & (off >= near) & (off < far))
        for name, (left, right, near, far) in PLACES.items()
    }


@pytest.mark.slow
def test_the_far_edge_of_a_struck_plate(failure: Callable[..., None]) -> None:
    """A struck plate that spalls at its far edge.

    The compression pulse is reflected by the free edge as tension, which tears the plate at its weaker points. The
    scene of the thesis, with its 32 m/s and 6.1 kJ/m^2 for a crack, shows this. Its supports contribute later: the
    plate moves on while its ends are held, and the far edge is stretched.
    """
    speed = float(np.sqrt(1.125 * STEEL.E / STEEL.rho))
    clamped, free, tough = torn(True), torn(False), torn(True, TOUGH)
    spall, branch, ends = PLACES
    for name in (spall, branch):
        assert clamped[name].bonds > 500  # measured 1234 and 2402
        assert clamped[name].first == free[name].first  # measured 20.8 and 23.5 us, to the step
        assert 0.1 < speed * clamped[name].first < clamped[name].detour  # m: measured 0.108 < 0.194, 0.122 < 0.173
    assert clamped[ends].bonds > 100  # measured 334
    assert free[ends].bonds == 0
    assert [one.bonds for one in tough.values()] == [0, 0, 0]
    failure(
        fails="Kalthoff and Winkler's plate of 1 mm as in the thesis, its ends clamped: "
        + ", ".join(
            f"{one.bonds} bonds (each counted from both ends) break {name}, from {1e6 * one.first:.1f} us on"
            for name, one in clamped.items()
        )
        + ".",
        noticed=f"Not at all. The pulse has crossed the plate at {1e6 * 0.1 / speed:.1f} us. Reflected by an end it "
        "would "
        f"reach the spall at {1e6 * clamped[spall].detour / speed:.1f} us, the branch at "
        f"{1e6 * clamped[branch].detour / speed:.1f} us.",
        cure="Free ends, as in the experiment: no bond breaks at the ends, and the spall and the branch begin "
        f"in the same steps. A steel that dissipates {TOUGH.G0 / 1e3:.1f} kJ/m^2 on a crack cures both: no bond breaks."
        " The shipped scene stays the thesis's; the thesis mode shows all three.",
    )
