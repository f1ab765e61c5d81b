"""Numbers of numpy in every call of a scene: the files are those of Python's own numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from decimal import Decimal
from pathlib import Path

import msgspec
import numpy as np
import pytest

from pdmesh import (
    Body,
    Box,
    Circle,
    Fatigue,
    Gap,
    Heat,
    Material,
    Medium,
    Run,
    Scene,
    SceneError,
    Sphere,
    Static,
    box,
    build,
    ramp,
)
from pdmesh.model.document import Displacement, Settings

Number = Callable[[float], object]
NUMBERS: dict[str, tuple[Number, Number]] = {
    "float64": (np.float64, np.int64),
    "float32": (np.float32, np.int32),  # all numbers below are sums of few powers of 2
    "arrays": (lambda value: np.array(value, dtype=float), np.array),
}


def scenes(n: Number, i: Number) -> Iterator[Scene | Body]:
    """Scenes that make every call; `n` are numbers, `i` whole numbers."""
    h = 2.0**-8
    glass = Material(E=n(64e9), rho=n(2240), G0=n(204.5), nu=n(0.25))
    run = Run(steps=i(20), every=i(10), time_step=n(2.0**-24), damping=n(0.5), probes=((n(h), n(h)),))
    plate = Scene(box(0, 0, n(8 * h), n(4 * h)), n(h), glass, n(3), run)
    yield (
        plate.crack([(n(0), n(2 * h)), (n(2 * h), n(2 * h))])
        .hole(Circle(n(4 * h), n(2 * h), n(h / 2)))
        .zone(box(0, 0, n(4 * h), n(4 * h)), n(h / 2))
        .refine("hole", n(h), n(h / 2))
        .region(Circle(n(6 * h), n(2 * h), n(h)), Material(E=n(32e9), rho=n(2000), G0=n(100)))
        .fix("left", x=n(0.5), y=None, rows=i(2))
        .load("top", traction=(n(0), n(12e6)), profile=((n(0), n(0)), (n(1), n(1))))
        .load("bottom", force=(n(0), n(12e6)), profile=ramp(n(2.0**-20)))
        .move("right", velocity=(n(1), None), rows=i(3))
        .spring("bottom", stiffness=(n(1e9), n(0)))
        .gap("mouth", (n(h), n(h)), (n(h), n(3 * h)))
        .pin(n(2 * h), n(h))
        .roller(n(6 * h), n(h))
        .absorb("right", width=n(h))
    )
    yield (
        plate.body(box(n(8 * h), n(0), n(12 * h), n(4 * h)), "b", n(h), None, (n(-1), n(0)), n(2))
        .rigid(Circle(n(-2 * h), n(2 * h), n(2 * h)), "r", n(2), (n(3), n(0)), n(0.5), spacing=n(h), radius=n(2 * h))
        .contact(friction=n(0.25), stiffness=n(15.0), distance=n(1), restitution=n(0.75))
    )
    tired = Fatigue(A=n(2.0**30), m=n(4), ratio=n(0.25), cycles=n(1e6), blocks=((n(10), n(0.5)),))
    rest = Run(
        solver="static",
        fatigue=tired,
        static=Static(tolerance=n(2.0**-20)),
        gaps=(Gap("g", ((n(h), n(0)), (n(0), n(h)))),),
    )
    yield Scene(box(0, 0, 8 * h, 4 * h), h, glass, 3, rest).fix("left").load("right", body_force=(n(1e6), n(0)))
    swelling = Material(E=n(64e9), rho=n(2240), G0=n(204.5), alpha=n(2.0**-20), T0=n(293))
    yield (
        Scene(box(0, 0, 8 * h, 4 * h), h, swelling, 3, medium=Heat(k=n(1), c=n(800), broken=n(0.5)))
        .temperature("left", n(300), rows=i(1))
        .heat("right", flux=n(1e3))
        .convection("top", h=n(10), outside=n(280))
        .initial_temperature(box(0, 0, h, h), n(290))
    )
    yield (
        Scene(box(0, 0, 8 * h, 4 * h), h, medium=Medium(D=n(2.0**-30)))
        .hold("left", n(2))
        .supply("right", flux=n(1))
        .exchange("top", n(2.0**-20), n(0.5))
        .begin(box(0, 0, h, h), n(1))
        .diffusivity(box(0, 0, h, h), n(2.0**-29))
    )
    yield (
        Body(Box((n(0),) * 3, (n(8 * h), n(4 * h), n(4 * h))), n(h), glass, n(3), Run(steps=i(10)))
        .fix("left", x=n(0.5), rows=i(2))
        .load("right", traction=(n(1e6), n(0), n(0)))
        .region(Box((n(0),) * 3, (n(2 * h),) * 3), Material(E=n(32e9), rho=n(2000), G0=n(100)))
        .pin(n(4 * h), n(2 * h), n(2 * h))
        .body(Box((n(8 * h), n(0), n(0)), (n(12 * h), n(4 * h), n(4 * h))), "b", n(h), None, (n(1), n(0), n(0)))
    )


@pytest.mark.parametrize("kind", NUMBERS)
def test_numbers_of_numpy_make_the_same_scenes(kind: str) -> None:
    for expected, scene in zip(scenes(float, int), scenes(*NUMBERS[kind]), strict=True):
        assert scene == expected
        assert repr(scene) == repr(expected)  # numpy's numbers equal Python's, and look different


def test_a_scene_of_numpy_numbers_is_written(tmp_path: Path) -> None:
    for kind, numbers in {"plain": (float, int), "float32": NUMBERS["float32"]}.items():
        build(next(iter(scenes(*numbers)))).write(tmp_path / f"{kind}.json")
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 1


def test_structs_hold_numbers_of_python() -> None:
    settings = Settings(
        material=Material(E=np.float64(1e9), rho=np.int64(1000), G0=np.float32(2.0)),  # type: ignore[arg-type]
        conditions=(Displacement(nodes=np.arange(3), x=np.float32(0.5)),),  # type: ignore[arg-type]
        run=Run(steps=np.int64(3), probes=np.zeros((1, 2))),  # type: ignore[arg-type]
    )
    assert msgspec.json.decode(msgspec.json.encode(settings), type=Settings) == settings
    assert settings.conditions[0].nodes == (0, 1, 2)
    ball = Sphere(np.zeros(3), np.float32(0.5))  # type: ignore[arg-type]
    assert ball == Sphere((0.0, 0.0, 0.0), 0.5)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        ({"E": np.array([1e9, 2e9])}, ("material", "E", "(1000000000.0, 2000000000.0)")),
        ({"E": Decimal("1e9")}, ("material", "E", "1E+9")),
        ({"G0": 2 + 1j}, ("material", "G0", "(2+1j)")),
        ({"rho": "2240"}, ("material", "rho", "'2240'")),
    ],
)
def test_what_is_no_number_is_named(material: dict[str, object], words: tuple[str, ...]) -> None:
    given = {"E": 1e9, "rho": 2240, "G0": 1.0} | material
    with pytest.raises(SceneError) as raised:
        Scene(box(0, 0, 0.04, 0.02), 1e-3, Material(**given))  # type: ignore[arg-type]
    assert all(word in str(raised.value) for word in words), raised.value
