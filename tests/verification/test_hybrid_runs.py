"""Runs whose fine zone moves, beside the same plates solved on the fine lattice everywhere."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate
from zoned_plates import STEEL, again, rectangle, struck

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, InitialVelocity, Load, Run
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.conditions import initial_velocity
from pdsolve.model import Model
from pdsolve.numerics.thread_team import cores
from pdsolve.options import Options
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun, create_system_if_zone_changed
from pdsolve.zone.cells import COARSE, FINE


def pulled(adapt: str) -> Model:
    """A cracked plate of glass, 0.5 mm between nodes, pulled by its edges and held at one corner's row."""
    grid = rectangle(80, 48, 5e-4, [(0, 23.5, 40.5, 23.5)])
    loads = [
        Load(box=(-1.0, y - 1.2e-3, 1.0, y + 1.2e-3), traction=(0.0, s), rows=3) for y, s in ((0.024, 1.0), (0.0, -1.0))
    ]
    loads = [msgspec.structs.replace(load, traction=(0.0, 14e6 * load.traction[1]), length=0.04) for load in loads]
    held = Displacement(box=(0.04 - 1e-5, -1.0, 1.0, 1.0), x=0.0)
    return plate(grid, 4, conditions=(*loads, held), run=Run(steps=260, every=65, adapt=adapt))


def hybrid(problem: PreparedRun) -> HybridEngine:
    """The operator of a hybrid run."""
    found = problem.system.moving_zone_operator
    assert found is not None
    return found.engine


def followed(problem: PreparedRun) -> PreparedRun:
    """The nodes there are now."""
    change = create_system_if_zone_changed(problem.system) if problem.system.moving_zone_operator is not None else None
    return problem if change is None else PreparedRun(change.system, change.state)


def ledger(problem: PreparedRun, step: int) -> EnergyBalanceRow:
    """The books of the nodes there are now."""
    return compute_energy_balance_row(*followed(problem), step)


@pytest.mark.slow
def test_fine_everywhere_it_is_the_uniform_plate() -> None:
    """With all cells fine: the accelerations of the uniform run, corrected surfaces and faces included."""
    one, other = prepare(struck("hybrid"), Options()), prepare(struck("none"), Options(threads=1))
    run = hybrid(one)
    run.zone.cell_kinds[run.zone.cell_kinds == COARSE] = FINE
    again(run)
    change = create_system_if_zone_changed(one.system)
    assert change is not None
    system, nodes = change.system, change.system.moving_zone_operator
    assert nodes is not None
    rough = 1e-6 * np.random.default_rng(3).standard_normal((len(other.state.value), 2))
    run.zone.fine.u[0][:, run.plate.fine_places] = rough.T
    run.compute_initial_forces()
    other.state.value[:] = rough
    out = np.zeros_like(rough)
    other.system.operator.accumulate_force(other.state, out, 1, 0.0)
    state = change.state
    nodes.copy_to_state(state)
    held, _ = nodes.energies(state)
    back = np.argsort(nodes.grid_rows)
    assert system.model.grid.ids[back].tolist() == other.system.model.grid.ids.tolist()
    assert one.system.stable_time_step == pytest.approx(other.system.stable_time_step, rel=1e-9)
    assert state.value[back] == pytest.approx(rough, rel=1e-15)
    free = np.ones_like(out, dtype=bool)
    free[other.system.drive.holds.node, other.system.drive.holds.axis] = False
    limit = 1e-11 * np.abs(out).max()  # measured 7e-13
    assert np.abs(state.second[back] * STEEL.rho - out)[free].max() < limit
    assert held[back] == pytest.approx(other.system.operator.energies(other.state)[0], rel=1e-9)
    assert system.family_sizes[back].tolist() == other.system.family_sizes.tolist()
    assert system.initial_bond_counts[back].tolist() == other.system.initial_bond_counts.tolist()


@pytest.mark.slow
@pytest.mark.parametrize("law", ["brittle", "bilinear", "cohesive"])
def test_fine_everywhere_a_cut_costs_what_it_does_in_the_uniform_plate(law: str) -> None:
    """Half of a plate leaves the other half at 20 m/s: bonds take some steps to break, and match their work alike."""
    glass = msgspec.structs.replace(
        GLASS, law=law, kr=2.0 if law == "bilinear" else 1.0, f_t=8e7 if law == "cohesive" else None
    )
    leaves = InitialVelocity(box=(-1.0, -1.0, 0.0101, 1.0), x=-20.0)
    grid, settings = rectangle(20, 12, 1e-3), {"material": glass, "conditions": (leaves,)}
    models = [
        plate(grid, 4, **settings, run=Run(time_step=4e-8, steps=300, adapt=adapt)) for adapt in ("hybrid", "none")
    ]
    one, other = (prepare(model, Options(threads=1)) for model in models)
    run = hybrid(one)
    run.zone.cell_kinds[run.zone.cell_kinds == COARSE] = FINE
    run.initialize_motion_and_forces(initial_velocity(models[0]))
    for problem in (one, other):
        problem.advance(1, 301)
    fine, uniform = ledger(one, 300), ledger(other, 300)
    assert uniform.broken > 100
    rate = other.state.rate
    assert (
        np.abs(run.zone.fine.v[:, run.plate.fine_places].T - rate).max() < 1e-11 * np.abs(rate).max()
    )  # measured 7e-14
    assert fine.dissipated == pytest.approx(uniform.dissipated, rel=1e-9)


@pytest.mark.slow
def test_a_struck_plate_breaks_as_the_uniform_one() -> None:
    """Its first bond within a step, energies within a few per cent, both halves alike; no bond heals."""
    found, first = {}, {}
    for adapt in ("none", "hybrid"):
        problem = prepare(struck(adapt), Options(threads=1))
        seen = None
        for step in range(1, 171, 10):
            problem.advance(step, step + 10)
            if adapt == "hybrid":
                lost = hybrid(problem).zone.broken_bond_bits.copy()
                assert seen is None or not (seen & ~lost).any()
                seen = lost
        system, state = followed(problem)
        found[adapt], broken = compute_energy_balance_row(system, state, 170), system.operator.broken()
        first[adapt] = int(broken.step.min())
        y = np.sort(system.model.grid.position[broken.source, 1])
        assert np.abs(y + y[::-1] - 0.2).max() < 1e-12
    told = hybrid(problem).zone_summary()
    assert abs(first["hybrid"] - first["none"]) <= 1  # 42, 43
    assert found["hybrid"].work == pytest.approx(found["none"].work, rel=0.04)
    assert found["hybrid"].dissipated == pytest.approx(found["none"].dissipated, rel=0.1)
    assert abs(found["hybrid"].balance_error(system.initial_energy)) < 0.01
    assert 0 < told.clipped_stretch < 1
    assert told.fine_share < 0.8
    assert abs(told.refinement) < 0.005 * found["hybrid"].work


@pytest.mark.slow
def test_a_pulled_plate_cracks_as_the_uniform_one() -> None:
    """Loads on strips and a held edge, handed to fine and coarse nodes alike."""
    found = {}
    for adapt in ("none", "hybrid"):
        problem = prepare(pulled(adapt), Options(threads=1))
        problem.advance(1, 101)
        early = ledger(problem, 100)
        problem.advance(101, 261)
        found[adapt] = early, ledger(problem, 260), int(problem.system.operator.broken().step.min())
    for one, other in zip(found["hybrid"][:2], found["none"][:2], strict=True):
        assert one.work == pytest.approx(other.work, rel=0.02)
    assert found["hybrid"][0].momentum_x == pytest.approx(found["none"][0].momentum_x, rel=0.1)  # 0.067
    assert found["hybrid"][2] == found["none"][2]
    assert (
        hybrid(problem).zone_summary().clipped_stretch < 0.7
    )  # 0.58; 1.01 if faces were to follow the next coarse node alone


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.skipif(cores() < 2, reason="one core")
@pytest.mark.parametrize("law", ["brittle", "bilinear", "cohesive"])
def test_threads_do_not_show(law: str) -> None:
    """A zone that moves, bonds that break and soften, held nodes: one thread and two come to the same bits."""
    found = []
    for threads in (1, 2):
        problem = prepare(struck("hybrid", law=law), Options(threads=threads))
        problem.advance(1, 101)
        problem.advance(101, 151)
        found.append(hybrid(problem).checkpoint_arrays())
    assert len(found[0]["break_step"]) > 100
    assert found[0].keys() == found[1].keys()
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name]), name
