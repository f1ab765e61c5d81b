"""J2: a beam of steel bent beyond where it flows, beside fibres of the classical beam; and runs that go on."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from whole import contents

from pdmesh.model.document import Displacement, Run, Static
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import books
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume, simulate
from pdsolve.steppers.static_loads import in_load_steps

STEEL = msgspec.structs.replace(
    GLASS, E=200e9, nu=0.3, plane="strain", model="correspondence", solid="j2", failure="none", yield_stress=250e6
)
FIRST = 2.559575e-3  # 1/m: where an edge of a beam 1 m high begins to flow
MOMENT = 46.8787e6  # N: there


def moments(layers: int, most: int) -> tuple[list[float], float]:
    """Those of the stresses in the middle of a beam of 3 x 1 m over the first at which it flows, at 1 to `most` times
    the first bend, each in four load steps; and what of the work is not booked."""
    delta, material = 1 / layers, msgspec.structs.replace(STEEL, control_factor=0.1)
    grid = square_grid(3 * layers, layers, delta, x0=delta / 2 - 1.5, y0=delta / 2 - 0.5)
    grid = dataclasses.replace(grid, areas=np.full(len(grid), delta**2))
    x, y = grid.position.T
    ends, middle = np.flatnonzero(np.abs(x) > 1.5 - 3 * delta), np.abs(x) < delta
    profile = ((0.0, 0.0), (float(most), float(most)))
    bends = [Displacement(nodes=(i + 1,), x=float(FIRST * x[i] * y[i]), profile=profile) for i in ends.tolist()]
    still = Displacement(nodes=(int(np.hypot(x, y).argmin()) + 1,), y=0.0)
    run = Run(solver="static", static=Static(load_steps=4 * most), steps=4 * most)
    model = plate(grid, 3, material=material, conditions=(*bends, still), run=run)
    system, state = prepare(in_load_steps(model, "float64"), Options(threads=1))
    found: list[float] = []
    for step in range(1, 4 * most + 1):
        system.stepper.march(state, step, step + 1)
        if step % 4 == 0:
            stress = system.operator.fields(state)["sxx"]
            found.append(float((stress * y)[middle].sum() * delta / 2 / MOMENT))
    return found, books(system, state, 4 * most).balance(0.0)


@pytest.mark.slow
def test_a_coarse_beam_flows_as_an_independent_one() -> None:
    """The half of a load step is a step of the flow here, so that not all digits are the same."""
    found, missing = moments(10, 2)
    assert found == pytest.approx([0.9495, 1.4058], rel=5e-3)
    assert abs(missing) <= 1e-3


@pytest.mark.slow
def test_a_beam_flows_as_its_fibres_do() -> None:
    """Twenty spacings high; independent: 0.9871 1.3935 1.4768 1.5089."""
    found, missing = moments(20, 4)
    fibres = [1.0, 1.3930, 1.4733, 1.5022]
    assert found[0] == pytest.approx(fibres[0], rel=0.02)
    assert found[1:] == pytest.approx(fibres[1:], rel=5e-3)
    assert abs(missing) <= 1e-3


def bar(solid: dict[str, object], static: bool) -> Model:
    """A short bar of steel pulled beyond where it flows, at rest or fast."""
    pull = Displacement(box=(18.9e-3, -1.0, 1.0, 1.0), x=2e-4, y=0.0, profile=((0.0, 0.0), (6e-6, 1.0)))
    fixed = Displacement(box=(-1.0, -1.0, 0.1e-3, 1.0), x=0.0, y=0.0)
    run = Run(time_step=1e-7, steps=60, every=20, ledger=10)
    if static:
        run = Run(solver="static", static=Static(load_steps=4))
    material = msgspec.structs.replace(STEEL, **solid)
    return plate(square_grid(20, 7), 3, material=material, conditions=(fixed, pull), run=run)


@pytest.mark.slow
@pytest.mark.parametrize("static", [False, True], ids=["marching", "at rest"])
@pytest.mark.parametrize("solid", [{}, {"form": "rate", "hardening": 1e9}], ids=["total", "rate"])
def test_a_run_that_goes_on_flows_to_the_same_bits(
    solid: dict[str, object], static: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted after nodes have begun to flow; all tables are those of a run left alone."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    model, stop = bar(solid, static), 2 if static else 37
    whole, stopped = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    simulate(model, whole, Options(threads=1)).close()
    with simulate(model, stopped, Options(threads=1), watch=lambda progress: progress.step == stop) as results:
        assert results.meta()["status"] == "interrupted"
        assert results.checkpoint()[1]["history"].reshape(20 * 7, -1)[:, -1].max() > 0  # alpha
    with resume(stopped, 1) as results:
        assert results.field("plastic", int(results.frames()[0][-1])).max() > 1e-3
    assert contents(stopped) == contents(whole)
