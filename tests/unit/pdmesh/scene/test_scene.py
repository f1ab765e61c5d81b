"""The Python front door, and what it refuses."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from messages import naming
from plates import GEOMETRIES, GLASS

from pdmesh import Body, Box, Circle, Material, Scene, SceneError, Sphere, box, ramp
from pdmesh.drawing.geo import read_geo
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Absorb, Acceleration, Displacement, InitialVelocity, Load, Run, Velocity, encode
from pdmesh.model.node_grid import document_of

NAN = float("nan")


def test_every_method_returns_a_new_scene(plate: Scene) -> None:
    steps: list[Callable[[Scene], Scene]] = [
        lambda scene: scene.hole(Circle(0.01, 0.01, 0.002)),
        lambda scene: scene.notch([(0.018, 0.02), (0.02, 0.016), (0.022, 0.02)]),
        lambda scene: scene.crack([(0.03, 0.0105), (0.04, 0.0105)]),
        lambda scene: scene.zone(box(0.02, 0, 0.04, 0.02), 5e-4),
        lambda scene: scene.refine("hole", 1e-3),
        lambda scene: scene.region(box(0, 0, 0.01, 0.02), Material(E=1e9, rho=1000, G0=10)),
        lambda scene: scene.load("top", traction=(0, 1e6)),
        lambda scene: scene.fix("bottom"),
        lambda scene: scene.move("left", velocity=(1, None)),
    ]
    for step in steps:
        before = dataclasses.asdict(plate)
        after = step(plate)
        assert after != plate
        assert dataclasses.asdict(plate) == before
        plate = after
    with pytest.raises(dataclasses.FrozenInstanceError):
        plate.spacing = 1.0  # type: ignore[misc]


@pytest.mark.slow
def test_python_and_gmsh_draw_the_same_grid() -> None:
    drawn, settings, _ = build_grid(read_geo(GEOMETRIES / "duran50.geo"))
    scene = (
        Scene(box(0, -0.02, 0.1, 0.02), 2e-3, GLASS, 4, Run(25e-9, 1700, 50))
        .zone(box(0, -0.011, 0.1, 0.011), 1e-3, grown=False)
        .crack([(0, 0), (0.05, 0)])
        .load("top", traction=(0, 12e6), rows=4)
        .load("bottom", traction=(0, -12e6), rows=4)
    )
    written, others, _ = build_grid(scene)
    for field in ("position", "delta", "border", "hole_id", "cracks"):
        assert np.array_equal(getattr(written, field), getattr(drawn, field)), field
    assert written.areas == pytest.approx(drawn.areas, rel=1e-12)
    assert others == settings


@pytest.mark.slow
def test_python_scenes_need_no_gmsh() -> None:
    script = (
        "import sys, pathlib; sys.modules['gmsh'] = None\n"
        "from pdmesh.drawing.file_reading import build_file\n"
        f"print(len(build_file(pathlib.Path({str(GEOMETRIES / 'duran50_one_scale.py')!r}), trust=True).grid))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "4242\n"


@pytest.mark.process
def test_import_loads_nothing_heavy() -> None:
    script = (
        "import sys, pdmesh, pdmesh.__main__ as it; it.parser()\n"
        "print(sorted({'gmsh', 'numpy', 'shapely', 'matplotlib', 'msgspec'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_all_conditions_reach_the_file(plate: Scene) -> None:
    table = ((0.0, 0.0), (1e-6, 1.0), (2e-6, 0.5))
    scene = (
        plate.load("top", traction=(0, 1e6), rows=3, profile=ramp(1e-6), name="pull")
        .load(box(0.0095, 0.0045, 0.0125, 0.0065), body_force=(1e9, 0), breakable=True)
        .fix("bottom", x=None)
        .move([(0, 0), (0, 0.02)], velocity=(32, None), profile=table)
        .move("right", acceleration=(None, 5.0))
        .move(Circle(0.02, 0.01, 0.0011), initial_velocity=(1, 2))
    )
    _, settings, _ = build_grid(scene)
    pull, force, held, speed, thrust, start = settings.conditions
    assert isinstance(pull, Load)
    assert (pull.name, pull.traction, pull.rows, pull.length) == ("pull", (0, 1e6), 3, pytest.approx(0.04))
    assert pull.profile == ((0, 0), (1e-6, 1))
    assert len(pull.nodes or ()) == 41 * 3
    assert isinstance(force, Load)
    assert (force.body_force, force.traction, force.breakable) == ((1e9, 0), None, True)
    assert len(force.nodes or ()) == 3 * 2
    assert held == Displacement(name="bottom", nodes=tuple(range(1, 42)), y=0.0, corrected=True)
    assert isinstance(speed, Velocity)
    assert (speed.x, speed.y, speed.profile, len(speed.nodes or ())) == (32, None, table, 21)
    assert isinstance(thrust, Acceleration)
    assert (thrust.x, thrust.y) == (None, 5)
    assert isinstance(start, InitialVelocity)
    assert (start.x, start.y, len(start.nodes or ())) == (1, 2, 5)


def test_a_layer_that_absorbs_is_as_deep_as_is_said(plate: Scene) -> None:
    """1 mm nodes, m = 3: by itself a layer is 12 horizons deep."""
    for scene, rows, depth in ((plate.absorb("right"), 37, 36e-3), (plate.absorb("right", 2.5e-3, "quiet"), 3, 2.5e-3)):
        _, settings, _ = build_grid(scene)
        (layer,) = settings.conditions
        assert isinstance(layer, Absorb)
        assert (len(layer.nodes or ()), layer.depth) == (21 * rows, pytest.approx(depth))
    assert build_grid(plate.absorb(box(0.03, 0, 0.04, 0.02)))[1].conditions[0].name == "box at (0.035, 0.01) m"


def test_body_force_over_rows_of_a_curve(plate: Scene) -> None:
    grid, settings, _ = build_grid(plate.load("right", body_force=(1e9, 0), rows=2))
    (load,) = settings.conditions
    x = grid.position[np.array(load.nodes) - 1, 0]
    assert sorted(set(np.round(x * 1e3, 9))) == [39, 40]


def test_several_materials(plate: Scene) -> None:
    steel = Material(E=2e11, rho=7800, G0=1e4, law="bilinear", kr=2.0, nu=0.3)
    grid, settings, _ = build_grid(plate.region(box(0, 0, 0.01, 0.02), steel, "steel"))
    (region,) = settings.regions
    assert region.material == steel
    assert (grid.position[np.array(region.nodes) - 1, 0] <= 0.01 + 1e-9).all()
    assert len(region.nodes or ()) == 11 * 21


def test_sides_of_a_plate_of_several_edges() -> None:
    scene = Scene(
        [(0, 0), (0.04, 0), (0.04, 0.01), (0.03, 0.01), (0.03, 0.02), (0.04, 0.02), (0.04, 0.03), (0, 0.03)], 1e-3
    )
    assert scene.edge("right").length == pytest.approx(0.02)
    assert scene.edge("left").length == pytest.approx(0.03)


def test_chords_follow_the_spacing() -> None:
    coarse, fine = (Circle(0, 0, 0.01).polygon(spacing) for spacing in (1e-3, 1e-4))
    for polygon, spacing in ((coarse, 1e-3), (fine, 1e-4)):
        corners = shapely.get_coordinates(polygon)
        sagitta = 0.01 - np.hypot(*((corners[1:] + corners[:-1]) / 2).T).min()
        assert 0.2 * 0.01 * spacing < sagitta <= 0.01 * spacing


def test_models_keep_what_they_were_built_with(plate: Scene) -> None:
    scene = dataclasses.replace(plate, area_rule="eq19", source="plate.py", drawing="text\n", parameters=(("a", 1.0),))
    grid, settings, _ = build_grid(scene)
    document = document_of(grid, settings)
    assert (document.area_rule, document.source, document.drawing) == ("eq19", "plate.py", "text\n")
    assert b'"drawing": "text\\n"' in encode(document)


BAD: dict[str, tuple[Callable[[Scene], Any], str]] = {
    "self-crossing outline": (
        lambda _: Scene([(0, 0), (0.01, 0.01), (0.01, 0), (0, 0.01)], 1e-3),
        naming("outline", found="Self-intersection[0.005 0.005]"),
    ),
    "flat outline": (lambda _: Scene([(0, 0), (0.01, 0), (0.02, 0)], 1e-3), "outline"),
    "two points": (lambda _: Scene([(0, 0), (1, 1)], 1e-3), naming("outline", found="2 points", expected="3")),
    "nan outline": (lambda _: Scene([(0, 0), (NAN, 0), (0, 1)], 1e-3), "not finite"),
    "not points": (lambda _: Scene([1, 2, 3], 1e-3), naming("outline", found="[1, 2, 3]", expected=("list", "points"))),  # type: ignore[list-item]
    "negative spacing": (lambda _: Scene(box(0, 0, 1, 1), -1e-3), naming("spacing", found="-0.001", expected="0 m")),
    "nan spacing": (lambda _: Scene(box(0, 0, 1, 1), NAN), "spacing is nan"),
    "huge spacing": (lambda _: Scene(box(0, 0, 1, 1), 3.0), naming(found="3 m", expected=("1 x 1 m", "--unit mm"))),
    "tiny spacing": (lambda _: Scene(box(0, 0, 1, 1), 1e-6), r"about 1e\+12 nodes"),
    "millimetres": (lambda _: Scene(box(0, 0, 100, 40), 1), naming(expected=("metres", "millimetres"))),
    "N-mm-tonne": (
        lambda _: Scene(box(0, 0, 1, 1), 0.1, Material(E=2e5, rho=7.8e-9, G0=10)),
        naming("material", found=("E = 200000", "rho = 7.8e-09"), expected=("Pa", "t/mm^3")),
    ),
    "horizon": (lambda _: Scene(box(0, 0, 1, 1), 0.1, horizon=0.5), "horizon is 0.5"),
    "hole outside": (lambda plate: plate.hole(Circle(1, 1, 0.1)), naming("hole 1", found=("outside", "plate"))),
    "hole of no size": (lambda plate: plate.hole(Circle(0.01, 0.01, -1)), "positive radius"),
    "nothing left": (lambda plate: plate.hole(box(-1, -1, 1, 1)), "leave nothing"),
    "notch inside": (lambda plate: plate.notch(box(0.01, 0.01, 0.02, 0.015)), naming("notch 1", found="no point")),
    "crack outside": (
        lambda plate: plate.crack([(0.03, 0.01), (0.05, 0.01)], "long"),
        naming("crack 'long'", found="(0.05, 0.01) m"),
    ),
    "crack through a hole": (
        lambda plate: plate.hole(Circle(0.02, 0.01, 0.003)).crack([(0.01, 0.0105), (0.03, 0.0105)]),
        naming("crack '1'", found=("outside", "plate")),
    ),
    "crack of a point": (lambda plate: plate.crack([(0.01, 0.01), (0.01, 0.01)]), naming("crack '1'", found="0 m")),
    "nan crack": (lambda plate: plate.crack([(0.01, 0.01), (NAN, 0.01)]), "crack '1' has a coordinate"),
    "zone outside": (lambda plate: plate.zone(box(1, 1, 2, 2), 5e-4, "far"), naming("zone 'far'", found="outside")),
    "zone of a wrong ratio": (
        lambda plate: plate.zone(box(0, 0, 0.02, 0.02), 4e-4),
        naming("spacing", "zone '1'", found="0.0004 m", expected=("0.001 m", "2")),
    ),
    "overlapping zones of wrong ratios": (
        lambda plate: plate.zone(box(0, 0, 0.02, 0.02), 5e-4, "a").zone(box(0.01, 0, 0.03, 0.02), 1e-3 / 3, "b"),
        naming("spacing", "zone 'b'", found="0.000333333 m", expected=("coarsest", "spacing")),
    ),
    "coarser zone": (lambda plate: plate.zone(box(0, 0, 0.02, 0.02), 2e-3), "over a power of 2"),
    "zone of two names": (
        lambda plate: plate.zone(box(0, 0, 0.02, 0.02), 5e-4, "a").zone(box(0, 0, 0.02, 0.02), 5e-4, "a"),
        naming("zone 'a'", found="2"),
    ),
    "tiny zone": (lambda plate: plate.zone(box(0, 0, 1e-4, 1e-4), 5e-4), naming(expected=("less", "size"))),
    "refine nothing known": (lambda plate: plate.refine("edge", 1e-3), "refine: 'edge'"),
    "refine by nan": (lambda plate: plate.refine("crack", NAN), naming("crack", "distance", found="nan")),
    "region outside": (lambda plate: plate.region(box(1, 1, 2, 2), Material(1e9, 1e3, 1)), "m' is outside"),
    "load without a value": (lambda plate: plate.load("top"), naming("load 'top'", expected='force')),
    "traction in a surface": (
        lambda plate: plate.load(box(0, 0, 0.01, 0.01), traction=(0, 1)),
        naming("'box at (0.005, 0.005) m'", found=("traction", "surface")),
    ),
    "nan load": (lambda plate: plate.load("top", traction=(0, NAN)), naming("load 'top'", found="nan")),
    "load of words": (lambda plate: plate.load("top", traction=("a", 1)), naming("load 'top': traction", found="a")),
    "unknown side": (lambda plate: plate.load("up", traction=(0, 1)), naming("load 'up'", expected="left")),
    "no straight side": (lambda _: Scene(Circle(0, 0, 0.01), 1e-3).fix("top"), "no straight edge at the top"),
    "no rows": (lambda plate: plate.load("top", traction=(0, 1), rows=0), "rows is 0"),
    "far away": (lambda plate: plate.fix([(1, 1), (2, 2)]), naming("'line at (1.5, 1.5) m'", found="away")),
    "nothing fixed": (lambda plate: plate.fix("top", None, None), naming("displacement 'top'", found="component")),
    "moved twice": (lambda plate: plate.move("top", velocity=(1, 1), acceleration=(1, 1)), "2 of velocity"),
    "profile backwards": (
        lambda plate: plate.fix("top", profile=((1.0, 0.0), (0.5, 1.0))),
        naming("profile", "displacement 'top'", found=("0.5 s", "1 s")),
    ),
    "profile of an initial velocity": (
        lambda plate: plate.move("top", initial_velocity=(1, 0), profile=ramp(1)),
        naming(expected=("initial", "velocity")),
    ),
    "layers of a width and a shape": (
        lambda plate: plate.absorb(box(0.03, 0, 0.04, 0.02), 1e-3, "layer"),
        naming("absorb 'layer'", found=("width", "surface")),
    ),
    "layers without a width": (
        lambda plate: plate.absorb("top", 0.0),
        naming("width", "absorb 'top'", found="0 m", expected="0 m"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_scenes(name: str, plate: Scene) -> None:
    make, message = BAD[name]
    with pytest.raises(SceneError, match=message) as caught:
        make(plate)
    assert "\n" not in str(caught.value)


def test_what_has_no_name_is_called_by_its_place(plate: Scene) -> None:
    whole = plate.load([(0, 0), (0.04, 0)], (0, 1)).fix(Circle(0.02, 0.01, 2e-3)).move("left", initial_velocity=(1, 0))
    whole = whole.region(box(0, 0, 0.01, 0.01) - box(0, 0, 0.005, 0.005), Material(1e9, 1e3, 1))
    names = [each.action.name for each in whole.conditions] + [each.region.name for each in whole.regions]
    assert names == ["line at (0.02, 0) m", "circle at (0.02, 0.01) m", "left", "shape at (0.005, 0.005) m"]
    solid = Body(Box((0, 0, 0), (1, 1, 1)), 0.1).fix(Box((0, 0, 0), (1, 1, 0.2))).load("top", (0, 0, 1))
    solid = solid.load(Sphere((0.5, 0.5, 0.5), 0.2), body_force=(1, 0, 0)).move(
        Box((0, 0, 0), (1, 1, 1)) - Sphere((0.5, 0.5, 0.5), 0.2), velocity=(1, 0, 0)
    )
    assert [each.action.name for each in solid.conditions] == [
        "box at (0.5, 0.5, 0.1) m", "top", "sphere at (0.5, 0.5, 0.5) m", "solid",
    ]  # fmt: skip


def test_a_large_plate_can_be_meant() -> None:
    assert Scene(box(0, 0, 100, 40), 1, units="m").shape.area == 4000


def test_a_condition_that_finds_no_node(plate: Scene) -> None:
    with pytest.raises(SceneError, match=naming("'box at (0.0105, 0.0105) m'", found="node")):
        build_grid(plate.load(box(0.0102, 0.0102, 0.0108, 0.0108), body_force=(1, 0)))


def test_rows_around_a_hole(plate: Scene) -> None:
    scene = plate.hole(Circle(0.02, 0.01, 0.005))
    grid, settings, _ = build_grid(scene.load(scene.holes[0].exterior, body_force=(1e9, 0), rows=2))
    radius = np.hypot(*(grid.position - (0.02, 0.01)).T)
    (load,) = settings.conditions
    assert load.nodes == tuple(grid.ids[radius < 0.007 * (1 - 1e-3)].tolist())
