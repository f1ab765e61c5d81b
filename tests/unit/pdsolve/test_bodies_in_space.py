"""Bodies beside each other in space: their nodes and settings, contact, rigid motion, and a ball on a brittle plate."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming
from scipy.spatial.distance import pdist

from benchmarks.balance_rows import compute_condition_forces, compute_energy_balance_row
from pdmesh import Body, Box, Material, SceneError, Sphere, build
from pdmesh.drawing.file_reading import read_scene
from pdmesh.model.document import Displacement, InitialVelocity, RigidBody, Run, read_document
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.node_grid import grid_of
from pdsolve.model import Model
from pdsolve.operators.contact.operator import pair_stiffness
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

UNIT = Material(E=1.0, rho=1.0, G0=1e9, plane="space")
HEAVY = msgspec.structs.replace(UNIT, rho=3.0)
H = 0.1


def plate() -> Body:
    return Body(Box((0, 0, 0), (1, 1, 0.3)), H, UNIT)


def prepared(body: Body) -> PreparedRun:
    built = build(body)
    return prepare(Model(built.grid, built.settings), Options(threads=1))


@pytest.mark.slow
def test_bodies_that_overlap_are_refused_with_their_depth() -> None:
    block = Body(Box((0.9, 0.05, 0.05), (1.2, 0.25, 0.25)), 0.05, UNIT)
    with pytest.raises(SceneError, match=naming("body 'block'", found=("0.1 m", "plate"))):
        build(plate().body(block, "block"))
    with pytest.raises(SceneError, match=naming("body 'speck'", found=("plate",))):
        build(plate().body(Body(Box((0.42, 0.42, 0.12), (0.48, 0.48, 0.18)), 0.02, UNIT), "speck"))
    assert len(build(plate().body(Box((1, 0, 0), (1.3, 1, 0.3)), "beside")).grid) == 390


TOGETHER = """
SetFactory("OpenCASCADE");
DefineConstant[
  u = {"mm", Name "Peridynamics/Units"}
  h = {50, Name "Peridynamics/Zones/plate/Spacing"}
  E = {1, Name "Peridynamics/Material/E"}
  r = {1, Name "Peridynamics/Material/rho"}
  G = {1e9, Name "Peridynamics/Material/G0"}
  v = {-1e-3, Name "Peridynamics/Bodies/upper/Velocity z"}
];
lower() = ShapeFromFile("lower.step");
upper() = ShapeFromFile("upper.step");
Physical Volume("zone:plate") = lower();
Physical Volume("body:upper") = upper();
"""


@pytest.mark.slow
@pytest.mark.parametrize("drawn", [False, True])
def test_two_step_files_are_two_bodies_that_bounce(tmp_path: Path, drawn: bool) -> None:
    """Each read as a scene, or both in one drawing; a block of 216 cubes on one of 600."""
    gmsh = pytest.importorskip("gmsh", exc_type=OSError)
    for name, block in (("lower", (0, 0, 0, 500, 500, 300)), ("upper", (100, 100, 300, 300, 300, 300))):
        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.occ.addBox(*block)
            gmsh.model.occ.synchronize()
            gmsh.write(str(tmp_path / f"{name}.step"))
        finally:
            gmsh.finalize()
    if drawn:
        (tmp_path / "both.geo").write_text(TOGETHER, encoding="utf-8")
        scene = read_scene(tmp_path / "both.geo", trust=True)
    else:
        given = [("Zones/body/Spacing", "50"), ("Units", "mm")]
        given += [("Material/E", "1"), ("Material/rho", "1"), ("Material/G0", "1e9")]
        scene, upper = (read_scene(tmp_path / f"{name}.step", given) for name in ("lower", "upper"))
        assert isinstance(scene, Body)
        assert isinstance(upper, Body)
        scene = scene.body(upper, "upper", velocity=(0.0, 0.0, -1e-3))
    built = build(scene)
    of = built.grid.bodies
    assert of is not None
    assert (of.names, np.bincount(of.number).tolist()) == (("plate", "upper"), [600, 216])
    system, state = motion = prepare(Model(built.grid, built.settings), Options(threads=1))
    assert system.contact is not None
    motion.advance(1, 5)
    assert system.contact.touching(state) >= 72  # 116: both faces of 6 x 6 nodes, and those beside
    motion.advance(5, 61)
    assert system.contact.touching(state) == 0
    low, up = (state.rate[of.number == number, 2].mean() for number in (0, 1))
    assert up > 0 > low
    assert 600 * low + 216 * up == pytest.approx(-0.216, rel=1e-12)


@pytest.mark.slow
def test_bodies_have_nodes_materials_motions_and_conditions_of_their_own(tmp_path: Path) -> None:
    upper = Body(Box((0, 0, 0.3), (0.4, 0.4, 0.5)), 0.05, HEAVY).fix("top", 0.0, 0.0, None)
    whole = (
        plate()
        .fix("bottom")
        .body(upper, "upper", velocity=(0.0, 0.0, -2.0), spin=(0.0, 3.0, 0.0))
        .contact(friction=0.1)
    )
    built = build(whole.rigid(Box((0.6, 0.6, 0.3), (1, 1, 0.6)), "lid", 5.0, spin=(0, 0, 1.0)))
    grid = built.grid
    assert grid.bodies is not None
    assert grid.bodies.names == ("plate", "upper", "lid")
    assert np.bincount(grid.bodies.number).tolist() == [300, 256, 48]
    assert set(grid.delta[grid.bodies.number == 1]) == {0.05}
    assert built.settings.contact == Contact(friction=0.1)
    held, moves, top, lid = built.settings.conditions
    assert isinstance(held, Displacement)
    assert isinstance(moves, InitialVelocity)
    assert isinstance(top, Displacement)
    assert isinstance(lid, RigidBody)
    assert moves.nodes == tuple(range(301, 557))
    assert grid.position[np.array(top.nodes) - 1, 2] == pytest.approx(0.475)
    model = Model(grid, built.settings)
    assert [set(model.rho[grid.bodies.number == number]) for number in (0, 1)] == [{1.0}, {3.0}]
    assert model.rho[-48:] @ grid.cells[-48:] == pytest.approx(5.0, rel=1e-14)
    system, state = prepare(model, Options(threads=1))
    source, target = system.operator.bonds()
    assert not (grid.bodies.number[source] != grid.bodies.number[target]).any()
    assert not (grid.bodies.number[source] == 2).any()
    x, _, z = (grid.position - [0.2, 0.2, 0.4])[grid.bodies.number == 1].T
    turning = np.column_stack([3 * z, 0 * z, -2 - 3 * x])
    assert state.rate[grid.bodies.number == 1] == pytest.approx(turning, abs=1e-12)
    built.write(tmp_path / "three.json")
    again = grid_of(read_document((tmp_path / "three.json").read_bytes(), "three"), "three")
    assert again.bodies is not None
    assert again.bodies.number.tolist() == grid.bodies.number.tolist()


@pytest.mark.slow
def test_equal_blocks_in_space_change_velocities() -> None:
    """Two blocks of ten spacings: some of the motion stays in their vibrations."""
    block = Body(Box((0, 0, 0), (1, 0.3, 0.3)), H, UNIT)
    system, state = both = prepared(block.body(Box((1, 0, 0), (2, 0.3, 0.3)), "other", velocity=(-1e-3, 0.0, 0.0)))
    both.advance(1, 1 + int(3 / system.time_step))
    assert system.model.grid.bodies is not None
    first, other = (state.rate[system.model.grid.bodies.number == number, 0].mean() for number in (0, 1))
    assert (first, other) == (pytest.approx(-1e-3, rel=0.05), pytest.approx(0, abs=5e-5))
    momentum = (system.area * system.model.rho) @ state.rate
    assert np.abs(momentum - [-1e-3 * 0.09, 0, 0]).max() < 1e-13 * 1e-3 * 0.09


@pytest.mark.slow
def test_a_rigid_ball_bounces_from_a_plate() -> None:
    ball = plate().rigid(Sphere((0.5, 0.5, 0.5), 0.2), "ball", 0.05, (0.0, 0.0, -1e-3), (0.0, 0.1, 0.0), spacing=0.05)
    (system, state), steps, pushed = prepared(ball), 120, 0.0
    for step in range(1, steps + 1):
        PreparedRun(system, state).advance(step, step + 1)
        (found,) = compute_condition_forces(system, state, step, step * system.time_step)
        pushed -= found.force_z * system.time_step
    rows = system.model.grid.rigid
    momentum = ((system.area * system.model.rho)[rows] * state.rate[rows, 2]).sum()
    assert pushed == pytest.approx(momentum + 0.05 * 1e-3, rel=1e-6)  # 2.4e-7
    assert state.rate[rows, 2].mean() > 0
    entry = compute_energy_balance_row(system, state, steps)
    assert entry.momentum_z == pytest.approx(-0.05 * 1e-3, rel=1e-12)
    assert abs(entry.balance_error(system.initial_energy)) < 5e-3
    x = system.model.grid.position[rows]
    assert np.abs(pdist(x + state.value[rows]) - pdist(x)).max() < 1e-14


@pytest.mark.slow
def test_a_box_that_tumbles_keeps_its_angular_momentum_and_its_energy() -> None:
    box, spin = Box((0, 0, 1), (0.3, 0.5, 2.0)), (0.4, 0.7, 0.2)
    (system, state), steps = prepared(plate().rigid(box, "box", 2.0, (0.0, 0.0, 0.01), spin)), 300
    rows, mass = np.flatnonzero(system.model.grid.rigid), system.model.rho * system.area

    def angular() -> np.ndarray:
        x = system.model.grid.position[rows] + state.value[rows]
        arm = x - x.mean(axis=0)
        return np.asarray(mass[rows] @ np.cross(arm, state.rate[rows]))

    before = angular()
    PreparedRun(system, state).advance(1, steps + 1)
    assert angular() == pytest.approx(before, rel=2e-3)  # of steps that turn it by .05
    assert abs(compute_energy_balance_row(system, state, steps).balance_error(system.initial_energy)) < 2e-3
    turned = state.value[rows] - state.value[rows].mean(axis=0)
    assert np.abs(turned).max() > 0.3


def struck() -> PreparedRun:
    """A ball on a brittle plate, of LAMMPS's example `peri`, with a smaller plate."""
    glass = Material(E=1.5 * 14.9e9, rho=2200.0, G0=20.0, plane="space", micromodulus="constant")
    h = 0.5e-3
    target = Body(Box((-4e-3, -4e-3, -2e-3), (4e-3, 4e-3, 0)), h, glass, run=Run())
    return prepared(target.rigid(Sphere((0, 0, 2e-3), 2e-3), "ball", 1e-4, (0.0, 0.0, -100.0), held=("spin",)))


@pytest.mark.slow
def test_contact_of_a_ball_on_a_plate_has_the_constants_of_lammps() -> None:
    """c = 18 K / (pi delta^4) with K = 14.9 GPa and delta = 1.5 mm; contact 15 c / delta."""
    model = struck().system.model
    assert model.settings.contact is not None
    c = 1.6863e22
    assert pair_stiffness(model, model.settings.contact) == pytest.approx(15 * c / 1.5e-3, rel=1e-4)


@pytest.mark.slow
def test_a_ball_breaks_a_plate_into_mirror_symmetric_quarters() -> None:
    system, state = both = struck()
    both.advance(1, 81)
    of, x = compute_node_damage(system), system.model.grid.position
    assert of.max() > 0.3
    order = np.lexsort(np.round(x, 7).T)
    for mirror in ([-1, 1, 1], [1, -1, 1]):
        other = np.lexsort(np.round(x * mirror, 7).T)
        assert np.array_equal(of[order], of[other])
        u = state.value[other] * mirror
        assert u == pytest.approx(state.value[order], rel=0, abs=1e-13 * np.abs(u).max())  # 3e-15


def test_what_no_body_beside_can_be_is_refused() -> None:
    ball = Sphere((0.5, 0.5, 0.5), 0.2)
    for wrong in (
        lambda: plate().rigid(ball, "ball"),
        lambda: plate().rigid(ball, "plate", 1.0),
        lambda: plate().body(ball, "ball").body(ball, "ball"),
        lambda: plate().body(plate().body(ball, "ball"), "two"),
        lambda: plate().body(ball, "ball", velocity=(0.0, 1.0)),  # type: ignore[arg-type]
    ):
        with pytest.raises(SceneError, match=naming(expected="")):
            wrong()
    with pytest.raises(SceneError, match=naming("ball", "mass", expected="kg")):
        plate().rigid(ball, "ball")
