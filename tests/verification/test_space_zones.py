"""Bodies with a fine zone of any shape: statics, the longest step, free vibration; and runs whose zone moves."""

from __future__ import annotations

import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest
from pulse_reflections_3d import bonds_of, sent_back
from zoned_blocks import GLASS, HEIGHT, LENGTH, SMALL, WIDTH, H, blob, block, place, zone_operator

import pdmesh
from pdmesh import Body, Box, Cylinder, Run, ramp
from pdmesh.drawing.building import meshed
from pdmesh.model.document import Load
from pdsolve.adaptivity.hybrid.space.coarse_springs import cubic_stiffness
from pdsolve.adaptivity.hybrid.space.prepare import SEAM, compute_vertex_force_ratio, create_operator_of_cells
from pdsolve.conditions import factors_at
from pdsolve.errors import FineZoneTooLateError
from pdsolve.laws.pair_laws.brittle import LAW
from pdsolve.model import Model
from pdsolve.numerics.thread_team import cores
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.zone.cells import COARSE, FINE, lattice_coordinates


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "tau"), [(2.0, 0.037124), (3.0, 0.038878)])  # of an independent script
def test_body_diagonals_take_what_vertices_need(ratio: float, tau: float) -> None:
    """To the digits known."""
    assert compute_vertex_force_ratio(LAW, bonds_of(ratio), 1.0) == pytest.approx(tau, abs=6e-7)


@pytest.mark.slow
@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(("ratio", "profile"), [(2.0, "constant"), (3.0, "constant"), (3.0, "conical")])
def test_any_linear_field_is_in_equilibrium(ratio: float, profile: str) -> None:
    """A random gradient on a random blob, faces, edges and vertices: but for the outer layer; and not without tau."""
    bonds, gradient = bonds_of(ratio, profile), np.random.default_rng(2).standard_normal((3, 3))
    for tau, least, most in (
        (compute_vertex_force_ratio(LAW, bonds, 1.0), 0.0, 1e-12),
        (0.0, 1e-2, 1.0),
    ):  # measured 1.1e-13, 0.14
        operator = blob(bonds, 16, 4, tau)
        x = place(operator)
        u = SMALL * x @ gradient.T
        force = (
            (operator.forces_at_displacements(u) - operator.forces_at_displacements(-u))
            / 2
            / SMALL
            / cubic_stiffness(bonds).c11
        )
        inner = ((x > 2) & (x < 30)).all(axis=1)
        assert least <= np.abs(force[inner]).max() < most
        assert np.abs(force.sum(axis=0)).max() < 1e-9
        assert operator.area.sum() == pytest.approx(33.0**3, rel=1e-12)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("ratio", [2.0, 3.0])
def test_the_sure_step_is_stable_with_a_seam(ratio: float) -> None:
    """2 / omega_max, by power iteration; measured 1.35 and 1.66 sqrt(rho / C11) against 1.13 and 1.60."""
    bonds = bonds_of(ratio)
    operator = blob(bonds, 10, 1, compute_vertex_force_ratio(LAW, bonds, 1.0))
    v, found = np.random.default_rng(0).standard_normal((len(operator.places), 3)), 0.0
    for _ in range(120):
        w = -operator.forces_at_displacements(SMALL * v) / SMALL / operator.area[:, None]
        found = float((v * w * operator.area[:, None]).sum() / (v * v * operator.area[:, None]).sum())
        v = w / np.abs(w).max()
    n = bonds[:, :3] * np.sqrt(bonds[:, 6])[:, None]
    sure = np.sqrt(2 * SEAM / np.linalg.eigvalsh(np.einsum("k,ka,kb->ab", bonds[:, 7], n, n))[-1])
    assert sure < 0.985 * 2 / np.sqrt(found)


@pytest.mark.slow
@pytest.mark.parametrize(("shear", "known"), [(False, 0.026), (True, 0.025)], ids=["pressure", "shear"])
def test_a_seam_sends_as_little_back_as_an_independent_script_found(shear: bool, known: float) -> None:
    """Of pulses two horizons wide."""
    assert sent_back(3.0, 6, shear) == pytest.approx(known, rel=0.2)  # measured 0.0268, 0.0270


@pytest.mark.slow
def test_free_vibration_does_not_grow() -> None:
    """Noise in a blob, small strains: the energy that leapfrog keeps, over 800 units of sqrt(rho / C11)."""
    bonds = bonds_of(3.0)
    operator = blob(bonds, 7, 1, compute_vertex_force_ratio(LAW, bonds, 1.0))
    dt, mass = 0.8 * 1.6 / np.sqrt(cubic_stiffness(bonds).c11), operator.area[:, None]
    v, u, energies = 1e-8 * np.random.default_rng(3).standard_normal((len(mass), 3)), np.zeros((len(mass), 3)), []
    momentum = (mass * v).sum(axis=0)
    for step in range(int(800 / (0.8 * 1.6))):
        force = operator.forces_at_displacements(u)
        after = v + dt * force / mass
        if step % 50 == 0:
            energies.append(float((v * mass * after).sum() - (u * force).sum()))
        u, v = u + dt * after, after
    assert np.ptp(energies) < 1e-6 * energies[0]  # measured 4e-9
    assert np.abs((mass * v).sum(axis=0) - momentum).max() < 1e-10 * np.abs(mass * v).sum()


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose zone moves, left alone."""
    path = tmp_path_factory.mktemp("body") / "whole.sqlite"
    simulate(block("hybrid"), path, Options(threads=1)).close()
    return path


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_cells_around_a_stretched_spring_become_fine(axis: int) -> None:
    """A coarse node moves by 0.9 of the critical stretch of the spring behind it: this one alone is beyond kappa."""
    problem = prepare(block("hybrid"), Options(threads=1))
    operator, state = zone_operator(problem), problem.state
    spacings, limit = place(operator), operator.engine.full_body.fine_lattice.tiles.peak.min()
    node = np.array([40, 8, 20])
    state.value[(spacings == node).all(axis=1), axis] = 0.9 * 2 * H * limit
    operator.set_node_motion(state)
    new = operator.engine.mark_new_fine_cells(0)
    numbering = operator.engine.full_body.fine_lattice.numbering.cells
    found = np.column_stack(lattice_coordinates(numbering, new))
    behind = node - 2 * np.eye(3, dtype=int)[axis]
    cells = np.argwhere(np.ones((24, 8, 20)))
    away = [np.linalg.norm(np.maximum(np.abs(one - (2 * cells + 1)) - 1, 0), axis=1) for one in (node, behind)]
    near = cells[np.minimum(*away) < 8]
    is_fine = operator.current_nodes_model.grid.delta < 1.5 * H
    assert (np.abs(spacings - node) > 10).any(axis=1)[is_fine].all()  # fine ones are far
    assert sorted(map(tuple, found)) == sorted(map(tuple, near))


@pytest.mark.slow
def test_a_crack_runs_as_on_the_fine_lattice(solved: Path) -> None:
    """Beside the fine lattice everywhere: energy dissipated, first bond, books; the zone grows with the crack."""
    uniform = simulate(block("none"), None, Options(threads=1))
    with Results.open(solved) as results:
        books, others = results.history(), uniform.history()
        fine = books["fine_share"]
        assert 0.1 < fine[0] < fine[-1] < 0.8
        assert np.all(np.diff(fine) >= 0)
        assert books["dissipated"][-1] == pytest.approx(others["dissipated"][-1], rel=0.03)  # measured 0.0094
        assert books["work"][-1] == pytest.approx(others["work"][-1], rel=0.005)  # 0.0014
        first, other = (int(each.breaks().step.min()) for each in (results, uniform))
        assert abs(first - other) <= 1  # 94 in both
        assert abs(results.summary()["balance"]) < 0.01
        for step in results.frames()[0].tolist():
            nodes = results.nodes(step)
            assert nodes.area.sum() == pytest.approx(LENGTH * WIDTH * HEIGHT, rel=1e-9)
            assert len(results.field("ux", step)) == len(nodes.ids)


@pytest.mark.slow
def test_a_stopped_run_and_two_threads_have_the_same_bits(solved: Path, tmp_path: Path) -> None:
    """A run stopped while cells become fine goes on to the same tables; so does one on two threads."""
    path, seen = tmp_path / "stopped.sqlite", []
    simulate(
        block("hybrid"), path, Options(threads=1), lambda now: bool(seen.append(now.step)) or now.step >= 90
    ).close()
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
    resume(path, threads=min(2, cores())).close()
    with Results.open(solved) as one, Results.open(path) as other:
        last = one.frames()[0].max()
        for name in ("ux", "uz", "vz", "damage"):
            assert np.array_equal(one.field(name, last), other.field(name, last))
        assert np.array_equal(one.history()["strain"][-1], other.history()["strain"][-1])
        assert len(one.breaks().step) == len(other.breaks().step)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["hole", "outline"])
def test_surfaces_that_cut_cells_have_fine_rings(shape: str) -> None:
    """A bore, and a body that is a cylinder, pulled for 60 steps: coarse cells are left, and the work is that of the
    fine lattice."""
    half, h, z = 12 * H, H, 16 * H
    bore = Cylinder((0, 0, -2 * z), (0, 0, 2 * z), 4.4 * h)
    solid = Box((-3 * half, -half, -z), (3 * half, half, z)) - bore if shape == "hole" else None
    body = Body(
        solid or Cylinder((0, 0, -z), (0, 0, z), 22.4 * h), h, GLASS, run=Run(steps=60, every=60, time_step=1e-7)
    )
    body = body.adapt("hybrid")
    for side, speed in (("top", 0.05), ("bottom", -0.05)):
        body = body.move(side, velocity=(None, None, speed), rows=3, profile=ramp(2e-6))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = pdmesh.build(meshed(body))
    work, fine = [], 1.0
    for adapt in ("none", "hybrid"):
        run = msgspec.structs.replace(built.settings.run, adapt=adapt)
        model = Model(built.grid, msgspec.structs.replace(built.settings, run=run))
        with simulate(model, None, Options(threads=1)) as results:
            work.append(results.history()["work"][-1])
            if adapt == "hybrid":
                fine = results.history()["fine_share"][0]
                assert results.nodes().area.sum() == pytest.approx(built.grid.cells.sum(), rel=1e-9)
    assert 0.5 < fine < 1  # measured 0.979 with the bore, 0.895 in the cylinder: flat faces of solids have rings too
    assert work[1] == pytest.approx(work[0], rel=1e-3)  # measured 8e-6, 5e-5


@pytest.mark.slow
def test_refining_looks_at_all_that_changes() -> None:
    """Forces, energies and numbers of bonds after some cells became fine, beside those of the whole body anew."""
    problem = prepare(block("hybrid"), Options(threads=1))
    before, state = zone_operator(problem), problem.state
    engine = before.engine
    state.value[:] = 1e-4 * H * np.random.default_rng(5).standard_normal(state.value.shape)
    before.set_node_motion(state)
    numbering = engine.full_body.fine_lattice.numbering.cells
    cells = engine.cell_kinds.reshape(numbering.shape)
    z, y, x = np.nonzero((cells[..., 1:] == COARSE) & (cells[..., :-1] == FINE))  # beside the zone
    some = np.flatnonzero(y == int(np.median(y)))[::3]
    cells[z[some], y[some], x[some] + 1] = FINE
    made, work = [engine.energies()[0].sum()], engine.refinement_energy
    new = np.ravel_multi_index((z[some], y[some], x[some] + 1), cells.shape)
    engine.refine_cells(new)
    made.append(engine.energies()[0].sum())
    after = before.new_operator_if_nodes_changed()
    assert after is not None
    found = after.state()
    assert engine.refinement_energy - work == pytest.approx(made[1] - made[0], abs=1e-12 * made[0])  # at rest
    assert abs(made[1] - made[0]) > 1e-6 * made[0]
    again = create_operator_of_cells(
        engine.full_body,
        engine.cell_kinds.copy(),
        compute_vertex_force_ratio(LAW, engine.full_body.fine_lattice.tiles.vectors, H),
    )
    assert np.array_equal(again.places, after.places)
    assert np.array_equal(again.area, after.area)
    for one, other in zip(
        again.initial_bond_counts_and_family_sizes, after.initial_bond_counts_and_family_sizes, strict=True
    ):
        assert np.array_equal(one, other)
    assert np.array_equal(again.forces_at_displacements(found.value), after.forces_at_displacements(found.value))


@pytest.mark.slow
def test_a_clipped_bond_over_its_limit_is_an_error() -> None:
    """A fine node beside the border is torn off, which no spring notes: the zone is late, in the step that says so."""
    problem = prepare(block("hybrid"), Options(threads=1))
    operator, state = zone_operator(problem), problem.state
    engine = operator.engine
    ends = engine.seam.pieces.points.interpolation_nodes[:, 0]
    fine_end = int(ends[ends >= 0][0]) - engine.full_body.fine_sites.margin
    state.value[operator.places == fine_end, 0] = 0.5 * H
    operator.set_node_motion(state)
    with pytest.raises(FineZoneTooLateError) as late:
        engine.advance(1, 3)
    assert late.value.step == 1
    assert engine.zone_summary().clipped_stretch > 1


@pytest.mark.slow
def test_refining_keeps_what_was_booked_and_what_acts() -> None:
    """In motion, under a grip and a load: work and damping booked, loads, the forces that hold nodes, and the energy
    that leapfrog keeps, but for what is booked as refinement."""
    model = block("hybrid")
    load = Load(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 1.0), body_force=(0.0, 2e7, 0.0), profile=((0.0, 0.0), (1e-5, 1.0)))
    run = msgspec.structs.replace(model.settings.run, damping=2e3)
    conditions = (*model.settings.conditions, load)
    settings = msgspec.structs.replace(model.settings, run=run, conditions=conditions)
    problem = prepare(Model(model.grid, settings), Options(threads=1))
    problem.advance(1, 60)
    engine = zone_operator(problem).engine

    def totals() -> tuple[list[float], np.ndarray, float]:
        """Booked energies, J, loads (3,), N, and the energy that leapfrog keeps, J."""
        rows, state, drive = engine.nodes.rows, engine.state, engine.zone_drive
        volume, mass = engine.volume[rows], (engine.rho * engine.volume)[rows]
        booked = [float((volume * values[rows]).sum()) for values in (state.work, state.damped)]
        speed = engine.gather(engine.coarse.v[0], engine.fine.v[0])
        swing = (engine.time_step / 2) ** 2 * (state.second[rows] ** 2).sum(axis=1)
        kinetic = float((mass / 2 * ((speed**2).sum(axis=0) - swing)).sum())
        force = (volume[:, None] * drive.force[rows]).sum(axis=0)
        return booked, force, kinetic + float(engine.energies()[0].sum())

    booked, force, energy = totals()
    numbering = engine.full_body.fine_lattice.numbering.cells
    z = lattice_coordinates(numbering, np.arange(numbering.place_count))[2]
    new = np.flatnonzero((engine.cell_kinds == COARSE) & (z > numbering.counts[2] - 4))  # at the upper grip
    before, held = engine.refinement_energy, engine.held_force.copy()
    engine.cell_kinds[new] = FINE
    engine.refine_cells(new)
    booked_after, force_after, energy_after = totals()
    assert booked_after == pytest.approx(booked, rel=1e-12)
    assert force_after == pytest.approx(force, rel=1e-12)
    factor = factors_at(engine.drive.profiles, engine.time)[-1]
    assert force_after[1] == pytest.approx(2e7 * factor * engine.full_volume.sum(), rel=1e-9)
    operator = problem.system.moving_zone_operator.new_operator_if_nodes_changed()  # type: ignore[union-attr]
    assert operator is not None
    holds, place_of = engine.drive.holds, {int(row): n for n, row in enumerate(operator.grid_rows)}
    density = operator.forces_at_displacements(operator.state().value) / operator.area[:, None]  # type: ignore[union-attr]
    known = [e for e in range(len(holds.node)) if int(holds.node[e]) in place_of and held[e] != engine.held_force[e]]
    at = [place_of[int(holds.node[e])] for e in known]
    expected = density[at, holds.axis[known]] + engine.zone_drive.force[holds.node[known], holds.axis[known]]
    assert len(known) > 50
    state, rows = operator.state(), operator.grid_rows  # type: ignore[union-attr]
    pull = density + engine.zone_drive.force[rows]
    excess = engine.rho[rows, None] * (state.second + engine.damping[rows, None] * state.rate) - pull
    for node, axis in zip(holds.node.tolist(), holds.axis.tolist(), strict=True):
        if node in place_of:
            excess[place_of[node], axis] = 0.0
    way = engine.time_step * (state.rate + engine.time_step / 2 * state.second)
    kick = float((operator.area[:, None] * excess / 2 * way).sum())  # type: ignore[union-attr]
    assert abs(kick) > 0.1 * abs(energy_after - energy)
    assert engine.refinement_energy - before == pytest.approx(energy_after - energy + kick, rel=1e-4)
    np.testing.assert_allclose(engine.held_force[known], expected, atol=1e-9 * np.abs(expected).max())
