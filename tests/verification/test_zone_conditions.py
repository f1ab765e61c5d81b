"""Accelerations, spins and initial displacements of plates and bodies with a fine zone."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from benchmarks.balance_rows import compute_condition_forces, compute_energy_balance_row
from pdmesh import Body, Box, Material, Run, Scene, box, build
from pdmesh.model.document import (
    Acceleration,
    Displacement,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Spring,
    Velocity,
)
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.initial_states import apply_initial_displacements
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun, create_system_if_zone_changed
from pdsolve.zone.cells import COARSE, FINE, lattice_coordinates, place_number_at

H, G, RHO, DT = 1e-3, 9.81e4, 2235.0, 1e-7  # m, m/s^2, kg/m^3, s
LASTING = Material(E=65e9, rho=RHO, G0=1e9, micromodulus="constant")
DIMENSIONS = [2, 3]
pytestmark = pytest.mark.slow  # their kernels take a minute to compile
Conditions = tuple[Acceleration | Displacement | InitialDisplacement | InitialVelocity | Load | Spring | Velocity, ...]


def cracked(dimension: int, conditions: Conditions, adapt: str = "hybrid", steps: int = 40) -> Model:
    """A plate with a crack from its left edge, or a body with a crack through it, 40 x 24 (x 12) spacings; it lasts."""
    run, middle = Run(steps=steps, every=steps, ledger=steps, time_step=DT, adapt="hybrid"), 12.5 * H
    if dimension == 2:
        built = build(Scene(box(0, 0, 0.04, 0.024), H, LASTING, 3.0, run).crack([(0, middle), (0.012, middle)]))
    else:
        (x, y), z = (0.01, 0.024), (-0.01, 0.022)
        corners = (-x, middle, z[0]), (x, middle, z[0]), (x, middle, z[1]), (-x, middle, z[1])
        crack = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
        built = build(Body(Box((0, 0, 0), (0.04, y, 0.012)), H, LASTING, run=run).adapt("hybrid").crack(crack))
    run = msgspec.structs.replace(built.settings.run, adapt=adapt)
    return Model(built.grid, msgspec.structs.replace(built.settings, run=run, conditions=conditions))


def everywhere(dimension: int) -> tuple[float, ...]:
    """A box around all nodes."""
    return (*(-1.0,) * dimension, *(1.0,) * dimension)


def advanced(model: Model, steps: int) -> PreparedRun:
    """A run after so many steps, taken in two sequences, with the nodes it has then."""
    prepared = prepare(model, Options(threads=1))
    prepared.advance(1, 12)
    prepared.advance(12, steps + 1)
    return prepared


def balance_row(run: PreparedRun, step: int) -> EnergyBalanceRow:
    """The energies of a run."""
    return compute_energy_balance_row(run.system, run.state, step)


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("how", ["accelerations", "body force"])
def test_a_body_in_free_fall_stays_as_it_is(dimension: int, how: str) -> None:
    """From the first step on, coarse and fine nodes fall by g t^2 / 2, and work is kinetic energy."""
    where, down = everywhere(dimension), {"xyz"[dimension - 1]: -G}
    force = (*(0.0,) * (dimension - 1), -RHO * G)
    falls = Acceleration(box=where, **down) if how == "accelerations" else Load(box=where, body_force=force)
    steps, model = 40, cracked(dimension, (falls,))
    run = advanced(model, steps)
    assert len(run.state.value) < 0.8 * len(model.grid)
    time = steps * DT
    np.testing.assert_allclose(run.state.value[:, -1], -G * time**2 / 2, rtol=1e-10)
    np.testing.assert_allclose(run.state.rate[:, -1], -G * time, rtol=1e-10)
    np.testing.assert_allclose(run.state.second[:, -1], -G, rtol=1e-8)
    assert np.abs(run.state.value[:, :-1]).max() < 1e-10 * G * time**2
    row, mass = balance_row(run, steps), RHO * run.system.area.sum()
    assert row.kinetic == pytest.approx(mass * (G * time) ** 2 / 2, rel=1e-9)
    assert row.work == pytest.approx(row.kinetic, rel=1e-9)


RAMP = ((0.0, 0.0), (4e-6, 1.0))


def refine_at_left_side(operator: object, step: int) -> None:
    """Let cells beside the middle of the left side become fine after a step, of plates at the next look at them."""
    engine = operator.engine  # type: ignore[attr-defined]
    if isinstance(engine, HybridEngine):
        zone = engine.zone
        zone.damaged_nodes[0] = place_number_at(engine.plate.numbering.fine, (4, 4))
        zone.counts.damaged_nodes = 1
        return
    numbering = engine.full_body.fine_lattice.numbering.cells
    x, y, _ = lattice_coordinates(numbering, np.arange(numbering.place_count))
    new = np.flatnonzero((engine.cell_kinds == COARSE) & (x < 4) & (y < 6))
    engine.cell_kinds[new] = FINE
    engine.refine_cells(new)


@pytest.mark.parametrize("dimension", DIMENSIONS)
@pytest.mark.parametrize("kind", [Displacement, Velocity, Acceleration])
def test_a_side_may_be_moved_by_any_profile(dimension: int, kind: type[Displacement | Velocity | Acceleration]) -> None:
    """Work, momentum and the force of the grip are those of fine nodes everywhere, also once cells became fine there,
    which books no work."""
    size = {Displacement: 1e-6, Velocity: 1.0, Acceleration: 4e5}[kind]
    grip = kind(box=(*(-1.0,) * dimension, 2.1 * H, *(1.0,) * (dimension - 1)), x=-size, profile=RAMP)
    found = []
    for adapt in ("none", "hybrid"):
        run = prepare(cracked(dimension, (grip,), adapt), Options(threads=1))
        run.advance(1, 24)
        if adapt == "hybrid":
            refine_at_left_side(run.system.operator, 24)
        run.advance(24, 41)
        if adapt == "hybrid":
            before, change = len(run.state.value), create_system_if_zone_changed(run.system)
            assert change is not None
            run = PreparedRun(*change[:2])
            assert len(run.state.value) > before + 5
        row, (system, state) = balance_row(run, 40), run
        (force,) = compute_condition_forces(system, state, 40, 40 * DT)
        assert abs(row.balance_error(system.initial_energy)) < 0.01
        found.append((row.work, row.momentum_x, force.force_x))
    np.testing.assert_allclose(*found, rtol=0.02)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_body_spins_as_with_fine_nodes_everywhere(dimension: int) -> None:
    """By a fifth of a radian; its angular momentum stays."""
    spin, steps = 5e4, 40
    starts = InitialVelocity(box=everywhere(dimension), spin=spin if dimension == 2 else (0.0, 0.0, spin))
    turned = []
    for adapt in ("none", "hybrid"):
        run = prepare(cracked(dimension, (starts,), adapt), Options(threads=1))
        momenta = [angular_momentum(run)]
        run.advance(1, steps + 1)
        momenta.append(angular_momentum(run))
        assert momenta[1] == pytest.approx(momenta[0], rel=1e-6)  # measured 3e-7, of places that follow one node
        far = np.argmax(run.system.model.grid.position.sum(axis=1))
        turned.append(run.state.value[far])
    assert np.abs(turned[0]).max() > 0.2 * 0.012
    np.testing.assert_allclose(turned[1], turned[0], atol=1e-3 * np.abs(turned[0]).max())


def angular_momentum(run: PreparedRun) -> float:
    """About z, kg m^2/s; of a plate per thickness."""
    (system, state), mass = run, RHO * run.system.area
    x, v = system.model.grid.position + state.value, state.rate
    return float((mass * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum())


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_stretched_body_is_let_go(dimension: int) -> None:
    """It swings as with fine nodes everywhere, and begins with the energy of its strain."""
    start = InitialDisplacement(box=everywhere(dimension), x="1e-5*x")
    energies = []
    for adapt in ("none", "hybrid"):
        run = apply_initial_displacements(prepare(cracked(dimension, (start,), adapt), Options(threads=1)))
        run.advance(1, 41)
        row, begins = balance_row(run, 40), run.system.initial_energy
        assert row.kinetic > 0.1 * begins
        assert abs(row.kinetic + row.strain - begins) < 0.01 * begins
        energies.append((begins, row.kinetic))
    np.testing.assert_allclose(energies[1], energies[0], rtol=0.02)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_body_on_springs_everywhere_swings_as_one(dimension: int) -> None:
    """As a single mass does in these steps, with the force of its springs; also once cells became fine."""
    stiffness, speed, steps = 4e14, 2.0, 40
    start = InitialVelocity(box=everywhere(dimension), x=speed)
    bed = Spring(box=everywhere(dimension), body_stiffness=(stiffness, *(0.0,) * (dimension - 1)))
    model = cracked(dimension, (start, bed))
    run = prepare(model, Options(threads=1))
    run.advance(1, 24)
    refine_at_left_side(run.system.operator, 24)
    run.advance(24, steps + 1)
    change = create_system_if_zone_changed(run.system)
    assert change is not None
    system, state = change[:2]
    angle = 2 * np.arcsin(np.sqrt(stiffness / RHO) * DT / 2)
    swung = speed * DT / np.sin(angle) * np.sin(steps * angle)
    np.testing.assert_allclose(state.value[:, 0], swung, rtol=1e-9)
    row, volume = balance_row(PreparedRun(system, state), steps), system.area.sum()
    assert row.strain == pytest.approx(volume * stiffness * swung**2 / 2, rel=1e-9)
    (force,) = compute_condition_forces(system, state, steps, steps * DT)
    assert force.force_x == pytest.approx(-volume * stiffness * swung, rel=1e-9)
    assert abs(row.balance_error(system.initial_energy)) < 0.01


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_a_bed_below_carries_as_with_fine_nodes_everywhere(dimension: int) -> None:
    """A bed along one side, pressed by a load on the other: its force, the work, and the energy."""
    ones, low = (1.0,) * (dimension - 1), (-1.0,) * dimension
    bed = Spring(box=(*low, 2.1 * H, *ones), body_stiffness=(4e16, *(0.0,) * (dimension - 1)))
    load = Load(box=(0.0379, *low[1:], 1.0, *ones), body_force=(-1e10, *(0.0,) * (dimension - 1)))
    found = []
    for adapt in ("none", "hybrid"):
        run = prepare(cracked(dimension, (bed, load), adapt), Options(threads=1))
        run.advance(1, 121)
        system, state = run
        row = balance_row(run, 120)
        force, _ = compute_condition_forces(system, state, 120, 120 * DT)
        assert abs(row.balance_error(system.initial_energy)) < 0.01
        found.append((row.work, row.strain, force.force_x))
        if adapt == "hybrid":
            assert_tangent_is_that_of_forces(run)
    np.testing.assert_allclose(*found, rtol=0.03)


def assert_tangent_is_that_of_forces(run: PreparedRun) -> None:
    """At small displacements, along a random way."""
    (system, state), size = run, 1e-7 * H
    way, force = size * np.random.default_rng(1).standard_normal(state.value.shape), []
    for sign in (1.0, -1.0):
        force.append(np.zeros_like(way))
        state.value[:], state.rate[:] = sign * way, 0.0
        system.operator.accumulate_force(state, force[-1], 0, 0.0)
    state.value[:] = 0.0
    expected = -(system.operator.tangent(state) @ way.ravel()).reshape(way.shape)
    np.testing.assert_allclose((force[0] - force[1]) / 2, expected, atol=1e-5 * np.abs(expected).max())
