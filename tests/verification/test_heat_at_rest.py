"""Rest after each step of heat conduction: free and clamped bars, what breaks, and a run that is stopped."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from diffusion_models import grid, ids
from numpy.typing import NDArray

from pdmesh.model.document import (
    Concentration,
    Displacement,
    Horizon,
    InitialConcentration,
    Material,
    Run,
    Settings,
    Static,
)
from pdmesh.model.medium import Medium
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, resume, simulate

H, CELLS, ROWS = 1e-3, 40, 8  # m; nodes along and across
STEEL = Material(E=200e9, rho=8000.0, G0=1e9, micromodulus="constant", alpha=1e-5, T0=300.0)
DT = 100.0  # K
ONE = Options(threads=1)
PLACE = np.column_stack([axis.ravel() for axis in np.meshgrid(H * (np.arange(CELLS) + 0.5), H * np.arange(ROWS))])
LEFT, RIGHT = (ids(end) for end in (PLACE[:, 0] < H, PLACE[:, 0] > (CELLS - 1) * H))


def bar(*conditions: object, material: Material = STEEL, D: float = 1e-5, **run: object) -> Model:
    """A bar that rests after each step, in SI units; by default 20 of 10 s."""
    settings = Settings(
        physics="thermoelastic", material=material, medium=Medium(D=D), horizon=Horizon(3.0),
        conditions=conditions, run=Run(**{"solver": "static", "time_step": 10.0, "steps": 20, "every": 5} | run),
    )  # fmt: skip
    return Model(grid(PLACE, H), settings)


HOT = InitialConcentration(nodes=ids(np.ones(len(PLACE), dtype=bool)), value=300.0 + DT)
STANDS = (Displacement(nodes=LEFT, x=0.0), Displacement(nodes=(1,), y=0.0))


def last(model: Model, name: str) -> NDArray[np.float64]:
    with simulate(model, None, ONE) as results:
        return results.field(name, model.settings.run.steps).astype(float)


@pytest.mark.slow
def test_a_free_bar_stretches_and_is_free_of_stress() -> None:
    with simulate(bar(HOT, *STANDS, static=Static(tolerance=1e-12)), None, ONE) as results:
        ux, energy, summary = results.field("ux", 20), results.field("energy", 20), results.summary()
    x = PLACE[:, 0] - PLACE[0, 0]
    assert np.abs(ux - 1e-5 * DT * x).max() < 1e-9 * 1e-5 * DT * x.max() + 4e-12  # fields are in single precision
    stress = np.sqrt(2 * 200e9 * energy.max())
    assert stress < 1e-12 * 200e9 * 1e-5 * DT * 2  # measured 8.5e-13
    assert abs(summary["balance"]) < 1e-12  # measured 3e-15


@pytest.mark.slow
def test_a_clamped_bar_that_cools_breaks() -> None:
    """Bonds break where they are stretched from what they would be long, not by what they are."""
    cold = tuple(Concentration(nodes=nodes, value=300.0 - DT) for nodes in (LEFT, RIGHT))
    held = (*STANDS, Displacement(nodes=RIGHT, x=0.0))
    brittle = msgspec.structs.replace(STEEL, G0=100.0)  # limit of a bond: some 4e-4, less than alpha dT
    with simulate(bar(*cold, *held, material=brittle, every=1), None, ONE) as results:
        broken, summary = results.breaks(), results.summary()
    assert len(broken.step) > 0
    assert abs(summary["balance"]) < 1e-4  # measured 7e-6, of 752 directed bonds
    with simulate(bar(*cold, *STANDS, material=brittle, every=1, D=1.0), None, ONE) as results:
        assert len(results.breaks().step) == 0  # a free bar, cold all through, is shorter and whole


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*energy balance error")
def test_a_stopped_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    model = bar(Concentration(nodes=RIGHT, value=400.0), *STANDS, every=4, ledger=2)
    simulate(model, whole, ONE).close()
    simulate(model, path, ONE, watch=lambda progress: progress.step >= 9).close()
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
    resume(path, 1).close()
    assert contents(path) == contents(whole)
