"""Loads that repeat."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import shipped

from pdmesh.model.document import Fatigue, Material, ParticleRules
from pdsolve.measures.fatigue import cycles_after_steps
from pdsolve.model import Model
from pdsolve.rest.paris import ParisSteps
from pdsolve.run.simulation import Options, simulate

WAY, SHORT, LONG = 8, 1, 4  # mm that the crack grows, and particles, mm
YIELD = 355e6  # Pa, of structural steel S355


def grown(particle: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cycles (s,) and lengths from the load line (s,), m, of a compact-tension specimen whose crack begins at 27 mm."""
    made = shipped("fatigue_compact_tension.py", [("crack", "0.027"), ("C", "1.2e-37"), ("m", "4")])
    settings = msgspec.structs.replace(
        made.settings,
        material=Material(E=200e9, rho=7850, G0=1e9),
        run=msgspec.structs.replace(
            made.settings.run,
            steps=WAY // particle,
            particles=ParticleRules(spacing=float(particle)),
            fatigue=Fatigue(C=1.2e-37, m=4.0),
        ),
    )
    with simulate(Model(made.grid, settings), None, Options(threads=1)) as results:
        place = np.asarray(results.particles().place)
        return cycles_after_steps(results), np.sort(place[:, 0])[-1 - WAY // particle :]


@pytest.fixture(scope="module")
def lived() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return grown(SHORT)


@pytest.mark.slow
def test_particles_that_are_long(
    failure: Callable[..., None],
    lived: tuple[NDArray[np.float64], NDArray[np.float64]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Jumps of cycles that are too long.

    Growth within a jump is extrapolated from the jump before. Where the crack accelerates from one particle to the
    next, the extrapolation lags behind.
    """
    halved, end = grown(LONG)
    among = float(halved[-1] / np.interp(end[-1], lived[1], lived[0]))
    monkeypatch.setattr(ParisSteps, "_largest_growth_rate_ratios", lambda *_: (1.0, 1.0))
    coarse, _ = grown(LONG)
    ratio = float((coarse[-1] - coarse[-2]) / (lived[0][-1] - lived[0][-1 - LONG // SHORT]))
    assert 1.1 < ratio < 1.6
    assert 0.95 < among < 1.05
    failure(
        fails=f"A crack in a compact-tension specimen 50 mm wide grows from {WAY - LONG + 27} to {WAY + 27} mm by K,"
        f" in one particle of {LONG} spacings: it would take {ratio:.2f} times as many cycles as in particles of one"
        " spacing.",
        noticed="By growth that is more than twice as fast after a jump as before it. The jump is taken back.",
        cure=f"None is needed: particles are halved, and the life until {end[-1] * 1e3:.0f} mm is {among:.2f} of that"
        " by particles of one spacing. A warning says where even these are too long. Runs whose bonds tire do not have"
        " this error: each of their jumps ends at the next"
        " broken bond.",
    )


@pytest.mark.slow
def test_a_net_section_that_yields(
    failure: Callable[..., None], lived: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> None:
    """A net section that yields.

    The body is elastic, and knows no yield stress. Its crack grows by K until nothing bears the largest loads.
    """
    N, a = lived
    load, W = 0.5e6, 0.05
    stress = load / (W - a) * (1 + 3 * (W + a) / (W - a))  # of a beam under tension and bending
    first = int(np.argmax(stress > YIELD))
    spent = float(N[first] / N[-1])
    assert 0 < first < len(a) - 1
    assert stress[-1] > 1.5 * YIELD
    failure(
        fails=f"By beam theory the stress in the specimen's net section is {stress[-1] * 1e-6:.0f} MPa at a crack of"
        f" {a[-1] * 1e3:.0f} mm, and the crack grows on as if it were elastic.",
        noticed="Not at all.",
        cure=f"Count cycles only until the net section yields. With a yield stress of 355 MPa this is at"
        f" {a[first] * 1e3:.0f} mm, after {spent:.2f} of"
        f" the cycles to {a[-1] * 1e3:.0f} mm. `run.fatigue.cycles` ends a run there.",
    )
