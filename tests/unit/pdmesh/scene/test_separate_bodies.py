"""Several bodies in one scene: nodes, materials and velocities of each, in the file, in info and in drawings."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh import Body, GridError, Heat, Material, Run, Scene, SceneError, box, build
from pdmesh.drawing.plate_of_groups import Group, scene_of
from pdmesh.model.contradictions import Case
from pdmesh.model.document import InitialVelocity, Region, RigidBody, read_document
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.node_grid import grid_of
from pdmesh.model.possible import impossible
from pdmesh.model.selection import check
from pdmesh.reports.report import info, info_lines
from pdmesh.scene.solids import brick
from pdsolve.checks import refuse_combinations
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

STEEL, BRASS = Material(E=2e11, rho=7800.0, G0=1e4), Material(E=1e11, rho=8500.0, G0=1e4)
MM = 1e-3


def scene() -> Scene:
    """A plate, and a finer brass one that touches it and moves to the left."""
    plate = Scene(box(0, 0, 20 * MM, 10 * MM), MM, STEEL)
    return plate.body(box(20 * MM, 0, 26 * MM, 10 * MM), "striker", 0.5 * MM, BRASS, (-3.0, 0.0))


def test_each_body_has_nodes_half_a_spacing_inside_its_outline() -> None:
    built = build(scene())
    grid = built.grid
    assert grid.bodies is not None
    assert grid.bodies.names == ("plate", "striker")
    assert np.bincount(grid.bodies.number).tolist() == [200, 240]
    striker = grid.bodies.number == 1
    assert grid.position[~striker].max(axis=0) == pytest.approx([19.5 * MM, 9.5 * MM])
    assert grid.position[striker].min(axis=0) == pytest.approx([20.25 * MM, 0.25 * MM])
    assert grid.areas == pytest.approx(grid.delta**2)
    assert built.settings.contact == Contact()


def test_no_bond_joins_two_bodies_and_each_has_its_material_and_velocity() -> None:
    built = build(scene())
    model = Model(built.grid, built.settings)
    system, state = prepare(model, Options(threads=1))
    assert built.grid.bodies is not None
    striker = built.grid.bodies.number == 1
    source, target = system.operator.bonds()
    assert len(source) > 0
    assert not (striker[source] != striker[target]).any()
    assert set(model.rho[striker]) == {8500.0}
    assert set(model.rho[~striker]) == {7800.0}
    assert set(state.rate[striker, 0]) == {-3.0}
    assert set(state.rate[~striker, 0]) == {0.0}
    assert [type(each) for each in built.settings.conditions] == [InitialVelocity]


SPIN = 200.0


@pytest.mark.slow
def test_a_body_that_spins_keeps_its_momentum_and_its_angular_momentum() -> None:
    plate = Scene(box(0, 0, 9 * MM, 9 * MM), MM, STEEL, run=Run(steps=400))
    built = build(plate.body(box(40 * MM, 0, 60 * MM, 11 * MM), "turns", None, BRASS, (0.1, 0.0), SPIN))
    part = Region(box=(0.04, 0.0, 0.047, 0.011), material=STEEL)
    model = Model(built.grid, msgspec.structs.replace(built.settings, regions=(*built.settings.regions, part)))
    system, state = prepared = prepare(model, Options(threads=1))
    assert built.grid.bodies is not None
    own = built.grid.bodies.number == 1
    mass, found = (model.rho * system.area)[own], []
    for first, last in ((1, 1), (1, 401)):
        prepared.advance(first, last)
        x, v = (built.grid.position + state.value)[own], state.rate[own]
        mean = mass @ v / mass.sum()
        arm, way = x - mass @ x / mass.sum(), v - mean
        found.append([*mean, mass @ (arm[:, 0] * way[:, 1] - arm[:, 1] * way[:, 0]), mass @ (arm**2).sum(axis=1)])
    (x_way, y_way, turns, inertia), last = found
    assert (x_way, y_way, turns / inertia) == pytest.approx((0.1, 0.0, SPIN), rel=1e-12, abs=1e-12)
    assert not state.value[~own].any()
    assert last[:3] == pytest.approx(found[0][:3], rel=1e-11, abs=1e-13)
    assert last[3] != inertia  # bonds hold it against its spin


def prepared(model: Model) -> object:
    return prepare(model, Options(threads=1))


def on_ranks(model: Model) -> None:
    refuse_combinations(model, Options(team=Mock()))


@pytest.mark.parametrize(("adapt", "refuse"), [("split", prepared), ("none", on_ranks)])
def test_a_spin_is_refused_where_not_the_whole_body_is_known(adapt: str, refuse: Callable[[Model], object]) -> None:
    built, start = build(Scene(box(0, 0, 9 * MM, 9 * MM), MM, STEEL)), InitialVelocity(box=(0, 0, 1, 1), spin=SPIN)
    run = msgspec.structs.replace(built.settings.run, adapt=adapt)
    model = Model(built.grid, msgspec.structs.replace(built.settings, conditions=(start,), run=run))
    with pytest.raises(ModelError, match=naming("$.conditions[0].spin", found="200", expected="0")):
        refuse(model)


def test_a_spin_is_one_number_in_a_plate() -> None:
    built, turns = build(Scene(box(0, 0, 9 * MM, 9 * MM), MM, STEEL)), InitialVelocity(nodes=(1,), spin=(0.0, 0.0, 1.0))
    with pytest.raises(GridError, match=naming("$.conditions[0].spin", found="3 numbers", expected="one")):
        check(msgspec.structs.replace(built.settings, conditions=(turns,)), built.grid, "plate")
    with pytest.raises(SceneError, match=naming("body 'b': spin", found="nan")):
        build(scene().body(box(0, 20 * MM, 9 * MM, 29 * MM), "b", spin=float("nan")))


def test_the_file_carries_bodies_and_contact(tmp_path: Path) -> None:
    path = tmp_path / "two.json"
    build(scene().contact(friction=0.3)).write(path)
    document = read_document(path.read_bytes(), "two")
    grid = grid_of(document, "two")
    assert grid.bodies is not None
    assert np.bincount(grid.bodies.number).tolist() == [200, 240]
    assert document.contact == Contact(friction=0.3)
    said = "\n".join(info_lines(info(document, "two")))
    for words in ("body 'plate': 200 nodes", "body 'striker': 240 nodes", "friction = 0.3"):
        assert words in said


@pytest.mark.parametrize(("nodes", "found"), [("[999]", 999), ("[]", "empty"), ("[1],[1]", 1)])
def test_a_body_of_wrong_nodes_is_refused(nodes: str, found: object, tmp_path: Path) -> None:
    one = build(Scene(box(0, 0, 5 * MM, 5 * MM), MM, STEEL)).document
    path = tmp_path / "one.json"
    from pdmesh.model.document import write_file

    write_file(one, path)
    lists = ", ".join(f'{{"name": "b{at}", "nodes": [{each}]}}' for at, each in enumerate(nodes[1:-1].split("],[")))
    text = path.read_text(encoding="utf-8").replace('"nodes": [\n', f'"bodies": [{lists}],\n"nodes": [\n')
    with pytest.raises(GridError, match=naming("$.bodies", found=found)):
        grid_of(read_document(text, "one"), "one")


@pytest.mark.parametrize("name", ["", "plate", "striker"])
def test_names_of_bodies_are_their_own(name: str) -> None:
    with pytest.raises(SceneError, match=naming("body", expected="own")):
        scene().body(box(0, 20 * MM, 9 * MM, 29 * MM), name)


def ring(x0: float, y0: float, x1: float, y1: float) -> tuple[list[list[float]], ...]:
    corners = [[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]]
    return tuple([corners[i], corners[(i + 1) % 4]] for i in range(4))


def test_a_drawing_has_bodies_in_groups() -> None:
    groups = [
        Group("zone:plate", 2, surfaces=(ring(0, 0, 0.02, 0.01),)),
        Group("body:striker", 2, surfaces=(ring(0.02, 0, 0.026, 0.01),)),
    ]
    values: dict[str, float | str] = {
        "Zones/plate/Spacing": MM,
        "Material/E": 2e11,
        "Material/rho": 7800.0,
        "Material/G0": 1e4,
        "Bodies/striker/Spacing": 0.5 * MM,
        "Bodies/striker/rho": 8500.0,
        "Bodies/striker/Velocity x": -3.0,
        "Bodies/striker/Spin": 7.0,
        "Contact/Friction": 0.2,
        "Contact/Restitution": 0.7,
    }
    found = scene_of(groups, {f"Peridynamics/{name}": value for name, value in values.items()}, "two.geo")
    (body,) = found.bodies
    assert (body.name, body.spacing, body.velocity, body.spin) == ("striker", 0.5 * MM, (-3.0, 0.0), 7.0)
    assert body.material == Material(E=2e11, rho=8500.0, G0=1e4)
    assert found.touching == Contact(friction=0.2, restitution=0.7)


def drawn(**more: float | str) -> Scene:
    """The scene of a drawing with a plate and a body 'hammer' that has these parameters."""
    groups = [
        Group("zone:plate", 2, surfaces=(ring(0, 0, 0.02, 0.01),)),
        Group("body:hammer", 2, surfaces=(ring(0, 0.01, 0.005, 0.015),)),
    ]
    values: dict[str, float | str] = {"Zones/plate/Spacing": MM, "Material/E": 2e11, "Material/rho": 7800.0}
    values |= {"Material/G0": 1e4, **{f"Bodies/hammer/{name.replace('_', ' ')}": value for name, value in more.items()}}
    return scene_of(groups, {f"Peridynamics/{name}": value for name, value in values.items()}, "two.geo")


def test_a_body_of_a_drawing_can_be_rigid() -> None:
    built = build(drawn(Rigid=1.0, Mass=3.0, Velocity_y=-2.0, Spin=0.5, Held="x", Profile="ramp 1e-3", Radius=3 * MM))
    (body,) = built.settings.conditions
    assert isinstance(body, RigidBody)
    assert body.nodes == tuple(range(201, 226))
    assert (body.name, body.mass, body.x, body.y, body.spin, body.held) == ("hammer", 3.0, 0.0, -2.0, 0.5, ("x",))
    assert body.profile == ((0.0, 0.0), (1e-3, 1.0))
    assert body.radius == 3 * MM
    said = "\n".join(info_lines(info(built.document, "two")))
    assert "hammer" in said


@pytest.mark.parametrize(
    ("more", "named"),
    [({"Rigid": 1.0, "rho": 1e3}, "rho"), ({"Mass": 1.0}, "Mass"), ({"Rigid": 2.0}, "Rigid"), ({"Rigid": 1.0}, "mass")],
)
def test_parameters_of_a_rigid_body_are_those_of_no_other(more: dict[str, float], named: str) -> None:
    with pytest.raises(SceneError, match=naming("hammer", named, expected=re.compile("(?:leave it out|0 or 1|kg)"))):
        drawn(**more)


BLOCK = brick((0, 0, 0), (0.01, 0.01, 0.01))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lambda body: body.rigid(BLOCK, "b", spin=3.0), naming("rigid 'b'", "spin", found="3.0", expected="3")),
        (lambda body: body.rigid(BLOCK, "b", velocity="fast"), naming("rigid 'b'", "velocity", found="'fast'")),
        (lambda body: body.rigid(BLOCK, "b", held=5), naming("rigid 'b'")),
        (
            lambda body: body.body(body, "b", spacing=MM),
            naming("body 'b'", "spacing"),
        ),
        (lambda body: body.load("top", force=(0, 5.0)), naming("load 'top'", "force", expected="3")),
        (lambda body: body.load("top", force=(0, 5.0, np.nan)), naming("load 'top'", "force", expected="finite")),
        (lambda body: body.load("top"), naming("load 'top'", expected="force")),
    ],
)
def test_bodies_in_space_that_cannot_be(given: Callable[[Body], Body], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        given(Body(BLOCK, MM, STEEL))


def test_one_word_is_held_as_a_list_of_it() -> None:
    body = Body(BLOCK, MM, STEEL).rigid(BLOCK, "b", mass=1.0, held="spin")
    assert body.bodies[0].rigid is not None
    assert body.bodies[0].rigid.held == ("spin",)


def test_a_rigid_body_that_a_condition_holds_is_refused_where_it_is_built() -> None:
    wall = scene().rigid(box(30 * MM, 0, 40 * MM, 10 * MM), "wall", mass=1.0)
    assert build(wall).grid.bodies is not None
    with pytest.raises(GridError, match=naming("$.conditions[", "rigid", "held")):
        build(wall.fix(box(30 * MM, 0, 40 * MM, 10 * MM), x=0.0))


WARM = Material(E=70e9, rho=2500.0, G0=8.0, alpha=9e-6, T0=293.0)
TOGETHER: dict[str, tuple[Callable[[], Scene | Body], str, str]] = {
    "heat in a plate": (
        lambda: (
            Scene(box(0, 0, 20 * MM, 10 * MM), MM, WARM, medium=Heat(k=1.0, c=800.0))
            .body(box(21 * MM, 0, 26 * MM, 10 * MM), "striker")
            .temperature("left", 300.0)
        ),
        "$.physics is 'thermoelastic'",
        "contact transmits forces but no heat",
    ),
    "heat in space": (
        lambda: Body(brick((0, 0, 0), (5 * MM, 5 * MM, 5 * MM)), MM, WARM, medium=Heat(k=1.0, c=800.0)).body(
            brick((6 * MM, 0, 0), (9 * MM, 5 * MM, 5 * MM)), "striker"
        ),
        "$.physics is 'thermoelastic'",
        "contact transmits forces but no heat",
    ),
    "a fine zone": (
        lambda: scene().adapt("hybrid"),
        "$.run.adapt ('hybrid')",
        "adaptive cells exist for a single body only",
    ),
}


@pytest.mark.parametrize("case", TOGETHER)
def test_what_bodies_in_contact_do_not_take_is_refused_for_its_reason(case: str) -> None:
    """Not for a medium that the body beside lacks, or in words that fit any setting."""
    model, place, reason = TOGETHER[case]
    built = build(model())
    assert any(place in str(wrong) and reason in str(wrong) for wrong in impossible(Case(built.settings, 2)))
