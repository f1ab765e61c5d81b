"""What contact knows of the drawn surfaces of bodies beside their nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from pdmesh import Body, Box, Cylinder, Material, Scene, Sphere, box, build
from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_grid import Grid
from pdsolve.operators.contact.drawn_faces import DrawnFaces, drawn_faces

H = 0.01
UNIT = Material(E=1.0, rho=1.0, G0=1e9)


def of_space() -> Material:
    return Material(E=1.0, rho=1.0, G0=1e9, plane="space")


def outer(grid: Grid) -> NDArray[np.bool_]:
    """Mask (n,) of nodes that lack a neighbour of their body within 1.5 spacings, in space 1.8."""
    assert grid.bodies is not None
    reach, most = ((1.5, 8), (1.8, 26))[grid.dimension - 2]
    found = np.zeros(len(grid), dtype=np.bool_)
    for number in range(len(grid.bodies.names)):
        own = np.flatnonzero(grid.bodies.number == number)
        tree = tree_of(grid.position[own])
        found[own] = tree.query_ball_point(grid.position[own], reach * H, return_length=True) <= most
    return found


def faces(scene: Scene | Body) -> tuple[Grid, DrawnFaces]:
    grid = build(scene).grid
    return grid, drawn_faces(grid, outer(grid))


def disc(x: float, y: float, radius: float) -> shapely.Polygon:
    return shapely.Point(x, y).buffer(radius, 64)


def test_nodes_of_a_disc_have_the_normal_and_the_depth_of_its_circle() -> None:
    radius = 6.3 * H
    grid, drawn = faces(Scene(disc(0, 0, radius), H, UNIT).body(disc(2 * radius, 0, radius), "other").contact())
    assert grid.bodies is not None
    for number, centre in ((0, [0.0, 0.0]), (1, [2 * radius, 0.0])):  # each its own, though they touch
        own = np.flatnonzero((grid.bodies.number == number) & drawn.round)
        arm = grid.position[own] - centre
        far = np.sqrt((arm**2).sum(axis=1))
        assert len(own) > 30
        assert drawn.normal[own] == pytest.approx(arm / far[:, None], abs=1e-9)
        assert drawn.beyond[own] == pytest.approx(radius - far - H / 2, abs=1e-9 * H)
    depth = drawn.beyond + H / 2
    assert depth[drawn.round].max() <= H * (1 + 1e-5)
    assert drawn.behind.any()
    assert not (drawn.behind & drawn.round).any()


def test_flat_faces_along_the_axes_are_as_without_a_drawing() -> None:
    _, drawn = faces(Scene(box(0, 0, 8 * H, 5.3 * H), H, UNIT).body(box(8 * H, 0, 11 * H, 5 * H), "other").contact())
    for column in drawn:
        assert not column.any()


@pytest.mark.slow
def test_so_are_the_faces_of_boxes_in_space() -> None:
    low = Body(Box((0, 0, 0), (6 * H, 6 * H, 3 * H)), H, of_space())
    for column in faces(low.body(Box((0, 0, 3 * H), (4 * H, 4 * H, 6 * H)), "up").contact())[1]:
        assert not column.any()


def test_an_inclined_face_has_its_normal_and_its_edge_none() -> None:
    slope = 0.2
    wedge = shapely.Polygon([(0, 0), (20 * H, 0), (20 * H, 10 * H), (0, 6 * H)])
    grid, drawn = faces(Scene(wedge, H, UNIT).body(box(0, -4 * H, 8 * H, 0), "low").contact())
    out = np.array([-slope, 1.0]) / np.hypot(slope, 1.0)
    depth = (np.array([0, 6 * H]) - grid.position) @ out
    top = (np.abs(grid.position[:, 0] - 10 * H) < 7 * H) & (depth < H) & (depth > -H)
    assert drawn.normal[top] == pytest.approx(np.tile(out, (top.sum(), 1)))
    assert drawn.beyond[top] == pytest.approx(depth[top] - H / 2)
    assert not drawn.round.any()
    corner = np.argmax(grid.position @ [-1.0, 1.0])
    assert not drawn.normal[corner].any()


def test_a_pin_in_a_hole_and_the_hole_have_their_own_sides() -> None:
    plate = box(-12 * H, -12 * H, 12 * H, 12 * H) - disc(0, 0, 8 * H)
    grid, drawn = faces(Scene(plate, H, UNIT).body(disc(0, 0, 8 * H), "pin").contact())
    assert grid.bodies is not None
    arm = grid.position / np.sqrt((grid.position**2).sum(axis=1))[:, None]
    for number, sign in ((0, -1), (1, 1)):
        own = drawn.round & (grid.bodies.number == number)
        assert own.sum() > 30
        assert (sign * (drawn.normal[own] * arm[own]).sum(axis=1) > 0.999).all()


@pytest.mark.slow
def test_balls_and_cylinders_in_space() -> None:
    low = Body(Box((-6 * H, -6 * H, -3 * H), (6 * H, 6 * H, 0)), H, of_space())
    grid, drawn = faces(low.body(Sphere((0, 0, 5 * H), 5 * H), "ball").contact())
    arm = grid.position - [0, 0, 5 * H]
    far = np.sqrt((arm**2).sum(axis=1))
    assert drawn.round.sum() > 100
    assert drawn.normal[drawn.round] == pytest.approx((arm / far[:, None])[drawn.round], abs=1e-9)
    assert drawn.beyond[drawn.round] == pytest.approx(4.5 * H - far[drawn.round], abs=1e-9 * H)
    grid, drawn = faces(low.body(Cylinder((0, -5 * H, 5 * H), (0, 5 * H, 5 * H), 5 * H), "roller").contact())
    arm = (grid.position - [0, 0, 5 * H])[:, [0, 2]]
    far = np.sqrt((arm**2).sum(axis=1))
    side = drawn.round & (np.abs(grid.position[:, 1]) < 3 * H)
    assert side.sum() > 60
    assert drawn.beyond[side] == pytest.approx(4.5 * H - far[side], abs=0.05 * H)  # its surface is chords
    assert ((drawn.normal[side][:, [0, 2]] * arm[side]).sum(axis=1) / far[side] > 0.99).all()


def test_nothing_is_known_without_an_outline() -> None:
    grid, _ = faces(Scene(disc(0, 0, 5 * H), H, UNIT).body(disc(10 * H, 0, 5 * H), "other").contact())
    for column in drawn_faces(replace(grid, outline=()), outer(grid)):
        assert not column.any()
