"""Softening bonds followed along their equilibrium path: a notched beam, a bar, and what a path must keep."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import naming
from numpy.typing import NDArray
from plates import plate, square_grid
from softening_bars import PETERSSONS as CONCRETE
from softening_bars import beam

from pdmesh.model.document import Spring
from pdsolve.estimate import estimate_run
from pdsolve.laws import law_of
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.softening_bonds import SofteningBonds
from pdsolve.rest.continuation import SofteningPathSteps
from pdsolve.results import Results, ResultsError
from pdsolve.run.initial_states import results_file_of_motion_after_equilibrium_path
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.schemes import SCHEMES

ONE = Options(threads=1)
RAMP = ((0.0, 0.0), (1.0, 1.0))
WIDTH = 0.05  # m
BED, BED_LENGTH = 4e9, 0.02  # N/m^3, m


def force(results: Results) -> NDArray[np.float64]:
    """The load of a beam at each step, N."""
    table = results.reactions()
    return np.abs(table["force_y"][table["condition"] == 2]) * WIDTH


def summary(results: Results) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(results.meta()["summary"])
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("h", "off"), [(0.02, 0.035), pytest.param(0.01, 0.02, marks=pytest.mark.slow)])
def test_a_notched_beam_peaks_as_is_known(h: float, off: float) -> None:
    """By an independent program with true Poisson's ratio: 798 N at both spacings; its tail at the same deflection is
    not known."""
    with simulate(beam(h), None, ONE) as results:
        found, said = force(results), summary(results)
    assert found.max() == pytest.approx(798, rel=off)  # measured: 776, 806
    assert found[-1] < 0.05 * found.max()
    assert abs(said["balance"]) < 1e-3  # measured: 2e-4
    plan = estimate_run(beam(h), ONE)
    assert (plan.steps_are_load_steps, plan.steps_are_path_steps) == (True, True)
    assert 0.5 < plan.steps / said["steps"] < 2  # measured: 1.5


@pytest.mark.slow
def test_bonds_that_pass_the_end_of_a_notch_decide_on_the_peak() -> None:
    """The known peak, 798 N, is between those with these bonds cut, as above, and whole."""
    cut = beam(0.02)
    shorter = dataclasses.replace(cut.grid, cracks=np.array([[0, -0.01, 0, 0.1 - 1e-5]]))
    with simulate(Model(shorter, cut.settings), None, ONE) as results:
        assert force(results).max() == pytest.approx(887, rel=0.01)  # measured: 886.6


@pytest.mark.slow
def test_dead_loads_are_followed_past_their_largest() -> None:
    """The same path as under a prescribed displacement, which falls to nothing."""
    with pytest.warns(ModelWarning, match="0.77"), simulate(beam(0.02, "load"), None, ONE) as results:
        found, said = force(results), summary(results)
    with simulate(beam(0.02), None, ONE) as results:
        assert found.max() == pytest.approx(force(results).max(), rel=3e-3)  # measured: 5e-4
    assert found[-1] < 0.01 * found.max()
    assert abs(said["balance"]) < 1e-3  # measured: 4e-4


@pytest.mark.slow
def test_a_path_that_goes_on_is_the_same_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    whole, stopped = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    model = beam(0.02, load_steps=20)
    simulate(model, whole, ONE).close()
    with simulate(model, stopped, ONE, watch=lambda progress: progress.step == 6) as results:
        assert results.meta()["status"] == "interrupted"
        assert len(results.checkpoint()[1]["worst"]) > 0
    resume(stopped, 1).close()
    assert contents(stopped) == contents(whole)


def test_forces_tangent_and_dissipation_belong_together() -> None:
    """By finite differences, in a random state where some bonds load, some unload and some are gone."""
    model = plate(square_grid(9, 8, 0.01), 3, material=CONCRETE)
    bonds = SofteningBonds(law_of(model), SCHEMES["conservative"].fill(model).whole())
    random = np.random.default_rng(5)
    bonds.kappa[::3] = 3 * bonds.peak[::3]
    bonds.kappa[5::50] = bonds.limit[5::50]
    value, way = 2e-6 * random.standard_normal((2, 72, 2))
    found = bonds.respond(value)
    assert 50 < (found.releases > 0).sum() < 500
    size = 1e-5
    low, high = (bonds.respond(value + sign * size * way) for sign in (-1, 1))
    slope = (bonds.forces(high) - bonds.forces(low)) / (2 * size)
    predicted = -(bonds.tangent(found) @ way.ravel()).reshape(slope.shape)
    assert np.abs(slope - predicted).max() < 1e-5 * np.abs(slope).max()
    rate = (high.dissipated_energy - low.dissipated_energy) / (2 * size)
    assert float((bonds.gradient(found) * way).sum()) == pytest.approx(rate, rel=1e-5)


@pytest.mark.slow
def test_neither_the_order_of_nodes_nor_threads_matter() -> None:
    model = beam(0.02, load_steps=20)
    order = np.random.default_rng(3).permutation(len(model.grid))
    names = ("ids", "position", "delta", "border", "hole_id")
    grid = dataclasses.replace(model.grid, **{name: getattr(model.grid, name)[order] for name in names})
    found = []
    for one, threads in ((model, 1), (Model(grid, model.settings), 1), (model, 2)):
        with simulate(one, None, Options(threads=threads)) as results:
            found.append(force(results))
    assert len(found[0]) == len(found[1])
    assert (found[2] == found[0]).all()
    assert np.abs(found[0] - found[1]).max() < 1e-9 * found[0].max()  # measured: 2e-13


def under_dead_loads(after: str, duration: float | None = None) -> Model:
    """A coarse notched beam under a dead load."""
    model = beam(0.02, "load", 20)
    run = msgspec.structs.replace(model.settings.run, after=after, duration=duration)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))


@pytest.mark.slow
def test_a_body_moves_once_it_does_not_bear_its_dead_loads(tmp_path: Path) -> None:
    """From rest, with all that the path spent in its ledger, to a beam that breaks; stopped and resumed at any time."""
    model, path = under_dead_loads("motion", 0.02), tmp_path / "beam.sqlite"
    with pytest.warns(ModelWarning, match="motion begins"):
        ran = simulate(model, path, ONE)
    with ran as results:
        found, taken, whole = (
            results.history(),
            results.breaks(),
            contents(results_file_of_motion_after_equilibrium_path(path)),
        )
        assert results.name == str(results_file_of_motion_after_equilibrium_path(path))
        assert abs(summary(results)["balance"]) < 1e-4  # measured: 1.2e-5
    with Results.open(path) as results:
        last, most = results.history()[-1], summary(results)["lost"]
        assert most == pytest.approx(0.77, abs=0.01)
    for name in ("strain", "dissipated"):
        assert found[name][0] == pytest.approx(last[name], rel=1e-9)
    assert (found["step"][0], found["kinetic"][0]) == (last["step"], 0)
    assert found["kinetic"][-1] > found["strain"][-1]
    assert taken.step.min() > last["step"]
    results_file_of_motion_after_equilibrium_path(path).unlink()
    results_file_of_motion_after_equilibrium_path(path).symlink_to(tmp_path / "nothing")
    with pytest.raises(ResultsError, match=naming("beam_motion.sqlite", found="a link")):
        resume(path, 1)
    results_file_of_motion_after_equilibrium_path(path).unlink()
    results_file_of_motion_after_equilibrium_path(path).write_bytes(
        b""
    )  # as of a motion that was killed before its first frame
    stops = iter([False] * 3 + [True])
    resume(path, 1, lambda now: next(stops, True)).close()  # the motion begins, and is stopped
    with Results.open(results_file_of_motion_after_equilibrium_path(path)) as results:
        assert results.meta()["status"] == "interrupted"
    resume(path, 1).close()
    assert contents(results_file_of_motion_after_equilibrium_path(path)) == whole


@pytest.mark.slow
def test_a_path_under_dead_loads_may_end_past_the_largest() -> None:
    with pytest.warns(ModelWarning, match="ends here"), simulate(under_dead_loads("stop"), None, ONE) as results:
        found = [one["pull"] for one in summary(results)["path_steps"]]
    assert 0.5 < abs(found[-1]) / max(map(abs, found)) < 0.98


def on_beds(law: dict[str, Any]) -> Model:
    """A notched beam on one node at its left and on a bed at its right, pushed down in its middle."""
    model = beam(0.02)
    material, (left, right, middle) = model.settings.material, model.settings.conditions
    assert material is not None
    bed = Spring(nodes=right.nodes, stiffness=(0.0, BED), length=BED_LENGTH)
    settings = msgspec.structs.replace(
        model.settings, conditions=(left, bed, middle), material=msgspec.structs.replace(material, **law)
    )
    return dataclasses.replace(model, settings=settings)


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"model": "micropolar", "nu": 0.2}], ids=["springs", "shear"])
def test_a_beam_on_an_elastic_bed_sinks_by_its_force_over_it(law: dict[str, Any]) -> None:
    """Its share of the load is that of the arms, before and after the peak; the bed's energy is in the books."""
    model = on_beds(law)
    left, right, middle = (model.grid.position[model.selected(one), 0].mean() for one in model.settings.conditions)
    with simulate(model, None, ONE) as results:
        table, said = results.reactions(), summary(results)
    bed, load = (table[table["condition"] == number] for number in (1, 2))
    push, share = np.abs(load["force_y"]), (middle - left) / (right - left)
    assert push[-1] < 0.1 * push.max()  # measured: 0.03 and 0.05
    assert np.abs(bed["force_y"] - share * push).max() < 1e-4 * push.max()  # measured: 5e-6
    assert np.abs(bed["displacement_y"] + bed["force_y"] / (BED * BED_LENGTH)).max() < 1e-12 * WIDTH
    assert abs(said["balance"]) < 1e-3  # measured: 1.4e-4 and 2.3e-4


@pytest.mark.slow
def test_progress_says_how_long_a_path_still_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the share of its crack, or of its loads."""
    seconds = iter(range(0, 1000, 10))
    monkeypatch.setattr("pdsolve.rest.path.clock.monotonic", lambda: next(seconds))
    prepared = prepare(beam(0.02, load_steps=20), ONE)
    stepper = prepared.system.stepper
    assert isinstance(stepper, SofteningPathSteps)
    assert stepper.progress_text() == "elastic"
    prepared.advance(1, 5)
    done = max(stepper.step_results[-1].dissipated_energy / (CONCRETE.G0 * 0.2), stepper.load_factor)
    assert 0.01 < done < 0.3
    assert f"about {10 * (1 - done) / done:.0f} s left" in stepper.progress_text()
