"""Plates of all kinds with a fine zone that moves, beside the same nodes solved on the fine lattice everywhere."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from zones import Solved, side_by_side

from pdmesh import Circle, Material, Run, Scene, box, ramp
from pdmesh.drawing.sources import read_scene
from pdmesh.grid.building import build
from pdsolve.model import Model

GEOMETRIES = Path(__file__).parent.parent.parent / "geometries"
GLASS = Material(E=72e9, rho=2440, G0=135)
SOFTENING = Material(E=72e9, rho=2440, G0=135, law="bilinear", kr=2.0, keep_G0=True)
HARD = Material(E=210e9, rho=7800, G0=2e4)
ARC = [(0.02 + 0.006 * np.cos(t), 0.0147 + 0.006 * np.sin(t)) for t in np.linspace(0.3, 2.5, 9)]


def model(scene: Scene) -> Model:
    """What is built of a scene for a fine zone that moves."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = build(scene.adapt("hybrid"))
    return Model(built.grid, built.settings)


def pulled(steps: int, material: Material = GLASS, traction: float = 10e6, spacing: float = 5e-4) -> Scene:
    """A plate of 40 x 30 mm pulled by its upper and lower edges."""
    scene = Scene(box(0, 0, 0.04, 0.03), spacing, material, 4, Run(steps=steps, every=steps))
    for side, sign in (("top", 1.0), ("bottom", -1.0)):
        scene = scene.load(side, traction=(0, sign * traction), rows=2, profile=ramp(2e-6))
    return scene


class Plate(NamedTuple):
    """A plate, and how far its run may be from the uniform one."""

    scene: Scene
    first: int  # steps between the first bonds
    spent: float  # relative, of the energy dissipated
    fine: float  # share of the plate at the end, at most


PLATES = {
    # measured: first bonds 0, 0, 1, 2, 0 steps apart; dissipated 1, 0.1, 1, 3, 1 % apart
    "inclined": Plate(pulled(260).crack([(0.0101, 0.0102), (0.024, 0.0193)]), 3, 0.08, 0.6),
    "curved": Plate(pulled(300).crack(ARC), 3, 0.08, 0.6),
    "softens": Plate(pulled(260, SOFTENING).crack([(0, 0.01525), (0.015, 0.01525)]), 3, 0.05, 0.6),
    "hole": Plate(pulled(320, traction=14e6).hole(Circle(0.02, 0.015, 0.004)), 4, 0.08, 0.9),
    "corners": Plate(pulled(320).notch(box(0, 0.012, 0.008, 0.018)), 4, 0.08, 0.9),
    "two materials": Plate(
        pulled(260).region(box(0.02, 0, 0.04, 0.03), HARD, "hard").crack([(0, 0.01525), (0.012, 0.01525)]), 3, 0.08, 0.8
    ),
}


@pytest.mark.parametrize("name", PLATES)
def test_a_plate_cracks_as_the_uniform_one(name: str) -> None:
    """When its first bond breaks or softens, what loads have done, what was spent; energy is conserved."""
    plate = PLATES[name]
    one, other = side_by_side(model(plate.scene))
    agree(one, other, plate)


def agree(one: Solved, other: Solved, plate: Plate) -> None:
    """The hybrid run is the uniform one's like."""
    print(one, other)
    assert abs(one.first - other.first) <= plate.first
    assert one.books.work == pytest.approx(other.books.work, rel=0.02)
    assert one.books.dissipated == pytest.approx(other.books.dissipated, rel=plate.spent)
    assert abs(one.balance) < 1e-3
    assert one.books.fine_share < plate.fine
    assert one.books.clipped_stretch < 1


def test_a_shipped_scene_of_all_kinds() -> None:
    """Holes, notches, an inclusion and a curved crack: the elastic work of its ramp within a thousandth."""
    scene = read_scene(GEOMETRIES / "figure_19.py")
    found = model(scene)
    one, other = side_by_side(found, 300)
    assert one.books.work == pytest.approx(other.books.work, rel=2e-3)  # 5e-4
    assert one.books.kinetic == pytest.approx(other.books.kinetic, rel=2e-3)
    assert one.books.fine_share < 0.25
