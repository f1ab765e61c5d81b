"""Groups and parameters as a scene, without Gmsh; any of them may be wrong."""

from __future__ import annotations

import contextlib
import itertools
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import mentions, naming

from pdmesh import Scene, SceneError, build, k_field
from pdmesh.drawing.parameters import NAMES
from pdmesh.drawing.plate_of_groups import Group, scene_of
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Displacement, InitialVelocity, Load, Velocity
from pdmesh.model.values_of_place import Table
from pdmesh.scene.conditions import parse_profile


def ring(x0: float, y0: float, x1: float, y1: float) -> tuple[list[list[float]], ...]:
    corners = [[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]]
    return tuple([corners[i], corners[(i + 1) % 4]] for i in range(4))


CORNERS = [[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]
CROSSED = tuple([CORNERS[i], CORNERS[(i + 1) % 4]] for i in range(4))
TOP = Group("load:top", 1, curves=([[0, 0.01, 0], [0.02, 0.01, 0]],))
PLATE = Group("zone:plate", 2, surfaces=(ring(0, 0, 0.02, 0.01),))
BASE: dict[str, float | str] = {
    "Zones/plate/Spacing": 1e-3,
    "Loads/top/Traction y": 1e6,
    "Material/E": 65e9,
    "Material/rho": 2235.0,
    "Material/G0": 204.0,
}


def scene(values: dict[str, float | str] | None = None, *groups: Group) -> Scene:
    named = {f"Peridynamics/{name}": value for name, value in (BASE | (values or {})).items()}
    return scene_of([PLATE, TOP, *groups], named, "test.geo")


def test_every_parameter_has_its_place() -> None:
    found = scene(
        {
            "Loads/top/Rows": 3.0,
            "Loads/top/Profile": "0 0, 1e-6 1",
            "Loads/top/Breakable": 1.0,
            "Fixes/foot/Components": "y",
            "Fixes/foot/Displacement y": 1e-6,
            "Fixes/foot/Box": "0 0 0.02 0.0015",
            "Moves/side/Velocity x": 32.0,
            "Moves/side/Profile": "ramp 2e-6",
            "Moves/core/Initial velocity y": -3.0,
            "Material/nu": 0.2,
            "Material/Force law": "bilinear",
            "Material/kr": 1.6,
            "Material/Keep G0": 0.0,
            "Material/Micromodulus": "constant",
            "Materials/core/E": 1e9,
            "Horizon ratio": 4.0,
            "Area rule": "eq19",
            "Run/Time step": 1e-8,
            "Run/Duration": 1e-6,
            "Run/Frame every": 10.0,
            "Run/Solver": "static",
            "Run/Load steps": 7.0,
            "Run/Start": "static",
            "Run/Damping": 3.0,
            "Refine/crack/Distance": 1e-3,
            "Zones/plate/Grown": 0.0,
            "Plate/Anything/of the user's": 5.0,
        },
        Group("move:side", 1, curves=([[0, 0, 0], [0, 0.01, 0]],)),
        Group("move:core", 2, surfaces=(ring(0.01, 0.004, 0.014, 0.008),)),
        Group("material:core", 2, surfaces=(ring(0.01, 0.004, 0.014, 0.008),)),
        Group("crack:slit", 1, curves=([[0, 0.0052, 0], [0.004, 0.0052, 0]], [[0.004, 0.0052, 0], [0.006, 0.006, 0]])),
    )
    grid, model, _ = build_grid(found)
    load, fix, *moves = model.conditions
    assert isinstance(load, Load)
    assert (load.traction, load.rows, load.profile, load.breakable) == ((0, 1e6), 3, ((0, 0), (1e-6, 1)), True)
    assert isinstance(fix, Displacement)
    assert (fix.x, fix.y) == (None, 1e-6)
    assert fix.nodes == tuple(grid.ids[grid.position[:, 1] <= 0.0015].tolist())
    side = next(move for move in moves if isinstance(move, Velocity))
    assert (side.x, side.y, side.profile) == (32, None, ((0, 0), (2e-6, 1)))
    core = next(move for move in moves if isinstance(move, InitialVelocity))
    assert (core.x, core.y) == (None, -3)
    assert model.material is not None
    assert (model.material.nu, model.material.law, model.material.kr) == (0.2, "bilinear", 1.6)
    assert (model.material.keep_G0, model.material.micromodulus) == (False, "constant")
    (region,) = model.regions
    assert (region.material.E, region.material.rho, region.material.law) == (1e9, 2235, "bilinear")
    assert (model.horizon.ratio, model.area_rule) == (4, "eq19")
    assert (model.run.time_step, model.run.steps, model.run.every) == (1e-8, 100, 10)
    assert (model.run.solver, model.run.static.load_steps) == ("static", 7)
    assert (model.run.start, model.run.damping) == ("static", 3.0)
    (crack,) = found.cracks  # two curves of one group are one polyline
    assert len(crack.line.coords) == 3
    assert found.finest == 5e-4


def test_no_material_and_no_run_are_left_to_the_solver() -> None:
    named = {"Peridynamics/Zones/plate/Spacing": 1e-3}
    found = scene_of([PLATE], named, "bare.geo")
    assert found.material is None
    assert found.run.time_step is None


@pytest.mark.parametrize(
    ("text", "profile"),
    [
        ("constant", ()),
        ("", ()),
        ("ramp 1e-6", ((0, 0), (1e-6, 1))),
        ("0 0, 1e-6 1, 2e-6 0", ((0, 0), (1e-6, 1), (2e-6, 0))),
    ],
)
def test_profiles(text: str, profile: tuple[tuple[float, float], ...]) -> None:
    assert parse_profile(text, "here") == profile


@pytest.mark.parametrize("text", ["ramp", "ramp x", "ramp 0", "0 0, 0 1", "1", "0 nan", "a b", "0 0 0", "inf 1"])
def test_bad_profiles(text: str) -> None:
    with pytest.raises(SceneError, match=r"^here"):
        parse_profile(text, "here")


UNKNOWN = {  # what was meant by a name that means nothing
    "Horizn ratio": "Horizon ratio",
    "horizon ratio": "Horizon ratio",
    "Zone/plate/Spacing": "Zones/plate/Spacing",
    "Zones/plate/Spcing": "Zones/plate/Spacing",
    "material/E": "Material/E",
    "Material/e": "Material/E",
    "Materials/core/Rho": "Materials/core/rho",
    "Loadz/top/Traction y": "Loads/top/Traction y",
    "Fixs/foot/Box": "Fixes/foot/Box",
    "Run/Time stp": "Run/Time step",
    "Refine/crak/Distance": "Refine/crack/Distance",
    "Unit": "Units",
    "Plat/Length": "Plate/Length",
    "Anything/of the user's": "Plate/of the user's",
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_a_name_that_means_nothing_is_refused_with_the_nearest(name: str) -> None:
    named = naming(f"parameter 'Peridynamics/{name}'", expected=f"'Peridynamics/{UNKNOWN[name]}'")
    with pytest.raises(SceneError, match=named):
        scene({name: 1.0})


@pytest.mark.quick_cases(21)
@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_asked_for(name: str) -> None:
    """A value of the wrong kind is found, so none of them is ignored."""
    groups = [
        Group("fix:NAME", 1, curves=([[0, 0, 0], [0.02, 0, 0]],)),
        Group("move:NAME", 1, curves=([[0, 0, 0], [0, 0.01, 0]],)),
        Group("load:NAME", 1, curves=([[0.02, 0, 0], [0.02, 0.01, 0]],)),
        Group("absorb:NAME", 1, curves=([[0, 0.01, 0], [0.02, 0.01, 0]],)),
        Group("material:NAME", 2, surfaces=(ring(0, 0, 0.01, 0.01),)),
        Group("zone:NAME", 2, surfaces=(ring(0, 0, 0.01, 0.01),)),
    ]
    values = {"Zones/NAME/Spacing": 1e-3, "Loads/NAME/Traction x": 1.0, "Moves/NAME/Velocity x": 1.0}
    scene(values, *groups)
    refused = 0
    for wrong in (1.0, "word"):
        try:
            scene(values | {name: wrong}, *groups)
        except SceneError:
            refused += 1
    assert refused


KINDS = {
    "zones:fine": (2, "zone:fine"),
    "craks:a": (1, "crack:a"),
    "laod:top": (1, "load:top"),
    "material": (2, "material:NAME"),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_group_of_no_known_kind_is_refused_with_the_nearest(name: str) -> None:
    dimension, meant = KINDS[name]
    with pytest.raises(SceneError, match=naming("Physical", f'("{name}")', expected=("Physical", f'("{meant}")'))):
        scene({}, Group(name, dimension))


def test_a_pressure_on_a_group_an_edge_and_a_pre_crack() -> None:
    """In SI units; a pre-crack is named by its group."""
    slit = Group("crack:slit", 1, curves=([[0.004, 0.0052, 0], [0.012, 0.0052, 0]],))
    values: dict[str, float | str] = {
        "Loads/top/Pressure": "1e8 * x",
        "Loads/side/Pressure": 2e6,
        "Loads/side/Edge": "right",
        "Loads/side/Following": 1.0,
        "Loads/slit/Pressure": 3e6,
        "Loads/slit/Edge": "crack slit",
        "Loads/slit/Profile": "friedlander 1e-6 2",
    }
    base = {name: value for name, value in BASE.items() if "Traction" not in name}
    named = {f"Peridynamics/{name}": value for name, value in (base | values).items()}
    loads = build_grid(scene_of([PLATE, TOP, slit], named, "test.geo"))[1].conditions
    assert [getattr(load, "pressure", None) for load in loads] == ["1e8 * x", 2e6, 3e6]
    assert [getattr(load, "following", None) for load in loads] == [False, True, False]
    sums = [np.array(getattr(load, "area_vectors", ())).sum(axis=0) for load in loads]
    assert sums == [pytest.approx(total, abs=1e-12) for total in ([0, 0.02], [0.01, 0], [0, 0])]


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6), ("in", 0.0254)])
def test_all_lengths_are_in_the_unit_of_the_drawing(unit: str, metres: float) -> None:
    def drawn(scale: float, unit: str) -> Scene:
        def scaled(*points: tuple[float, float]) -> list[list[float]]:
            return [[x / scale, y / scale, 0] for x, y in points]

        corners = [(0, 0), (0.02, 0), (0.02, 0.01), (0, 0.01), (0, 0)]
        groups = [
            Group("zone:plate", 2, surfaces=(tuple(scaled(*ends) for ends in itertools.pairwise(corners)),)),
            Group("load:top", 1, curves=(scaled((0, 0.01), (0.02, 0.01)),)),
            Group("crack:slit", 1, curves=(scaled((0, 0.0052), (0.004, 0.0052)),)),
        ]
        values = {
            "Units": unit,
            "Zones/plate/Spacing": 1e-3 / scale,
            "Refine/crack/Distance": 1e-3 / scale,
            "Refine/crack/Spacing": 5e-4 / scale,
            "Loads/top/Traction y": 1e6,
            "Loads/top/Rows": 2.0,
            "Fixes/foot/Box": " ".join(str(number / scale) for number in (0, 0, 0.02, 0.0015)),
            "Fixes/foot/Displacement y": 1e-6 / scale,
            "Moves/left/Velocity x": 3.0,
            "Moves/left/Box": " ".join(str(number / scale) for number in (0, 0.004, 0.0015, 0.009)),
            "Material/E": 65e9,
            "Material/rho": 2235.0,
            "Material/G0": 204.0,
        }
        return scene_of(groups, {f"Peridynamics/{name}": value for name, value in values.items()}, "test.geo")

    in_metres, in_unit = build_grid(drawn(1.0, "m")), build_grid(drawn(metres, unit))
    for field in ("position", "delta", "areas", "cracks"):
        assert getattr(in_unit[0], field) == pytest.approx(getattr(in_metres[0], field), rel=1e-9, abs=1e-15), field
    load, fix, move = in_unit[1].conditions
    before = in_metres[1].conditions
    assert [one.nodes for one in (load, fix, move)] == [one.nodes for one in before]
    assert isinstance(load, Load)
    assert (load.traction, load.length) == ((0, 1e6), pytest.approx(0.02))
    assert isinstance(fix, Displacement)
    assert fix.y == pytest.approx(1e-6)
    assert isinstance(move, Velocity)
    assert move.x == 3


def test_a_displacement_that_is_not_held_is_refused() -> None:
    with pytest.raises(SceneError, match=naming("Displacement x'", expected="component")):
        scene({"Fixes/a/Box": "0 0 1 1", "Fixes/a/Components": "y", "Fixes/a/Displacement x": 1e-6})


BAD = {
    "unknown unit": ([], {"Units": "furlong"}, naming("Units'", found="'furlong'", expected=("cm", "mm"))),
    "unknown kind": ([Group("laod:top", 1)], {}, naming('Curve("laod:top")', expected='Surface("load:top"')),
    "kind alone": ([Group("crack:", 1)], {}, naming('Curve("crack:")', expected='Curve("crack:NAME")')),
    "crack as a surface": ([Group("crack:a", 2)], {}, r'Physical Surface\("crack:a"\)'),
    "a point": ([Group("load:a", 0)], {}, naming("load 'a'", found="points", expected="one")),
    "missing group": ([], {"Loads/left/Traction x": 1.0}, naming('Curve("load:left")', found="missing")),
    "missing zone": ([], {"Zones/fine/Spacing": 1e-3}, naming('Surface("zone:fine")', found="missing")),
    "missing spacing": ([Group("zone:b", 2, surfaces=(ring(0, 0, 1, 1),))], {}, naming("Zones/b/Spacing'")),
    "misspelt": ([], {"Loads/top/Tracton x": 1.0}, naming("Tracton x'", expected=re.compile("top/Traction x'"))),
    "negative spacing": ([], {"Zones/plate/Spacing": -1.0}, naming("spacing", "zone 'plate'", found="-1 m")),
    "word for a number": ([], {"Material/E": "steel"}, naming("Material/E'", found="'steel'", expected="number")),
    "number for a word": ([], {"Material/Force law": 3.0}, naming("Force law'", found="3.0", expected="word")),
    "nan": ([], {"Material/E": float("nan")}, naming("Material/E'", found="nan", expected=("finite", "number"))),
    "negative E": ([], {"Material/E": -1.0}, naming("Peridynamics/Material", "$.E", found="-1.0", expected="above 0")),
    "half a row": ([], {"Loads/top/Rows": 1.5}, naming("Rows'", found="1.5", expected=("whole", "number"))),
    "neither 0 nor 1": ([], {"Loads/top/Breakable": 2.0}, naming("Breakable'", found="2", expected=("0", "1"))),
    "a box and a group": ([], {"Loads/top/Box": "0 0 1 1"}, naming("Box'", found="group 'load:top'")),
    "endless box": ([], {"Fixes/a/Box": "-inf 0 1 1"}, naming("Box'", found="'-inf 0 1 1'", expected="x0")),
    "bad box": ([], {"Fixes/a/Box": "0 0 1"}, naming("Fixes/a/Box'", found="'0 0 1'", expected=("four", "numbers"))),
    "box inside out": ([], {"Fixes/a/Box": "1 0 0 1"}, "x0 < x1"),
    "unknown components": ([], {"Fixes/a/Box": "0 0 1 1", "Fixes/a/Components": "z"}, "Components' is 'z'"),
    "step without duration": ([], {"Run/Time step": 1e-8}, naming(found='Duration')),
    "unknown solver": ([], {"Run/Solver": "swift"}, naming("Run", "$.solver", found="'swift'", expected="'static'")),
    "half a load step": ([], {"Run/Load steps": 2.5}, naming("Load steps'", found="2.5", expected=("whole", "number"))),
    "driven": ([], {"Run/Damping": -1.0}, naming("Run", "$.damping", found="-1.0", expected="from 0")),
    "too many steps": ([], {"Run/Time step": 1e-300, "Run/Duration": 1.0}, "Run: .* 1e[+]300 steps"),
    "half a material": ([], {"Materials/x/E": 1.0}, naming('Surface("material:x")', found="missing")),
    "refine what": ([], {"Refine/edge/Distance": 1.0}, naming(expected=re.compile(r"'\w+/Refine/\w+/Distance'"))),
    "area rule": ([], {"Area rule": "voronoi"}, naming("Area rule'", found="'voronoi'")),
    "open outline": (
        [Group("zone:plate2", 2, surfaces=(ring(0, 0, 0.01, 0.01)[:3],))],
        {"Zones/plate2/Spacing": 1e-3},
        naming("zone 'plate2'", found="0"),
    ),
    "self-crossing outline": (
        [Group("zone:x", 2, surfaces=(CROSSED,))],
        {"Zones/x/Spacing": 1e-3},
        naming("zone 'x'", found="Self-intersection[0.5 0.5]", expected=("outline", "itself")),
    ),
    "out of the plane": (
        [Group("crack:a", 1, curves=([[0, 0, 0], [0.01, 0.01, 0.01]],))],
        {},
        naming("drawing", found=("0", "0.01 m"), expected="plane"),
    ),
    "not finite": ([Group("crack:a", 1, curves=([[0, 0, 0], [np.inf, 0, 0]],))], {}, "not finite"),
    "millimetres": (
        [Group("zone:big", 2, surfaces=(ring(0, 0, 100, 40),))],
        {"Zones/big/Spacing": 1.024},
        naming(expected=("metres", "millimetres")),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_drawings(name: str) -> None:
    groups, values, message = BAD[name]
    with pytest.raises(SceneError, match=message) as caught:
        scene(values, *groups)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


number = st.floats(allow_nan=True, width=32) | st.sampled_from([1e-3, 5e-4, 0.0, 0.01, 1.0])
NAMES = """
Zones/plate/Spacing Zones/a/Spacing Loads/top/Rows Loads/a/Box Material/E Material/kr Run/Duration
Refine/crack/Distance
"""
name = st.sampled_from(NAMES.replace("\n", " ").split())
group = st.builds(
    Group,
    st.sampled_from(["zone:a", "crack:a", "load:a", "fix:a", "move:a", "material:a", "zone", ":", "x:y", ""]),
    st.sampled_from([0, 1, 2]),
    curves=st.lists(st.lists(st.tuples(number, number, st.just(0.0)), min_size=2, max_size=4), max_size=3).map(tuple),
    surfaces=st.lists(
        st.lists(st.lists(st.tuples(number, number, st.just(0.0)), min_size=2, max_size=4), max_size=4).map(tuple),
        max_size=2,
    ).map(tuple),
)


@pytest.mark.slow
@settings(max_examples=300)
@given(st.lists(group, max_size=3), st.dictionaries(name, number | st.text(max_size=5), max_size=4))
def test_any_drawing_is_a_scene_or_a_scene_error(groups: list[Group], values: dict[str, float | str]) -> None:
    with contextlib.suppress(SceneError):
        assert scene(values, *groups).shape.area > 0


@pytest.mark.parametrize(("right", "said"), [(0.016, 0), (0.02, 0), (0.026, 1)])
def test_a_fine_zone_that_reaches_beyond_the_plate_is_said(right: float, said: int) -> None:
    fine = Group("zone:fine", 2, surfaces=(ring(0.012, 0, right, 0.01),))
    notes = scene({"Zones/fine/Spacing": 5e-4}, fine).notes
    assert len(notes) == said
    assert all(mentions(note, "zone 'fine'", found="6e-05 m^2") for note in notes)


def test_zones_that_lie_side_by_side_are_not() -> None:
    beside = Group("zone:fine", 2, surfaces=(ring(0.02, 0, 0.03, 0.01),))
    assert scene({"Zones/fine/Spacing": 5e-4}, beside).notes == ()


def test_a_group_may_move_as_around_a_tip() -> None:
    field: dict[str, float | str] = {"Fixes/a/Box": "0 0 1 1", "Fixes/a/K1": 3e6, "Fixes/a/Tip": "0.01 0.0005"}
    still = build(scene(field)).settings.conditions[-1]
    assert isinstance(still, Displacement)
    assert isinstance(still.y, Table)
    material = scene().material
    assert material is not None
    expected = k_field(material, 3e6, tip=(0.01, 0.0005))
    assert still.y.values[0] == pytest.approx(expected[1](*still.y.places[0]))  # type: ignore[operator]
    moves = field | {"Fixes/a/Tip speed": 10.0, "Run/Duration": 1e-6, "Fixes/a/Profile": "ramp 1e-6"}
    moving = build(scene(moves)).settings.conditions[-1]
    assert isinstance(moving, Displacement)
    assert isinstance(moving.y, Table)
    assert (len(moving.y.times), moving.y.times[-1], moving.profile) == (101, 1e-6, ())


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"Fixes/a/Components": "x"}, naming("Fixes/a/K1", found="Components")),
        ({"Fixes/a/Tip": "here"}, naming("Fixes/a/Tip", expected="x y")),
        ({"Fixes/a/Tip speed": 10.0}, naming("Fixes/a/Tip speed", expected="Run/Duration")),
    ],
)
def test_a_k_field_that_cannot_be_is_refused(more: dict[str, float | str], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene({"Fixes/a/Box": "0 0 1 1", "Fixes/a/K1": 3e6} | more)
