"""What nodes carry of a pressure on edges, faces and pre-cracks."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from messages import naming
from numpy.typing import NDArray

from pdmesh import Body, Box, Circle, Material, Scene, SceneError, Sphere, box, build, friedlander
from pdmesh.grid.building import Built
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import GridError, Load
from pdmesh.model.load_resultants import nodal_forces
from pdmesh.model.selection import check
from pdmesh.scene.conditions import parse_profile
from pdmesh.scene.solids import Sheet, brick

GLASS = Material(E=65e9, rho=2235, G0=204)
PLATE = Scene(box(0, 0, 0.03, 0.02), 1e-3, GLASS)
BODY = Body(brick((0, 0, 0), (0.012, 0.01, 0.008)), 1e-3, GLASS)
SLIT = [(0.0105, 0.0105), (0.0195, 0.0105)]
INNER = Sheet(np.array([[(0.004, 0.003, 0.0041), (0.009, 0.003, 0.0041), (0.006, 0.008, 0.0041)]]))


def loaded(built: Built) -> tuple[Load, NDArray[np.float64], NDArray[np.float64]]:
    """The first load, the places of its nodes, and their forces."""
    load = built.settings.conditions[0]
    assert isinstance(load, Load)
    rows = np.array(load.nodes) - 1
    return load, built.grid.position[rows], nodal_forces(load, built.grid, rows)


@pytest.mark.parametrize("rows", [None, 1, 3])
def test_on_a_straight_edge_it_is_a_traction(rows: int | None) -> None:
    _, _, pushed = loaded(build(PLATE.load("right", pressure=2e6, rows=rows)))
    _, _, pulled = loaded(build(PLATE.load("right", traction=(-2e6, 0), rows=rows)))
    assert pushed == pytest.approx(pulled, rel=0.01)
    assert pushed.sum(axis=0) == pytest.approx([-2e6 * 0.02, 0])


def test_around_a_hole_it_is_in_balance_whatever_its_nodes() -> None:
    """The length of its chords times p; nodes of a round edge have cells of many sizes."""
    holed = Scene(box(0, 0, 0.03, 0.02), 1e-3, GLASS).hole(Circle(0.0123, 0.0108, 0.005))
    load, place, force = loaded(build(holed.load("hole nearest 0.012,0.011", pressure=1e6)))
    arm = place - [0.0123, 0.0108]
    outwards = (force * arm).sum(axis=1) / np.hypot(*arm.T)
    assert outwards.sum() == pytest.approx(2 * np.pi * 0.005 * 1e6, rel=5e-3)  # nodes share directions
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * outwards.sum()
    assert load.shares is not None
    assert load.faces is None


@pytest.mark.parametrize("cut", [{"adapt": "hybrid"}, {}])
def test_without_corrected_edges_one_row_carries_it(cut: dict[str, str]) -> None:
    scene = PLATE if cut else Scene(PLATE.outline, 1e-3, msgspec.structs.replace(GLASS, model="ordinary"))
    scene = scene.load("right", pressure=2e6)
    load, place, _ = loaded(build(scene.adapt("hybrid") if cut else scene))
    assert set(place[:, 0]) == {0.03}
    assert load.shares is None


def test_on_a_pre_crack_it_opens_both_faces() -> None:
    """Each face pushes the nodes of its own side, however near the lattice is to the crack."""
    for offset in (0.0, 0.45e-3):
        line = [(x, y + offset) for x, y in SLIT]
        load, place, force = loaded(build(PLATE.crack(line, "c").load("crack c", pressure=1e6)))
        above = place[:, 1] > 0.0105 + offset
        assert force[above, 1].sum() == pytest.approx(9e3)
        assert force[~above, 1].sum() == pytest.approx(-9e3)
        assert (force[above, 1] > 0).all()
        assert len(load.faces or ()) == 2


@pytest.mark.parametrize("of_crack", [False, True])
def test_of_a_body(of_crack: bool) -> None:
    if of_crack:
        load, place, force = loaded(build(BODY.crack(INNER, "c").load("crack c", pressure=1e6)))
        above = place[:, 2] > 0.0041
        assert force[above].sum(axis=0) == pytest.approx([0, 0, 12.5])
        assert force[~above].sum(axis=0) == pytest.approx([0, 0, -12.5])
        assert len(load.faces or ()) == 2
        return
    _, place, force = loaded(build(BODY.load("top", pressure=1e6)))
    assert force == pytest.approx(np.tile([0, 0, -1.0], (120, 1)), rel=0.02, abs=1e-9)
    assert set(place[:, 2]) == {0.0075}


@pytest.mark.slow
def test_in_a_hollow_body_it_is_in_balance() -> None:
    hollow = Body(Box((0, 0, 0), (0.012, 0.012, 0.012)) - Sphere((0.0062, 0.0058, 0.006), 0.003), 1e-3, GLASS)
    _, place, force = loaded(build(hollow.load("nearest 0.0062,0.0058,0.0031", pressure=1e6)))
    arm = place - [0.0062, 0.0058, 0.006]
    outwards = ((force * arm).sum(axis=1) / np.linalg.norm(arm, axis=1)).sum()
    assert outwards == pytest.approx(4 * np.pi * 0.003**2 * 1e6, rel=0.02)  # chords of triangles
    assert np.abs(force.sum(axis=0)).max() < 1e-9 * outwards


def test_it_may_vary_with_place() -> None:
    _, place, force = loaded(build(PLATE.load("right", pressure="1e8 * y", rows=1)))
    _, _, same = loaded(build(PLATE.load("right", pressure=lambda x, y: 1e8 * y, rows=1)))
    assert force[:, 0].sum() == pytest.approx(-1e6 * 0.02, rel=1e-3)
    assert same == pytest.approx(force)
    assert force[place[:, 1] == 0.01, 0] == pytest.approx([-1e3], rel=0.01)


@pytest.mark.parametrize(
    ("add", "message"),
    [
        (lambda: PLATE.load(SLIT, pressure=1e6), naming("inside", expected="crack NAME")),
        (lambda: PLATE.load([(0.031, 0), (0.031, 0.02)], pressure=1e6), naming("away from", expected="edge")),
        (lambda: PLATE.load("right", pressure=1e6, traction=(1e6, 0)), naming(found=("traction", "pressure"))),
        (lambda: PLATE.load(box(0, 0, 0.01, 0.01), pressure=1e6), naming("pressure", expected="edge")),
        (lambda: PLATE.crack(SLIT, "c").load("crack d", pressure=1e6), naming("crack 'd'", expected="c")),
        (lambda: PLATE.crack(SLIT, "c").load("crack c", traction=(0, 1e6)), naming("crack c")),
        (lambda: PLATE.load("right", pressure=(1e6, 0)), naming("pressure", expected="number")),
        (lambda: PLATE.load("right", pressure=1e6, profile=((0, 1), (0, 0))), naming("profile")),
        (lambda: PLATE.load("right", pressure="x", following=True), naming("place", expected="number")),
        (lambda: PLATE.load("right", traction=(1, 0), following=True), naming("is not a pressure")),
        (lambda: build(BODY.load(INNER, pressure=1e6)), naming("inside", expected="crack NAME")),
        (lambda: BODY.load(brick((0, 0, 0), (1e-3, 1e-3, 1e-3)), pressure=1e6), naming("faces")),
        (lambda: BODY.load("crack c", pressure=1e6), naming("crack 'c'", expected="none")),
        (lambda: friedlander(1e-3, 100.0), naming("decay 100", expected="20")),
        (lambda: parse_profile("friedlander 1e-3", "here"), naming("here", expected="friedlander SECONDS DECAY")),
    ],
)
def test_what_it_cannot_act_on(add: object, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        add()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"area_vectors": None}, naming("area_vectors", found="0")),
        ({"area_vectors": ((1.0, 0.0, 0.0),) * 21}, naming("area_vectors", found="3", expected="2")),
        ({"pressure": None, "force": (1.0, 0.0)}, naming("pressure")),
        ({"following": True}, naming("faces")),
        ({"following": True, "faces": ((0.0,) * 9,)}, naming("faces", found="9", expected="4")),
        ({"following": True, "faces": ((0.0, 0, 0, 1),), "pressure": "x"}, naming("place", expected="number")),
    ],
)
def test_what_a_grid_file_may_not_say(changes: dict[str, object], message: str) -> None:
    grid, settings, _ = build_grid(PLATE.load("right", pressure=1e6, rows=1))
    wrong = msgspec.structs.replace(settings.conditions[0], **changes)
    with pytest.raises(GridError, match=message):
        check(msgspec.structs.replace(settings, conditions=(wrong,)), grid, "file")


def test_a_blast_follows_its_formula() -> None:
    """(1 - t / T) exp(-b t / T), with its suction, and nothing in the end."""
    profile = np.array(friedlander(2e-3, 1.5))
    time = np.linspace(0, profile[-1, 0], 10_000)
    exact = (1 - time / 2e-3) * np.exp(-1.5 * time / 2e-3)
    assert np.interp(time, *profile.T) == pytest.approx(exact, abs=1.1e-3)
    inner = time < profile[-2, 0]
    assert np.interp(time, *profile.T)[inner] == pytest.approx(exact[inner], abs=1e-4)
    assert profile[0].tolist() == [0, 1]
    assert profile[-1, 1] == 0
    assert profile[:, 1].min() == pytest.approx(-np.exp(-2.5) / 1.5, rel=1e-4)
    assert parse_profile("friedlander 2e-3 1.5", "") == friedlander(2e-3, 1.5)
