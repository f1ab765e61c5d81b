"""J2: a beam of steel bent beyond where it flows, beside fibres of the classical beam; and runs that go on."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import mentions, naming
from plates import GLASS, plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, Load, Run, Static
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.rest.equilibrium import NotConvergedError, force_densities
from pdsolve.rest.static_loads import model_with_load_steps
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume, simulate
from pdsolve.run.system import PreparedRun

STEEL = msgspec.structs.replace(
    GLASS, E=200e9, nu=0.3, plane="strain", model="correspondence", solid="j2", failure="none", yield_stress=250e6
)
FIRST = 2.559575e-3  # 1/m: where an edge of a beam 1 m high begins to flow
MOMENT = 46.8787e6  # N: there
NO_CRACK = np.empty((0, 4))


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
    system, state = prepare(model_with_load_steps(model), Options(threads=1))
    found: list[float] = []
    for step in range(1, 4 * most + 1):
        system.stepper.advance(state, step, step + 1)
        if step % 4 == 0:
            stress = system.operator.fields(state)["sxx"]
            found.append(float((stress * y)[middle].sum() * delta / 2 / MOMENT))
    return found, compute_energy_balance_row(system, state, 4 * most).balance_error(0.0)


@pytest.mark.slow
def test_a_coarse_beam_flows_as_its_fibres_do() -> None:
    """As stiff as an independent code, 0.9495; then as fibres, 1.3930, where elastic control has 1.4058."""
    found, missing = moments(10, 2)
    assert found == pytest.approx([0.9495, 1.3930], rel=5e-3)  # measured 0.9495, 1.3964
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


PERFECT = 2 * 250e6 / 3**0.5  # Pa, that flows in plane strain where one side is free: 2 k


def pulled_bar(strain: float, steps: int, **settings: object) -> tuple[float, float]:
    """The force on a bar of 31 x 11 nodes over that at which it flows, and what of the work of the last step, in which
    all of it flows, is not booked."""
    grid = square_grid(31, 11)
    x, y = grid.position.T
    left, right = (tuple((np.flatnonzero(some) + 1).tolist()) for some in (x < 2.5e-3, x > 27.5e-3))
    middle = (int(np.hypot(x, y - 5e-3).argmin()) + 1,)
    pull = Displacement(nodes=right, x=0.03 * strain, profile=((0.0, 0.0), (1.0, 1.0)))
    conditions = Displacement(nodes=left, x=0.0), Displacement(nodes=middle, y=0.0), pull
    run = Run(solver="static", static=Static(load_steps=steps), steps=steps)
    model = plate(grid, 3, material=msgspec.structs.replace(STEEL, **settings), conditions=conditions, run=run)
    system, state = prepare(model_with_load_steps(model), Options(threads=1))
    system.stepper.advance(state, 1, steps)
    before = compute_energy_balance_row(system, state, steps - 1)
    system.stepper.advance(state, steps, steps + 1)
    after = compute_energy_balance_row(system, state, steps)
    force = -force_densities(system.operator, state)[np.array(right) - 1, 0].sum() * 1e-6
    booked = after.strain + after.dissipated - before.strain - before.dissipated
    return float(force / (0.011 * PERFECT)), 1 - booked / (after.work - before.work)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("control", "strain"), [("silling", 0.02), ("silling", 0.05), ("wan", 0.02), ("none", 0.02)], ids=str
)
def test_a_bar_that_flows_is_as_strong_as_its_section(control: str, strain: float) -> None:
    """2 k H, whatever controls zero-energy modes. Elastic control: 1.156 and 1.531 (wan) at a strain of 2 %.

    Measured: 1.0069 and 1.0071, wan 1.0094, none 1.0000; what the last step does not book is 1e-3 at most.
    """
    force, missing = pulled_bar(strain, 2, control=control)
    assert force == pytest.approx(1, abs=0.01)
    assert abs(missing) <= 1e-3


def ring(shares: float, steps: int) -> tuple[PreparedRun, float]:
    """A ring of 604 nodes, twice as wide outside, under a pressure inside that grows to `shares` of its collapse."""
    spacing, inner = 1e-3, 8e-3
    x, y = (axis.ravel() * spacing for axis in np.meshgrid(*[np.arange(-16.5, 17)] * 2))
    r = np.hypot(x, y)
    x, y, r = (each[(r >= inner) & (r <= 2 * inner)] for each in (x, y, r))
    none = np.full(len(x), -1)
    grid = Grid(np.arange(len(x)) + 1, np.column_stack([x, y]), np.full(len(x), spacing), none >= 0, none, NO_CRACK)
    rim = np.flatnonzero(r < inner + spacing)
    pressure = shares * PERFECT * np.log(2)
    density = 2 * pressure * inner / (np.abs(y[rim] / r[rim]).sum() / 2 * spacing**2)  # of half the ring
    ramp = ((0.0, 0.0), (1.0, 1.0))
    pushes = tuple(
        Load(nodes=(i + 1,), body_force=(density * x[i] / r[i], density * y[i] / r[i]), profile=ramp)
        for i in rim.tolist()
    )
    ends = [int(np.hypot(x - at[0], y - at[1]).argmin()) + 1 for at in ((0.0, 0.016), (0.0, -0.016), (0.016, 0.0))]
    still = tuple(Displacement(nodes=(node,), **{axis: 0.0}) for node, axis in zip(ends, ("x", "x", "y"), strict=True))
    run = Run(solver="static", static=Static(load_steps=steps), steps=steps)
    model = plate(grid, 3, material=STEEL, conditions=(*pushes, *still), run=run)
    return prepare(model_with_load_steps(model), Options(threads=1)), inner


@pytest.mark.slow
def test_a_ring_flows_as_far_as_a_thick_tube_and_collapses_as_one() -> None:
    """Of its radii 1 and 2: p = 2 k (ln c + (1 - c^2 / 4) / 2), and 2 k ln 2 in the end.

    Measured: c = 1.4945 at 0.9 of the collapse (1.4987); collapse at 1.005 of 2 k ln 2.
    """
    (system, state), inner = ring(0.9, 3)
    system.stepper.advance(state, 1, 4)
    flowed = (system.operator.fields(state)["plastic"] > 0).sum() * 1e-6
    assert np.sqrt(1 + flowed / (np.pi * inner**2)) == pytest.approx(1.4987, rel=0.03)
    (system, state), _ = ring(1.1, 2)
    with pytest.raises(NotConvergedError, match=naming(found="limit load", expected="hardening")) as error:
        system.stepper.advance(state, 1, 3)
    assert "supports" not in str(error.value)
    share = float(re.search(r"above ([\d.]+) of this load step", str(error.value))[1])  # type: ignore[index]
    assert 0.97 <= 0.55 * (1 + share) <= 1.03


@pytest.mark.slow
@pytest.mark.parametrize(("form", "stretched"), [("total", 0.08), ("total", 0.15), ("rate", 0.15)])
def test_plastic_strains_that_are_not_small_are_warned_of(form: str, stretched: float) -> None:
    """Once, above 10 % of plastic strain in the form for small ones."""
    pull = Displacement(box=(18.9e-3, -1.0, 1.0, 1.0), x=19e-3 * stretched, profile=((0.0, 0.0), (1.0, 1.0)))
    fixed = Displacement(box=(-1.0, -1.0, 0.1e-3, 1.0), x=0.0, y=0.0)
    run = Run(solver="static", static=Static(load_steps=8), steps=8)
    material = msgspec.structs.replace(STEEL, form=form, control="none", hardening=20e9)
    model = plate(square_grid(20, 7), 3, material=material, conditions=(fixed, pull), run=run)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulate(model, None, Options(threads=1)).close()
    said = [str(one.message) for one in caught if "plastic strain" in str(one.message)]
    assert len(said) == (form == "total" and stretched > 0.1)
    assert all(mentions(one, "0.1", "j2", "material.form = 'rate'") for one in said)
