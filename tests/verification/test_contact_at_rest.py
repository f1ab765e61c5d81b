"""Bodies that touch at rest: Hertz, a closed crack, a block that another holds, a bar pulled through a grip."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import pytest
from contact_bars import UNIT, grid_of
from messages import naming
from numpy.typing import NDArray

from benchmarks.balance_rows import compute_condition_forces, compute_energy_balance_row
from pdmesh import Run, Scene, Static, box, build, ramp
from pdmesh.model.document import AnyCondition, Displacement, Load, Settings
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.node_grid import Bodies, Grid
from pdsolve import Results
from pdsolve.model import Model, ModelError
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.run.system import PreparedRun

Array = NDArray[np.float64]

H = 0.02  # m
GROWS = ((0.0, 0.0), (1.0, 1.0))
By = Literal["newton", "relaxation"]


def cells(columns: int, rows: int, x: float, y: float) -> Array:
    """Nodes of a rectangle from a corner on."""
    along, up = np.meshgrid(x + H * (np.arange(columns) + 0.5), y + H * (np.arange(rows) + 0.5))
    return np.column_stack([along.ravel(), up.ravel()])


def at_rest(conditions: tuple[AnyCondition, ...], grid: Grid, friction: float, by: By, steps: int) -> Model:
    run = Run(solver="static", static=Static(method=by, load_steps=steps))
    return Model(grid, Settings(material=UNIT, conditions=conditions, contact=Contact(friction=friction), run=run))


def taken(model: Model) -> tuple[PreparedRun, Array, EnergyBalanceRow]:
    """A model after its load steps, the forces of its conditions (c, 3), N/m, in space N, and its ledger."""
    system, state = prepared = prepare(model, Options(threads=1))
    steps = system.model.settings.run.steps
    prepared.advance(1, steps + 1)
    found = compute_condition_forces(system, state, steps, 1.0)
    return (
        prepared,
        np.array([[one.force_x, one.force_y, one.force_z] for one in found]),
        compute_energy_balance_row(system, state, steps),
    )


def stacked(by: By, apart: float = 0.0, friction: float = 0.2) -> Model:
    """A block on one that is held below, pressed from above by 1e-3 N/m in all."""
    grid = grid_of([cells(30, 10, 0, -10 * H), cells(15, 10, 0.15, apart)], H)
    y = grid.position[:, 1]
    low, top = (tuple(grid.ids[rows].tolist()) for rows in (y < -9 * H, y > 9 * H + apart))
    push = Load(body_force=(0.0, -1e-3 / (15 * H * H)), nodes=top, profile=GROWS)
    return at_rest((Displacement(x=0.0, y=0.0, nodes=low), push), grid, friction, by, 2)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("by", ["newton", "relaxation"])
def test_a_block_is_held_by_what_it_lies_on(by: By) -> None:
    (system, state), force, last = taken(stacked(by))
    assert force[0, 1] == pytest.approx(1e-3, rel=1e-6)
    assert system.contact is not None
    assert system.contact.touching(state) == 31
    assert abs(last.balance_error(0.0)) < 3e-3  # 1.8e-3: normals turn with the faces


def test_a_block_above_a_gap_is_not_supported() -> None:
    with pytest.raises(ModelError, match=naming("$.conditions", "150 nodes", expected="supports")):
        prepare(stacked("newton", apart=0.2 * H), Options(threads=1))


def test_restitution_at_rest_is_refused() -> None:
    model = stacked("newton")
    settings = msgspec.structs.replace(model.settings, contact=Contact(restitution=0.5))
    with pytest.raises(ModelError, match=naming("$.contact.restitution", found="0.5", expected=1)):
        prepare(Model(model.grid, settings), Options(threads=1))


def pressed(crack: bool, contact: bool, by: By = "newton", friction: float = 0.0) -> tuple[float, float, float]:
    """Stiffness of a unit plate under a strain of .001, the depth of its crack's faces, and the balance."""
    side, strain = 40, 1e-3
    h = 1 / side
    run = Run(solver="static", static=Static(method=by, load_steps=2))
    scene = Scene(box(0, 0, 1, 1), h, UNIT, run=run)
    scene = scene.fix("bottom", x=None, y=0.0).fix(box(0.5 - h / 2, 0, 0.5 + h / 2, h / 2), x=0.0, y=None)
    scene = scene.fix("top", x=None, y=-strain, profile=ramp(1))
    scene = scene.crack([(0, 0.5 + h / 2), (0.5, 0.5 + h / 2)]) if crack else scene
    built = build(scene.contact(friction) if contact else scene)
    (system, state), force, last = taken(Model(built.grid, built.settings))
    depth = system.contact._touch(state.value).depth.max() if isinstance(system.contact, RestingContact) else 0.0
    return -float(force[2, 1]) / strain, float(depth / h), last.balance_error(0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("by", "friction"), [("newton", 0.0), ("newton", 0.3), ("relaxation", 0.0)])
def test_a_crack_closes(by: By, friction: float) -> None:
    whole, _, _ = pressed(False, False)
    gaping, _, _ = pressed(True, False)
    found, depth, balance = pressed(True, True, by, friction)
    assert gaping / whole < 0.6  # .57
    assert found / whole == pytest.approx(1.0, abs=0.03)  # .991
    assert 0 < depth < 0.05  # .002 of a spacing
    assert abs(balance) < 1e-5  # 2e-7


def gripped(friction: float, steps: int = 10, by: By = "newton") -> Model:
    """A bar between two jaws that press with 1e-3 N/m, pulled by its end."""
    grid = grid_of([cells(40, 6, 0, -3 * H), cells(12, 6, 0.1, 3 * H), cells(12, 6, 0.1, -9 * H)], H)
    (x, y), of = grid.position.T, np.repeat([0, 1, 2], [240, 72, 72])
    masks = (of == 2) & (y < -8 * H), (of == 1) & (y > 8 * H), (of == 0) & (x > 39 * H)
    low, up, end = (tuple(grid.ids[mask].tolist()) for mask in masks)
    push = Load(body_force=(0.0, -1e-3 / (12 * H * H)), nodes=up, profile=((0.0, 0.0), (0.25, 1.0)))
    pull = Displacement(x=0.008, nodes=end, profile=((0.25, 0.0), (1.0, 1.0)))
    hold = Displacement(x=0.0, y=0.0, nodes=low), Displacement(x=0.0, nodes=up)
    return at_rest((*hold, push, pull), grid, friction, by, steps)


@pytest.mark.slow
def test_a_bar_is_pulled_through_a_grip() -> None:
    (system, state), force, last = taken(gripped(0.3, 16))
    assert system.contact is not None
    heat = system.contact.friction(state)
    assert force[3, 0] == pytest.approx(2 * 0.3 * 1e-3, rel=0.02)  # .985
    assert last.friction == heat > 0.5 * last.work
    assert (
        abs(last.balance_error(0.0)) < 0.0125
    )  # .0113, at 32 and 64 load steps too: pairs' normals turn as they slide


@pytest.mark.slow
def test_a_resumed_grip_has_the_same_bits(tmp_path: Path) -> None:
    model, path = gripped(0.3, 8), tmp_path / "stopped.sqlite"
    whole = simulate(model, options=Options(threads=1))
    simulate(model, path, Options(threads=1), lambda progress: progress.step == 5).close()
    resume(path, threads=1).close()
    with Results.open(path) as again:
        for name in ("ux", "uy", "energy"):
            assert np.array_equal(whole.field(name, 8), again.field(name, 8))
        assert whole.history()["friction"][-1] == again.history()["friction"][-1] > 0


SOFT = msgspec.structs.replace(UNIT, law="cohesive", f_t=1e-3, G0=0.01)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_bodies_that_soften_rest_alike_before_they_do(friction: float) -> None:
    """Path following and Newton's method, pressed to a strain of 2e-3, with bonds that soften at higher ones."""
    grid, found = grid_of([cells(8, 4, 0, -4 * H), cells(8, 4, 0, 0)], H), []
    y = grid.position[:, 1]
    low, top = (tuple(grid.ids[rows].tolist()) for rows in (y < -3 * H, y > 3 * H))
    for material in (UNIT, SOFT):
        model = at_rest((Displacement(x=0.0, y=0.0, nodes=low),), grid, friction, "newton", 1)
        press = Displacement(x=0.0, y=-0.016 * H, nodes=top, profile=GROWS)
        settings = msgspec.structs.replace(
            model.settings, material=material, conditions=(*model.settings.conditions, press)
        )
        system, state = prepared = prepare(Model(grid, settings), Options(threads=1))
        prepared.advance(1, 2)
        pushed = compute_condition_forces(system, state, 1, 1.0)[0].force_y
        found.append(
            (pushed, *state.value[32:40, 1].tolist(), compute_energy_balance_row(system, state, 1).balance_error(0.0))
        )
    assert found[0][0] > 1e-4
    assert found[1][:-1] == pytest.approx(found[0][:-1], rel=2e-4)  # 2e-5
    assert abs(found[1][-1]) < 1e-3


def test_the_tangent_of_softening_bonds_that_touch_is_the_slope_of_their_forces() -> None:
    grid = grid_of([cells(5, 3, 0, -3 * H), cells(5, 3, 0.3 * H, -0.01 * H)], H)
    model = at_rest((Displacement(x=0.0, y=0.0, box=(-1, -1, 1, -2 * H)),), grid, 0.3, "newton", 1)
    hold = Displacement(x=0.0, y=-1e-4 * H, box=(-1.0, 2 * H, 1.0, 1.0), profile=GROWS)
    settings = msgspec.structs.replace(model.settings, material=SOFT, conditions=(*model.settings.conditions, hold))
    system, state = prepare(Model(grid, settings), Options(threads=1))
    bonds = system.stepper._bonds  # type: ignore[attr-defined]
    u = 1e-3 * H * np.random.default_rng(1).standard_normal(state.value.shape)
    found, way = bonds.respond(u), 1e-9 * H * np.random.default_rng(2).standard_normal(u.shape)
    ahead, back = (bonds.forces(bonds.respond(u + sign * way)) for sign in (1, -1))
    assert system.contact is not None
    assert system.contact.touching(state._replace(value=u)) == 7
    assert bonds.tangent(found) @ way.ravel() == pytest.approx((back - ahead).ravel() / 2, rel=1e-4, abs=1e-18)


def pressed_cubes(by: By) -> tuple[float, float]:
    """Force on two cubes of 6 x 6 x 6 nodes in space, pressed by 0.01 of a strain, and the balance."""
    cube = (np.indices((6, 6, 6)).reshape(3, -1).T + 0.5) * H
    grid = grid_of([cube - [0.0, 0.0, 6 * H], cube], H)
    z = grid.position[:, 2]
    low, top = (tuple(grid.ids[rows].tolist()) for rows in (z < -5 * H, z > 5 * H))
    push = Displacement(x=0.0, y=0.0, z=-0.06 * H, nodes=top, profile=GROWS)
    _, force, last = taken(at_rest((Displacement(x=0.0, y=0.0, z=0.0, nodes=low), push), grid, 0.2, by, 1))
    return float(force[0, 2]), last.balance_error(0.0)


@pytest.mark.slow
def test_cubes_that_touch_in_space_rest_alike_by_both_methods() -> None:
    (newton, created), (relaxed, _) = pressed_cubes("newton"), pressed_cubes("relaxation")
    assert 0 < newton == pytest.approx(relaxed, rel=1e-6)
    assert abs(created) < 3e-3  # .001


def squares(x: tuple[float, float], y: tuple[float, float], d: float) -> Array:
    """Nodes in the middles of squares of side d that fill a rectangle."""
    along, up = np.meshgrid(*(np.arange(first + d / 2, last, d) for first, last in (x, y)))
    return np.column_stack([along.ravel(), up.ravel()])


def cylinders(radius: float, wide: float, fine: float, approach: float) -> Grid:
    """Two equal bodies with faces of this radius, 2 `wide` x `wide`, of spacing 1 in the middle and 2 elsewhere; m."""
    near, far = squares((-fine, fine), (-fine, 0), 1.0), squares((-wide, wide), (-wide, 0), 2.0)
    far = far[(np.abs(far[:, 0]) > fine) | (far[:, 1] < -fine)]
    below, delta = np.concatenate([near, far]), np.repeat([1.0, 2.0], [len(near), len(far)])
    flat = below[:, 1].copy()
    below[:, 1] -= below[:, 0] ** 2 / (2 * radius)
    nodes, held = len(below), flat < 3 - wide
    return Grid(
        ids=np.arange(1, 2 * nodes + 1),
        position=np.concatenate([below, below * [1, -1]]),
        delta=np.tile(delta, 2),
        border=np.tile(held, 2),
        hole_id=np.full(2 * nodes, -1),
        cracks=np.zeros((0, 4)),
        areas=np.tile(delta**2, 2),
        bodies=Bodies(np.repeat([0, 1], nodes), ("below", "above")),
    )


@pytest.mark.slow
def test_two_cylinders_touch_as_hertz_has_it() -> None:
    """The half-width is twice the root of the mean of x^2 under the pressure; E = 1, nu = 1/3 in plane stress."""
    radius = 800.0
    grid = cylinders(radius, 80, 24, 0.0)
    nodes = len(grid) // 2
    below = grid.ids[:nodes][grid.border[:nodes]]
    conditions = (
        Displacement(x=0.0, y=0.0, nodes=tuple(below.tolist())),
        Displacement(x=0.0, y=-0.235, nodes=tuple((below + nodes).tolist()), profile=GROWS),
    )
    (system, state), force, last = taken(at_rest(conditions, grid, 0.0, "newton", 1))
    contact = system.contact
    assert isinstance(contact, RestingContact)
    x, push = grid.position[contact._pairs.i, 0], contact._stiffness * contact._touch(state.value).depth
    half = 2 * np.sqrt((push * x**2).sum() / push.sum())
    assert push.sum() == pytest.approx(force[0, 1], rel=1e-3)
    assert half == pytest.approx(8, abs=0.5)
    assert half == pytest.approx(np.sqrt(4 * force[0, 1] * radius / np.pi), rel=0.05)
    assert abs(last.balance_error(0.0)) < 0.01  # .004: one load step while the area of contact grows


def cubes(side: float, z: tuple[float, float], d: float) -> Array:
    """Nodes in the middles of cubes of side d in a box about the z axis."""
    along, up = np.arange(d / 2 - side, side, d), np.arange(z[0] + d / 2, z[1], d)
    return np.array(np.meshgrid(along, along, up, indexing="ij")).reshape(3, -1).T


def sphere_on_block(radius: float, sides: tuple[float, ...]) -> Grid:
    """A block of spacings 1, 2, 4, ... within these distances, and below three layers with a face of this radius; m."""
    parts, delta = [], []
    for level, side in enumerate(sides):
        part, inner = cubes(side, (-side, 0), 2.0**level), sides[level - 1] if level else 0.0
        part = part[(np.abs(part[:, :2]).max(axis=1) > inner) | (part[:, 2] < -inner)]
        parts.append(part)
        delta.append(np.full(len(part), 2.0**level))
    struck = cubes(10, (0, 3), 1.0)
    struck = struck[np.hypot(struck[:, 0], struck[:, 1]) < 9.5]
    struck[:, 2] += (struck[:, :2] ** 2).sum(axis=1) / (2 * radius)
    block, position = sum(map(len, parts)), np.concatenate([*parts, struck])
    spacing, nodes = np.concatenate([*delta, np.ones(len(struck))]), len(position)
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=position,
        delta=spacing,
        border=position[:, 2] < 2 ** (len(sides) - 1) - sides[-1],
        hole_id=np.full(nodes, -1),
        cracks=np.zeros((0, 9)),
        areas=spacing**3,
        bodies=Bodies(np.repeat([0, 1], [block, nodes - block]), ("block", "sphere")),
    )


def of_layer(chi: float) -> float:
    """Force on a layer that is bonded below, nu = 1/4, over that on a half-space, for the root of R d over its height.

    E. K. Dimitriadis et al., Biophysical J. 82 (2002) 2798-2810, equation 12.
    """
    nu = 0.25
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1 - nu)
    third = 8 / np.pi**3 * (a**3 + 4 * np.pi**2 / 15 * b)
    fourth = 16 * a / np.pi**4 * (a**3 + 3 * np.pi**2 / 5 * b)
    return float(1 - 2 * a / np.pi * chi + 4 * a**2 / np.pi**2 * chi**2 - third * chi**3 + fourth * chi**4)


@pytest.mark.slow
def test_a_sphere_touches_a_block_as_hertz_has_it() -> None:
    """F = 4/3 E* R^1/2 d^3/2; d is the approach since nodes are at the distance of touch, half-width 8, height 80.

    Pairs are eight times as stiff as usual: at the usual stiffness their own depth is a quarter of d.
    """
    radius, d = 800.0, 0.08
    grid = sphere_on_block(radius, (12, 20, 40, 80))
    assert grid.bodies is not None
    base, ball = (tuple(grid.ids[rows].tolist()) for rows in (grid.border, grid.bodies.number == 1))
    press = Displacement(x=0.0, y=0.0, z=-d, nodes=ball, profile=GROWS)
    run = Run(solver="static", static=Static(method="relaxation", load_steps=1, tolerance=1e-6))
    conditions = Displacement(x=0.0, y=0.0, z=0.0, nodes=base), press
    settings = Settings(material=UNIT, conditions=conditions, contact=Contact(stiffness=120), run=run)
    (system, state), force, _ = taken(Model(grid, settings))
    contact = system.contact
    assert isinstance(contact, RestingContact)
    push = contact._stiffness * contact._touch(state.value).depth
    half = np.sqrt(2.5 * (push * (grid.position[contact._pairs.i, :2] ** 2).sum(axis=1)).sum() / push.sum())
    modulus = 1 / (1 - 0.25**2)
    found = force[0, 2] / (4 / 3 * modulus * np.sqrt(radius) * d**1.5)
    assert found / of_layer(np.sqrt(radius * d) / 78) == pytest.approx(1.0, abs=0.05)  # .992
    assert half == pytest.approx(8, abs=1)  # 8.77: pairs that are soft spread the pressure
