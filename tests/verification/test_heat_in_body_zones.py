"""Bodies that heat and whose fine zone moves: no stress where none should be, and energies as with fine nodes
everywhere."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from database_contents import contents
from numpy.typing import NDArray

from pdmesh import Body, Box, Material, Medium, Run, build
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume, simulate
from pdsolve.run.swelling_with_fine_zone import SwellingStepperWithFineZone
from pdsolve.run.system import PreparedRun, create_system_if_zone_changed
from pdsolve.zone.cells import COARSE, FINE, lattice_coordinates

pytestmark = pytest.mark.slow  # kernels of bodies that swell take long to compile

E, ALPHA, T0, H = 70e9, 9e-6, 293.0, 5e-4
GLASS = Material(E=E, rho=2500.0, G0=8.0, alpha=ALPHA, T0=T0, micromodulus="constant")
LONG, WIDE, HIGH = 0.02, 0.008, 0.012  # m
ONE = Options(threads=1)


def notched(adapt: str = "hybrid", hot: float = 0.0, G0: float = 8.0, **run: object) -> Model:
    """A body with a crack from its left face, around whose edge it is fine; heated inside by `hot` K/s."""
    how = Run(adapt="hybrid", **run)  # type: ignore[arg-type]
    material = msgspec.structs.replace(GLASS, G0=G0)
    body = Body(Box((0, 0, 0), (LONG, WIDE, HIGH)), H, material, 3.0, how, medium=Medium(D=0.3))
    (x0, x1), (y0, y1), z = (-LONG, 0.003), (-WIDE, 2 * WIDE), HIGH / 2 + H / 2
    corners = (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)
    body = body.crack([[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]])
    if hot:
        body = body.supply(Box((0.006, 0.0, 0.003), (0.016, WIDE, 0.009)), rate=hot)
    built = build(body)
    settings = msgspec.structs.replace(built.settings, run=msgspec.structs.replace(built.settings.run, adapt=adapt))
    return Model(built.grid, settings)


@pytest.fixture(scope="module")
def body() -> PreparedRun:
    """That at rest."""
    return prepare(notched(), ONE)


def pulled(body: PreparedRun, T: NDArray[np.float64] | float, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force densities (n, 3), N/m^3, at temperatures of all nodes of the grid above T0 and displacements (n, 3)."""
    stepper, found = body.system.stepper, np.zeros_like(u)
    assert isinstance(stepper, SwellingStepperWithFineZone)
    body.system.coupled_runs[0].state.value[:, 0] = T0 + T
    stepper.swell()
    body.state.value[:] = u
    body.system.operator.accumulate_force(body.state, found, 1, 0.0)
    return found


def bent(x: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 3) of a free body with linear temperatures above T0."""
    return ALPHA * (x * (x @ slope)[:, None] - (x**2).sum(axis=1)[:, None] * slope / 2)


def test_a_free_body_that_is_hotter_everywhere_is_free_of_stress(body: PreparedRun) -> None:
    """Fine and coarse nodes and the border between them; held, it has 3 E (alpha dT)^2 / 2 / (1 - 2 nu)."""
    position, hotter = body.system.model.grid.position, 100.0
    held = pulled(body, hotter, np.zeros_like(position))
    energy = body.system.operator.energies(body.state)[0]
    assert len(position) < 0.7 * len(notched().grid)
    middle = np.argmin(np.linalg.norm(position - [0.8 * LONG, WIDE / 2, HIGH / 2], axis=1))
    assert energy[middle] == pytest.approx(3 * E * (ALPHA * hotter) ** 2, rel=0.03)
    total = float((body.system.area * energy).sum())
    assert body.system.moving_zone_operator.engine.strain_energy() == pytest.approx(total, rel=1e-11)  # type: ignore[union-attr]
    free = pulled(body, hotter, ALPHA * hotter * position)
    assert np.abs(free).max() < 1e-12 * np.abs(held).max()


@pytest.mark.parametrize("slope", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.7, -0.4, 0.5)])
def test_linear_temperatures_make_no_stress(body: PreparedRun, slope: tuple[float, float, float]) -> None:
    """In terms of the forces of stresses that change by E alpha times as much a metre: nothing but finite rotations."""
    along = np.array(slope)
    free = pulled(body, notched().grid.position @ along, bent(body.system.model.grid.position, along))
    assert np.abs(free).max() < 1e-4 * E * ALPHA * np.linalg.norm(along)


def test_a_cell_that_becomes_fine_has_its_temperature_at_once() -> None:
    """New nodes of a free body with linear temperatures feel no force, and refining makes no energy."""
    body, slope = prepare(notched(), ONE), np.array([0.7, -0.4, 0.5])
    operator = body.system.moving_zone_operator
    assert operator is not None
    free = pulled(body, notched().grid.position @ slope, bent(body.system.model.grid.position, slope))
    engine, numbering = operator.engine, operator.engine.full_body.fine_lattice.numbering.cells  # type: ignore[union-attr]
    x = lattice_coordinates(numbering, np.arange(numbering.place_count))[0]
    new = np.flatnonzero((engine.cell_kinds == COARSE) & (x > 10))  # type: ignore[union-attr]
    engine.cell_kinds[new] = FINE  # type: ignore[union-attr]
    engine.refine_cells(new)  # type: ignore[union-attr]
    change = create_system_if_zone_changed(body.system)
    assert change is not None
    assert len(change.state.value) > len(free) + 500
    force = np.zeros_like(change.state.value)
    change.system.operator.accumulate_force(change.state, force, 1, 0.0)
    assert np.abs(force).max() < 1e-4 * E * ALPHA * np.linalg.norm(slope)
    held = float((change.system.area * change.system.stepper.energy_density_at_zero_displacement(change.state)).sum())  # type: ignore[attr-defined]
    assert abs(engine.refinement_energy) < 1e-9 * held  # type: ignore[union-attr]


def test_a_body_that_heats_swells_as_the_uniform_one() -> None:
    """Energies, work and displacements, of a heated box whose edges coarse cells smooth."""
    found = {}
    for adapt in ("none", "hybrid"):
        with simulate(notched(adapt, 1e7, 1e6, duration=6e-6, every=1000, ledger=10), None, ONE) as results:
            last, history = int(results.frames()[0][-1]), results.history()[-1]
            ids = results.nodes(last).ids.tolist()
            ux = dict(zip(ids, results.field("ux", last).tolist(), strict=True))
            found[adapt] = ux, history, results.summary()
    (ux, history, _), (ux2, history2, summary) = found["none"], found["hybrid"]
    assert len(ux2) < 0.7 * len(ux)
    assert history2["work"] == pytest.approx(history["work"], rel=0.05)  # measured 3.7 %
    assert history2["kinetic"] == pytest.approx(history["kinetic"], rel=0.08)  # 5.9 %
    assert abs(summary["balance"]) < 0.001  # measured 9e-5; 1.2e-4 of the uniform one
    here = np.array([ux[name] for name in ux2])
    assert np.abs(here - list(ux2.values())).max() < 0.1 * np.abs(here).max()  # measured 6.9 %


def test_a_stopped_run_goes_on_to_the_same_bits(tmp_path) -> None:  # type: ignore[no-untyped-def]
    model = notched("hybrid", 5e6, duration=4e-6, every=20, ledger=10)
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    simulate(model, whole, ONE).close()
    simulate(model, path, ONE, watch=lambda progress: progress.step >= 20).close()
    resume(path, 1).close()
    assert contents(path) == contents(whole)
