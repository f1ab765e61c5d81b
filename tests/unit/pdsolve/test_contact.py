"""Contact by itself: forces of pairs, sliding without interlocking, closing cracks, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from contact_bars import UNIT, bar, grid_of, moving
from messages import naming
from numpy.typing import NDArray

from benchmarks.balance_rows import compute_condition_forces, compute_energy_balance_row
from pdmesh import Scene, box, build, ramp
from pdmesh.model.document import InitialVelocity, RigidBody, Run, Settings
from pdmesh.model.mechanical_conditions import Contact
from pdsolve import simulate
from pdsolve.model import Model, ModelError, read_model
from pdsolve.operators.contact.kernel import ease
from pdsolve.operators.contact.operator import pair_stiffness, touch_bound
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume
from pdsolve.run.system import PreparedRun
from pdsolve.state import State

H = 0.01


def cube(side: int, start: tuple[float, ...], delta: float = H) -> NDArray[np.float64]:
    """Nodes of a square or a cube."""
    along = [first + delta * (np.arange(side) + 0.5) for first in start]
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, len(start))


def pressed(prepared: PreparedRun, shift: NDArray[np.float64]) -> tuple[NDArray[np.float64], State]:
    """Forces (n, d), N, of contact alone, the second body moved by `shift` (d,) from where it was; and the state."""
    system, _ = prepared
    assert system.contact is not None
    assert system.model.grid.bodies is not None
    u = np.where(system.model.grid.bodies.number[:, None] == 1, shift, 0.0)
    state = State(u, np.zeros_like(u), np.zeros_like(u), *np.zeros((3, len(u))))
    out = np.zeros_like(u)
    system.contact.accumulate_force(state, out, 1, 1e-9)
    return out * system.area[:, None], state


def on_a_wall(d: int, delta: float = H) -> PreparedRun:
    """A square or a cube that stands on a larger one."""
    parts = [cube(16, d * (0.0,)), cube(6, (*(d - 1) * (5 * H,), 16 * H), delta)]
    grid = grid_of(parts, H)
    sizes = np.repeat([H, delta], list(map(len, parts)))
    grid = replace(grid, delta=sizes, areas=sizes**d)
    return prepare(moving(grid, (0.0, 0.0), Contact()), Options(threads=1))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("d", [2, 3])
def test_forces_are_equal_and_opposite_and_the_gradient_of_the_energy(d: int) -> None:
    prepared, depth = on_a_wall(d), 0.05 * H
    shift = np.array([*(d - 1) * (3.3 * H,), -depth])
    found, state = pressed(prepared, shift)
    assert prepared.system.contact is not None
    below = prepared.system.model.grid.bodies.number == 0  # type: ignore[union-attr]
    assert np.abs(found.sum(axis=0)).max() < 1e-14 * np.abs(found).sum()
    energy, way = [], 1e-4 * depth
    for sign in (1, -1):
        _, state = pressed(prepared, shift + sign * way * np.eye(d)[-1])
        energy.append(float(np.sum(prepared.system.area * prepared.system.contact.energies(state)[0])))
    assert found[~below, -1].sum() == pytest.approx(-(energy[0] - energy[1]) / (2 * way), rel=1e-6)


@pytest.mark.slow
@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(("d", "delta"), [(2, H), (2, 0.5 * H), (2, 0.7 * H), (3, H)])
def test_a_body_slides_along_a_row_without_interlocking(d: int, delta: float) -> None:
    prepared = on_a_wall(d, delta)
    along = [pressed(prepared, np.array([s * H, *(d - 2) * (0.3 * H,), -0.02 * H]))[0] for s in np.linspace(2, 3, 21)]
    below = prepared.system.model.grid.bodies.number == 0  # type: ignore[union-attr]
    forces = np.array([forces[~below].sum(axis=0) for forces in along])
    normal = forces[:, -1].mean()
    assert normal > 0
    assert np.abs(forces[:, 0]).max() / normal < 0.01  # .003 in the plane, .004 in space
    assert np.ptp(forces[:, -1]) / normal < (0.005 if d == 2 else 0.05)


def test_pairs_hold_no_more_than_they_are_allowed_and_what_they_hold_less_is_lost() -> None:
    prepared = on_a_wall(2)
    _, state = pressed(prepared, np.array([3.3 * H, -0.05 * H]))
    contact = prepared.system.contact
    assert contact is not None
    pairs, before = contact._pairs, contact._pressed_energies(state)
    pressing, lost, touch = before > 0, np.zeros(len(state.value)), contact._pairs.touch.copy()
    assert 5 < pressing.sum() < len(before)
    ease(pairs, state.value, 0.25 * before, lost)
    eased = contact._pressed_energies(state)
    assert eased == pytest.approx(0.25 * before, rel=1e-9)
    depth = contact._pressed(state.value)[2][pressing, 1]
    assert touch[pressing] - pairs.touch[pressing] == pytest.approx(depth, rel=1e-9)  # half of what it was
    assert np.array_equal(touch[~pressing], pairs.touch[~pressing])
    assert not lost.any()
    touch = pairs.touch.copy()
    ease(pairs, state.value, 3 * eased, lost)
    assert np.array_equal(pairs.touch, touch)
    assert lost.sum() == pytest.approx(2 * eased.sum(), rel=1e-12)
    assert lost[pairs.i[np.argmax(eased)]] > 0.9 * eased.max() > 0
    ease(pairs, state.value, np.zeros(len(before)), lost)
    assert contact._pressed_energies(state).sum() < 1e-12 * before.sum()


def closed(crack: bool, contact: bool, side: int = 40) -> tuple[float, PreparedRun]:
    """Force on the top of a unit plate, pressed together by .001, with a crack across half of it; N/m."""
    scene = Scene(box(0, 0, 1, 1), 1 / side, UNIT, run=Run(damping=2.0))
    scene = scene.crack([(0, 0.5 + 0.5 / side), (0.5, 0.5 + 0.5 / side)]) if crack else scene
    for end, sign in (("bottom", 1), ("top", -1)):
        scene = scene.fix(end, x=None, y=sign * 5e-4, profile=ramp(6.0))
    built = build(scene.contact() if contact else scene)
    prepared = prepare(Model(built.grid, built.settings), Options(threads=1))
    steps = int(12 / prepared.system.time_step)
    prepared.advance(1, steps + 1)
    return compute_condition_forces(*prepared, steps, 12.0)[1].force_y, prepared


@pytest.mark.slow
def test_a_crack_closes_under_compression() -> None:
    whole, _ = closed(False, False)
    gaping, _ = closed(True, False)
    found, (system, state) = closed(True, True)
    assert gaping / whole < 0.6  # .57
    assert found / whole == pytest.approx(1.0, abs=0.03)  # .997
    assert system.contact is not None
    pairs = system.contact._pressed(state.value)[2]
    assert 0 < pairs[:, 1].max() < 0.05 / 40  # .002 of a spacing
    last = compute_energy_balance_row(system, state, 1)
    assert abs(last.balance_error(0.0)) < 1e-5  # 3e-8


def two(run: Run, **more: Any) -> Model:
    """Two short bars of a plane that meet askew."""
    parts = [bar(0, 0.2, H, 6), bar(0.2, 0.2, H, 6) + np.array([0.0, 0.015])]
    return moving(grid_of(parts, H), (1e-2, 0.0), Contact(**more), run)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*contact.restitution.*with bodies that deform")
@pytest.mark.parametrize(("friction", "restitution"), [(0.0, 1.0), (0.4, 1.0), (0.1, 0.8)])
def test_a_resumed_run_has_the_same_bits(friction: float, restitution: float, tmp_path: Path) -> None:
    run = Run(steps=120, every=10, ledger=10)
    model = two(run, friction=friction, restitution=restitution)
    whole = simulate(model, options=Options(threads=1))
    count = 0

    def stop(_: object) -> bool:
        nonlocal count
        count += 1
        return count > 6

    path = tmp_path / "stopped.sqlite"
    simulate(model, path, Options(threads=1), stop).close()
    resume(path, threads=2)
    from pdsolve import Results

    with Results.open(path) as again:
        for name in ("ux", "uy", "vx", "vy"):
            assert np.array_equal(whole.field(name, 120), again.field(name, 120))


def test_nodes_that_meet_head_on_are_not_pulled_along_the_face() -> None:
    """Opposite each other, and between two: where the weight has a kink round-off alone would tell the side."""
    prepared, depth = on_a_wall(2), 0.05 * H
    for shift in (2 * H, 2.5 * H):
        forces = pressed(prepared, np.array([shift, -depth]))[0]
        block = forces[-36:].reshape(6, 6, 2)
        assert np.abs(block[:, 0, 0]).max() < 1e-12 * np.abs(block[1:-1, 0, 1]).max()
        assert block[1:-1, 0, 1].min() > 0


@pytest.mark.slow
@pytest.mark.quick_cases(3)
@pytest.mark.filterwarnings("ignore:.*breaking bonds:pdsolve.model.ModelWarning")
@pytest.mark.parametrize(("G0", "rigid"), [(1e9, False), (1e9, True), (2e-5, False), (1e-4, True)])
def test_a_mirror_image_stays_one(G0: float, rigid: bool) -> None:
    """A block that hits a plate in its middle, with friction: forces of nodes in a row keep their line."""
    h, v = 1 / 64, 0.1 if rigid else 0.05  # places are exact
    plate, block = (
        np.stack(np.meshgrid(x, y), -1).reshape(-1, 2) for x, y in (sides(12, 48, 0, h), sides(10, 10, -10, h))
    )
    grid = grid_of([plate, block], h)
    own = tuple(grid.ids[len(plate) :].tolist())
    moves = RigidBody(nodes=own, mass=0.1, x=v) if rigid else InitialVelocity(nodes=own, x=v, y=0.0)
    material = msgspec.structs.replace(UNIT, G0=G0)
    settings = Settings(material=material, conditions=(moves,), contact=Contact(friction=0.3, restitution=0.9))
    system, state = prepared = prepare(Model(grid, settings), Options(threads=1))
    prepared.advance(1, 101)
    x, y = np.round(grid.position / h * 2).astype(int).T
    order, other, of = np.lexsort((y, x)), np.lexsort((-y, x)), compute_node_damage(system)
    assert (of.max() > 0.5) == (G0 < 1)
    assert np.array_equal(of[order], of[other])
    u = state.value[other] * [1, -1]
    assert u == pytest.approx(state.value[order], rel=0, abs=1e-13 * np.abs(u).max())  # 2e-15 to 5e-15


def sides(columns: int, rows: int, first: int, h: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places of columns from `first` on, and of rows about y = 0."""
    return h * (first + np.arange(columns) + 0.5), h * (np.arange(-rows // 2, rows // 2) + 0.5)


@pytest.mark.parametrize(
    ("assigned", "named"),
    [
        (("contact.friction", "-0.1"), "friction"),
        (("contact.restitution", "0.05"), "restitution"),
        (("contact.restitution", "1.1"), "restitution"),
        (("run.adapt", "hybrid"), "$.run.adapt"),
        (("run.cracks", "particles"), "$.run.cracks"),
        (("run.start", "static"), "$.run.start"),
        (("run.solver", "implicit"), "$.run.solver"),
    ],
)
def test_what_contact_does_not_go_with_is_refused(assigned: tuple[str, str], named: str, tmp_path: Path) -> None:
    path = tmp_path / "two.json"
    path.write_text(two(Run()).to_json(), encoding="utf-8")
    with pytest.raises(ModelError, match=naming(named)):
        prepare(read_model(path, assignments=[assigned]), Options())


def test_the_thesis_mode_is_refused() -> None:
    with pytest.raises(ModelError, match=naming("mode", found="thesis", expected=("conservative", "bodies touch"))):
        prepare(two(Run()), Options(mode="thesis"))


def test_bodies_that_overlap_are_named_with_the_depth() -> None:
    parts = [bar(0, 0.2, H, 6), bar(0.2, 0.2, H, 6) - np.array([0.8 * H, 0.0])]
    model = moving(grid_of(parts, H), (0.0, 0.0), Contact())
    with pytest.raises(ModelError, match=naming("$.bodies", found=("body 0", "body 1", "0.008"), expected="touch")):
        prepare(model, Options())
    overlapping = Scene(box(0, 0, 1, 1), 0.1, UNIT)
    with pytest.raises(ValueError, match=naming("disc", found=("0.2", "plate"), expected="touch")):
        overlapping.body(box(0.8, 0, 2, 1), "disc")


def test_a_stiffness_that_the_step_does_not_allow_is_refused() -> None:
    step = prepare(two(Run()), Options()).system.time_step
    with pytest.raises(ModelError, match=naming("$.contact.stiffness", found=1500, expected="steps")):
        prepare(two(Run(time_step=step), stiffness=1500.0), Options())


def test_the_stable_step_takes_the_stiffness_of_contact() -> None:
    steps = [prepare(two(Run(), stiffness=k), Options()).system.time_step for k in (1.0, 15.0, 150.0)]
    assert steps[0] > 1.1 * steps[1] > 2 * steps[2]
    settings = msgspec.structs.replace(two(Run()).settings, contact=None)
    assert prepare(replace(two(Run()), settings=settings), Options()).system.time_step > steps[0]


def test_contact_adds_two_faces_to_the_bound() -> None:
    """Of nodes like it: two pairs of its stiffness, each over its cell."""
    model, contact = two(Run()), two(Run()).settings.contact
    volume = model.grid.delta**2
    assert contact is not None
    k = pair_stiffness(model, contact)
    assert touch_bound(model, volume) == pytest.approx(2 * k * volume)
