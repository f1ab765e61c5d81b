"""Absurd numbers for every parameter there is: a grid that can be read back, or one line that says what is wrong."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from plates import GLASS

from pdmesh import Body, Box, Circle, Material, Run, Scene, SceneError, box, friedlander, ramp
from pdmesh.drawing.building import meshed
from pdmesh.drawing.parameters import NAMES
from pdmesh.drawing.plate_of_groups import Group, scene_of
from pdmesh.grid import soundness
from pdmesh.grid.building import build
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Settings, encode, read_document, settings_of
from pdmesh.model.node_grid import document_of

NAN, INF, TINY = float("nan"), float("inf"), 5e-324
NUMBERS = (NAN, INF, -INF, 1e308, -1e308, TINY, -TINY, 1e-18, 1e18, 1e9, 0.0, -1.0, 0.3)
OTHERS = (None, "much", [], (1, 2), {}, 1 + 2j, True, 10**400)


def plate(**fields: Any) -> Scene:
    return Scene(**({"outline": box(0, 0, 0.012, 0.008), "spacing": 1e-3, "material": GLASS} | fields))


def glass(**fields: Any) -> Material:
    return Material(**({"E": 65e9, "rho": 2235.0, "G0": 204.0} | fields))


def cracked() -> Scene:
    return plate().crack([(0, 0.0045), (0.004, 0.0045)])


SCENES: dict[str, Callable[[Any], Scene]] = {
    "spacing": lambda x: plate(spacing=x),
    "horizon": lambda x: plate(horizon=x),
    "material": lambda x: plate(material=x),
    "run": lambda x: plate(run=x),
    "units": lambda x: plate(units=x),
    "area rule": lambda x: plate(area_rule=x),
    **{name: lambda x, name=name: plate(material=glass(**{name: x})) for name in Material.__struct_fields__},
    **{f"run {name}": lambda x, name=name: plate(run=Run(**{name: x})) for name in Run.__struct_fields__},
    "outline": lambda x: plate(outline=x),
    "corner": lambda x: plate(outline=[(0, 0), (x, 0), (0.012, 0.008), (0, 0.008)]),
    "disc": lambda x: plate(outline=Circle(0, 0, x), spacing=0.05),
    "hole": lambda x: plate().hole(x),
    "hole's place": lambda x: plate().hole(Circle(x, 0.004, 0.001)),
    "hole's radius": lambda x: plate().hole(Circle(0.006, 0.004, x)),
    "notch": lambda x: plate().notch([(0.004, 0.008), (0.006, x), (0.008, 0.008)]),
    "crack": lambda x: plate().crack([(0, 0.0045), (x, 0.0045)]),
    "pressure": lambda x: cracked().load("crack 1", pressure=x),
    "decay of a blast": lambda x: plate().load("top", pressure=1e6, profile=friedlander(1e-3, x)),
    "crack's points": lambda x: plate().crack(x),
    "zone's spacing": lambda x: plate().zone(box(0, 0, 0.004, 0.004), x),
    "spacing of a round zone": lambda x: plate().zone(Circle(0.006, 0.004, 0.002), x),
    "zone's size": lambda x: plate().zone([(0, 0), (x, 0), (0, 0.004)], 5e-4),
    "refined distance": lambda x: cracked().refine("crack", x),
    "refined spacing": lambda x: cracked().refine("crack", 1e-3, x),
    "around a hole": lambda x: plate().hole(Circle(0.006, 0.004, 0.002)).refine("hole", x),
    "around a notch": lambda x: plate().notch([(0.004, 0.008), (0.006, 0.004), (0.008, 0.008)]).refine("notch", x),
    "refined what": lambda x: cracked().refine(x, 1e-3),
    "region": lambda x: plate().region(Circle(0.006, 0.004, x), GLASS),
    "region's material": lambda x: plate().region(box(0, 0, 0.004, 0.004), x),
    "region's E": lambda x: plate().region(box(0, 0, 0.004, 0.004), glass(E=x)),
    "traction": lambda x: plate().load("top", traction=(0, x)),
    "body force": lambda x: plate().load(box(0, 0, 0.004, 0.004), body_force=(x, 0)),
    "displacement": lambda x: plate().fix("top", x),
    "velocity": lambda x: plate().move("top", velocity=(x, 0)),
    "acceleration": lambda x: plate().move("top", acceleration=(x, 0)),
    "initial velocity": lambda x: plate().move("top", initial_velocity=(x, 0)),
    "rows": lambda x: plate().fix("top", rows=x),
    "absorbing": lambda x: plate().absorb("top", x),
    "whole rows": lambda x: plate().fix("top", rows=int(x)),
    "breakable": lambda x: plate().fix("top", breakable=x),
    "ramp": lambda x: plate().fix("top", profile=ramp(x)),
    "time": lambda x: plate().fix("top", profile=((0, 0), (x, 1))),
    "factor": lambda x: plate().fix("top", profile=((0, x), (1, 1))),
    "profile": lambda x: plate().fix("top", profile=x),
    "place": lambda x: plate().fix(x),
    "curve": lambda x: plate().fix([(0, 0), (x, 0)]),
}  # fmt: skip


def outcome(make: Callable[[], Scene]) -> str:
    """What is wrong with a scene, in one line; empty where it makes a grid that can be read again."""
    try:
        scene = make()
        grid, settings, _ = build_grid(scene)
        soundness.remarks(grid, settings)
    except SceneError as error:
        return str(error)
    document = document_of(grid, settings)
    text = encode(document)
    assert len(grid) < 100_000
    again = read_document(text, "model")
    assert again.nodes == document.nodes
    assert settings_of(again) == msgspec.convert(msgspec.to_builtins(settings_of(document)), Settings)
    json.loads(text, parse_constant=pytest.fail)
    return ""


def in_python(make: Callable[[Any], Scene], value: Any) -> Callable[[], Scene]:
    """A scene file's own mistakes are its author's: only what the scene makes of a value counts."""

    def scene() -> Scene:
        try:
            return make(value)
        except (TypeError, ValueError, OverflowError) as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"{type(error).__name__}: {error}") from None

    return scene


@pytest.mark.quick_cases(12)
@pytest.mark.parametrize("name", SCENES)
def test_every_number_of_a_scene(name: str) -> None:
    for value in NUMBERS:
        try:
            value = int(value) if name == "whole rows" else value
        except (ValueError, OverflowError):
            continue
        message = outcome(lambda value=value: SCENES[name](value))
        assert "\n" not in message
        assert len(message) < 400


@pytest.mark.quick_cases(27)
@pytest.mark.parametrize("name", SCENES)
def test_what_is_no_number(name: str) -> None:
    for value in OTHERS:
        message = outcome(in_python(SCENES[name], value))
        assert "\n" not in message


def line(*points: tuple[float, float]) -> list[list[float]]:
    return [[x, y, 0.0] for x, y in points]


def ring(x0: float, y0: float, x1: float, y1: float) -> tuple[list[list[float]], ...]:
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    return tuple(line(*corners[i : i + 2]) for i in range(4))


GROUPS = [
    Group("zone:plate", 2, surfaces=(ring(0, 0, 0.012, 0.008),)),
    Group("zone:NAME", 2, surfaces=(ring(0, 0, 0.004, 0.008),)),
    Group("material:NAME", 2, surfaces=(ring(0, 0, 0.004, 0.004),)),
    Group("crack:slit", 1, curves=(line((0.012, 0.00425), (0.009, 0.00425)),)),
    Group("load:NAME", 1, curves=(line((0.012, 0), (0.012, 0.008)),)),
    Group("fix:NAME", 1, curves=(line((0, 0), (0.012, 0)),)),
    Group("move:NAME", 1, curves=(line((0, 0), (0, 0.008)),)),
]
VALUES: dict[str, float | str] = {
    "Zones/plate/Spacing": 1e-3,
    "Zones/NAME/Spacing": 1e-3,
    "Loads/NAME/Traction x": 1.0,
    "Moves/NAME/Velocity x": 1.0,
    "Refine/crack/Distance": 1e-3,
    "Material/E": 65e9,
    "Material/rho": 2235.0,
    "Material/G0": 204.0,
    "Run/Time step": 1e-8,
    "Run/Duration": 1e-6,
}
WORDS = (
    "nan",
    "inf 1",
    "ramp nan",
    "ramp inf",
    "0 0, nan 1",
    "0 1e999",
    "-1 2 nan 4",
    "0 0 1e308 inf",
    "\ud800",
    10_000 * "x",
)


@pytest.mark.quick_cases(21)
@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_of_a_drawing(name: str, every: int) -> None:
    for value in (*NUMBERS, *WORDS)[::every]:
        values = {f"Peridynamics/{key}": one for key, one in (VALUES | {name: value}).items()}
        kind = name.split("/")[0].lower()
        groups = [group for group in GROUPS if not (name.endswith("/Box") and kind.startswith(group.name[:3]))]
        message = outcome(lambda values=values, groups=groups: scene_of(groups, values, "test.geo"))
        assert "\n" not in message


SMALL = box(-4e-4, -4e-4, 4e-4, 4e-4)
BLOCK = Body(Box((0, 0, 0), (6e-3, 4e-3, 4e-3)), 1e-3, GLASS)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (plate().crack([(0, 4e-3), (4e-3, 4e-3)]).fix(SMALL), ["(0, 0.0005) m", "shifted by (0, 0.0005) m", "pin"]),
        (plate().fix(box(2.1e-3, 0, 2.4e-3, 1e-3)), ["(0.002, 0) m", "Point"]),
        (plate().fix([(2.2e-3, 2.4e-3), (2.6e-3, 2.4e-3)]), ["(0.002, 0.002) m"]),
        (plate().region(box(0.0112, 4e-3, 0.0118, 4.5e-3), GLASS), ["(0.011, 0.004) m"]),
        (BLOCK.fix(Box((1e-3, 1e-3, 1.6e-3), (2e-3, 2e-3, 1.9e-3))), ["(0.0015, 0.0015, 0.0015) m"]),
    ],
)
def test_a_place_without_nodes_says_where_the_nearest_is(scene: Scene | Body, said: list[str]) -> None:
    with pytest.raises(SceneError, match=".*".join(map(re.escape, said))):
        build(meshed(scene) if isinstance(scene, Body) else scene)
