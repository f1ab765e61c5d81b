"""Round bodies at rest, drawn and laid on lattices, beside Hertz for their own force.

Two cylinders: a^2 = 4 F R / (pi E*), p0 = 2 F / (pi a), with 1 / R = 1 / R1 + 1 / R2; in plane stress 1 / E* = 2 / E.
Two spheres: a^3 = 3 F R / (4 E*), p0 = 3 F / (2 pi a^2), 1 / E* = 2 (1 - nu^2) / E.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
import shapely
from contact_bars import UNIT
from numpy.typing import NDArray

from pdmesh import Body, Box, Material, Run, Scene, Sphere, Static, box, build
from pdmesh.model.document import Displacement, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate

H = 1e-3  # m, spacing
GROWS = ((0.0, 0.0), (1.0, 1.0))


class Touch(NamedTuple):
    """What two bodies show."""

    force: float  # N/m, in space N
    half: float  # m, half-width by the second moment of the pressure
    pressure: NDArray[np.float64]  # Pa, at the nodes of the first body that are pressed
    place: NDArray[np.float64]  # (p,) m, of these from the axis


def segment(radius: float, width: float, height: float, sign: int) -> shapely.Polygon:
    """The part of a disc that touches y = 0 from above (1) or below (-1) within a box, m."""
    disc = shapely.Point(0, sign * radius).buffer(radius, 512)
    return disc.intersection(shapely.box(-width, min(0, sign * height), width, max(0, sign * height)))


def pressed(grid: Grid, settings: Settings, by: float) -> Model:
    """The model with the last two layers of its second body moved down by `by`, m, at the end."""
    assert grid.bodies is not None
    axis = grid.dimension - 1
    height = grid.position[:, axis]
    top = (grid.bodies.number == 1) & (height > height.max() - 1.5 * H)
    down = {"xyz"[axis]: -by} | {name: 0.0 for name in "xyz"[:axis]}
    press = Displacement(**down, nodes=tuple(grid.ids[top].tolist()), profile=GROWS)  # type: ignore[arg-type]
    return Model(grid, msgspec.structs.replace(settings, conditions=(*settings.conditions, press)))


def cylinders(kind: str, steps: int, by: float, width: float = 40 * H) -> Model:
    """A cylinder on a flat block, whose nodes are .37 of a spacing aside, or two cylinders."""
    run, height = Run(solver="static", static=Static(load_steps=steps)), 40 * H
    radius = 100 * H if kind == "flat" else 160 * H
    low = box(-width + 0.37 * H, -height, width + 0.37 * H, 0) if kind == "flat" else segment(radius, width, height, -1)
    scene = Scene(low, H, UNIT, run=run).body(segment(radius, width, height, 1), "upper").fix("bottom")
    built = build(scene.contact(0.0))
    return pressed(built.grid, built.settings, by)


def touches(model: Model) -> list[Touch]:
    """Contact after each load step."""
    system, state = motion = prepare(model, Options(threads=1))
    contact, grid, found = system.contact, model.grid, []
    assert isinstance(contact, RestingContact)
    assert grid.bodies is not None
    for step in range(1, system.model.settings.run.steps + 1):
        motion.advance(step, step + 1)
        push = contact._stiffness * contact._touch(state.value).depth
        i, j = contact._pairs.i, contact._pairs.j
        across = (grid.position[i] + grid.position[j])[:, :-1] / 2
        moment = (push * (across**2).sum(axis=1)).sum() / push.sum()
        lower = np.where(grid.bodies.number[i] == 0, i, j)
        on = np.bincount(lower, push, len(grid)) / H ** (grid.dimension - 1)
        rows = np.flatnonzero(on > 0)
        half = float(np.sqrt(moment * (4.0 if grid.dimension == 2 else 2.5)))
        found.append(Touch(float(push.sum()), half, on[rows], np.sqrt((grid.position[rows, :-1] ** 2).sum(axis=1))))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "radius"), [("flat", 100 * H), ("two", 80 * H)])
def test_cylinders_on_lattices_touch_as_hertz_has_it(kind: str, radius: float) -> None:
    wide = []
    for touch in touches(cylinders(kind, 3, 0.8 * H)):
        half = np.sqrt(4 * touch.force * radius / (np.pi * 0.5))
        pressure = 2 * touch.force / (np.pi * half)
        wide.append(half / H)
        assert touch.half == pytest.approx(half, rel=0.03)  # .999, .984, .978; two: 1.015, .995, .982
        assert touch.pressure.max() == pytest.approx(
            pressure, rel=0.04
        )  # 1.008, 1.019, 1.025; two: 1.003, 1.020, 1.027
    assert wide == pytest.approx([4, 6, 8], abs=1)


def balls() -> Model:
    """A cap of a sphere on a block, in space."""
    run = Run(solver="static", static=Static(method="relaxation", load_steps=2, tolerance=1e-4))
    unit = Material(E=1.0, rho=1.0, G0=1e9, plane="space", micromodulus="constant")
    block = Body(Box((-13 * H, -13 * H, -12 * H), (13 * H, 13 * H, 0)), H, unit, run=run).fix("bottom")
    ball = Sphere((0, 0, 50 * H), 50 * H) & Box((-12 * H, -12 * H, -5 * H), (12 * H, 12 * H, 8 * H))
    built = build(block.body(Body(ball, H, unit), "ball").contact(0.0))
    return pressed(built.grid, built.settings, 0.36 * H)


@pytest.mark.slow
def test_a_ball_on_a_lattice_touches_as_hertz_has_it() -> None:
    """The mean pressure within half of the half-width, as single nodes of a square lattice have uneven shares."""
    wide = []
    for touch in touches(balls()):
        half = (0.75 * touch.force * 50 * H * 2 * (1 - 0.25**2)) ** (1 / 3)
        wide.append(half / H)
        inner = touch.place < half / 2
        expected = 1.5 * touch.force / (np.pi * half**2) * np.sqrt(1 - (touch.place[inner] / half) ** 2)
        assert touch.half == pytest.approx(half, rel=0.06)  # 1.041, 1.017
        assert touch.pressure[inner].mean() == pytest.approx(expected.mean(), rel=0.08)  # .93, 1.008
    assert wide == pytest.approx([3.3, 5.0], abs=0.3)


def lens(by: float) -> Model:
    """Two small cylinders, pressed together by `by`, m, and let go to a fifth of it."""
    run, height = Run(solver="static", static=Static(load_steps=2)), 5 * H
    low, up = (segment(40 * H, 8 * H, height, sign) for sign in (-1, 1))
    built = build(Scene(low, H, UNIT, run=run).body(up, "upper").fix("bottom").contact(0.0))
    model = pressed(built.grid, built.settings, by)
    fixed, press = model.settings.conditions
    press = msgspec.structs.replace(press, profile=((0.0, 0.0), (0.5, 1.0), (1.0, 0.2)))
    return Model(model.grid, msgspec.structs.replace(model.settings, conditions=(fixed, press)), "lens.json")


def test_a_contact_of_round_bodies_narrower_than_four_spacings_is_warned_of() -> None:
    expected = r"lens.json: \$.bodies.*'plate' and 'upper' .* half-width of 1.\d spacings"
    with pytest.warns(ModelWarning, match=expected) as said:
        simulate(lens(0.1 * H), None, Options(threads=1)).close()
    assert len(said) == 1


def test_bodies_that_are_drawn_to_touch_do_wherever_their_nodes_are() -> None:
    """The lowest nodes of a small disc are beside its lowest place, .033 of a spacing above where they touch."""
    run = Run(solver="static", static=Static(load_steps=1))
    scene = Scene(box(-12 * H, -5 * H, 12 * H, 0), H, UNIT, run=run).fix("bottom").contact(0.0)
    built = build(scene.body(shapely.Point(0, 4 * H).buffer(4 * H, 128), "disc"))
    contact = prepare(pressed(built.grid, built.settings, 0.1 * H), Options(threads=1)).system.contact
    assert isinstance(contact, RestingContact)
    depth = contact._pairs.touch - contact._gap(contact.seen)
    assert depth[contact._stiffness > 0].max() == pytest.approx(0.0, abs=1e-9 * H)


@pytest.mark.slow
def test_wide_and_flat_contacts_are_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(lens(0.8 * H), None, Options(threads=1)).close()
        run = Run(solver="static", static=Static(load_steps=1))
        scene = Scene(box(0, 0, 10 * H, 5 * H), H, UNIT, run=run).body(box(4 * H, 5 * H, 6 * H, 9 * H), "punch")
        built = build(scene.fix("bottom").contact(0.0))
        simulate(pressed(built.grid, built.settings, 0.05 * H), None, Options(threads=1)).close()
