"""Bonds that break conduct less: a strip with a crack across it, as resistances in a row."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from diffusion_models import grid, ids
from messages import naming
from numpy.typing import NDArray

from pdmesh import Heat, SceneError
from pdmesh.model.document import Concentration, Displacement, Horizon, InitialConcentration, Material, Run, Settings
from pdmesh.model.medium import Medium
from pdsolve.model import Model, ModelError
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.run.system import PreparedRun
from pdsolve.state import Broken

H, CELLS = 1e-3, 14  # m
STEEL = Material(E=200e9, rho=8000.0, G0=1e9, micromodulus="constant", alpha=1e-5, T0=300.0)
HOT, COLD = 400.0, 300.0  # K, at the first and the last node along x
ONE = Options(threads=1)


def strip(share: float, dimension: int, ratio: float, corrected: bool = True, **run: object) -> PreparedRun:
    """A strip whose ends are held at two temperatures, with all bonds across its middle broken."""
    counts = (CELLS, 3, 3)[:dimension]
    axes = np.meshgrid(*[H * (np.arange(count) + 0.5) for count in counts], indexing="ij")
    place = np.column_stack([axis.ravel(order="F") for axis in axes])
    x, box = place[:, 0], (-1.0,) * dimension + (1.0,) * dimension
    still = Displacement(box=box, x=0.0, y=0.0, z=0.0 if dimension == 3 else None)
    ends = [Concentration(nodes=ids(np.abs(x - at) < H), value=T) for at, T in ((0, HOT), (CELLS * H, COLD))]
    settings = Settings(
        physics="thermoelastic", material=STEEL, horizon=Horizon(ratio),
        medium=Medium(D=2.0, broken=share, surface_correction=corrected),
        conditions=(InitialConcentration(box=box, value=COLD), *ends, still), run=Run(**run),  # type: ignore[arg-type]
    )  # fmt: skip
    found = prepare(Model(grid(place, H), settings), ONE)
    source, target = found.system.operator.bonds()
    across = (x[source] > CELLS * H / 2) != (x[target] > CELLS * H / 2)
    found.system.operator.restore(
        found.system.operator.checkpoint_arrays(),
        Broken(np.ones(across.sum(), np.int64), source[across], target[across]),
    )
    return found


def along(found: PreparedRun) -> NDArray[np.float64]:
    """The mean temperatures (CELLS,) across a strip."""
    return np.asarray(found.system.coupled_runs[0].state.value[:, 0].reshape(-1, CELLS).mean(axis=0))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("share", [0.5, 0.01])
def test_a_crack_is_a_resistance_in_a_row(dimension: int, share: float) -> None:
    """With bonds to the next nodes alone: of CELLS - 1 equal resistances one is 1 / share times as large."""
    found = strip(share, dimension, 1.0, corrected=False, solver="static", time_step=10.0, steps=3)
    found.advance(1, 4)
    T = along(found)
    drop = (HOT - COLD) / (CELLS - 2 + 1 / share)
    steps = np.full(CELLS - 1, drop)
    steps[CELLS // 2 - 1] = drop / share
    assert np.abs(-np.diff(T) - steps).max() < 1e-6 * (HOT - COLD)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("solver", ["static", "explicit"])
def test_a_crack_that_conducts_nothing_keeps_one_half_cold(dimension: int, solver: str) -> None:
    steps = {"time_step": 10.0, "steps": 1} if solver == "static" else {"steps": 200}
    found = strip(0.0, dimension, 3.0, solver=solver, **steps)
    found.advance(1, 1 + int(steps["steps"]))
    T = along(found)
    assert np.abs(T[CELLS // 2 :] - COLD).max() < 1e-5  # K, round-off of long steps
    assert (T[1 : CELLS // 2] > COLD + 1).all()
    whole = strip(1.0, dimension, 3.0, solver=solver, **steps)
    whole.advance(1, 1 + int(steps["steps"]))
    assert along(whole)[CELLS // 2] > COLD + 1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*energy balance error")
def test_a_stopped_run_that_breaks_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    """The bonds that broke before the stop conduct less after it."""
    found = strip(1.0, 2, 3.0, solver="static", time_step=1e-6, steps=9).system.requested_model
    x = found.grid.position[:, 0]
    held = tuple(Displacement(nodes=ids(at), x=0.0, y=0.0) for at in (x < 2 * H, x > (CELLS - 2) * H))
    settings = msgspec.structs.replace(
        found.settings, conditions=(*found.settings.conditions[:3], *held), medium=Medium(D=2.0, broken=0.1),
        material=msgspec.structs.replace(STEEL, G0=1.0, T0=COLD + 50),
        run=Run(solver="static", time_step=1e-6, steps=9, every=3),
    )  # fmt: skip
    model, whole, path = Model(found.grid, settings), tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    simulate(model, whole, ONE).close()
    simulate(model, path, ONE, watch=lambda progress: progress.step >= 5).close()
    with resume(path, 1) as results:
        steps = results.breaks().step
    assert (steps < 5).any()
    assert contents(path) == contents(whole)
    settings = msgspec.structs.replace(settings, medium=Medium(D=2.0))
    simulate(Model(found.grid, settings), path := tmp_path / "alike.sqlite", ONE).close()
    assert contents(path) != contents(whole)


def test_a_share_beyond_its_bounds_is_refused() -> None:
    for share in (-0.1, 1.1, "none"):
        with pytest.raises(SceneError, match=naming("broken", expected="0 to 1")):
            Heat(1.0, 1.0, share)  # type: ignore[arg-type]


def test_diffusion_alone_has_no_bonds_that_break() -> None:
    model = strip(1.0, 2, 3.0).system.requested_model
    settings = msgspec.structs.replace(
        model.settings, physics="diffusion", material=None, conditions=model.settings.conditions[:3],
        medium=Medium(D=2.0, broken=0.5),
    )  # fmt: skip
    with pytest.raises(ModelError, match=naming("medium.broken", found="0.5", expected="1")):
        prepare(Model(model.grid, settings), ONE)
