"""Plates of all kinds with a fine zone that moves, beside the same nodes solved on the fine lattice everywhere."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming
from zoned_plates import side_by_side

from pdmesh import Circle, Material, Run, Scene, box, ramp
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Load
from pdsolve.errors import UnstableError
from pdsolve.model import Model

GEOMETRIES = Path(__file__).parent.parent.parent / "geometries"
GLASS = Material(E=72e9, rho=2440, G0=135)
SOFTENING = Material(E=72e9, rho=2440, G0=135, law="bilinear", kr=2.0, keep_G0=True)
HARD = Material(E=210e9, rho=7800, G0=2e4)
CONSTANT = Material(E=210e9, rho=7800, G0=2e4, micromodulus="constant")
ARC = [(0.02 + 0.006 * np.cos(t), 0.0147 + 0.006 * np.sin(t)) for t in np.linspace(0.3, 2.5, 9)]


def model(scene: Scene) -> Model:
    """What is built of a scene for a fine zone that moves."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = build(scene.adapt("hybrid"))
    return Model(built.grid, built.settings)


def pulled(steps: int, material: Material = GLASS, traction: float = 16e6, spacing: float = 5e-4) -> Scene:
    """A plate of 40 x 30 mm pulled by its upper and lower edges."""
    scene = Scene(box(0, 0, 0.04, 0.03), spacing, material, 4, Run(steps=steps, every=steps, time_step=1e-7))
    for side, sign in (("top", 1.0), ("bottom", -1.0)):
        scene = scene.load(side, traction=(0, sign * traction), rows=2, profile=ramp(2e-6))
    return scene


PLATES = {  # and how far energy dissipated may be from that of the uniform run, relative
    "inclined": (pulled(160).crack([(0.0101, 0.0102), (0.024, 0.0193)]), 0.05),  # measured 0.003
    "curved": (pulled(160).crack(ARC), 0.05),  # 0.006
    "softens": (pulled(240, SOFTENING, 10e6).crack([(0, 0.01525), (0.015, 0.01525)]), 0.05),  # 0.022
    "hole": (pulled(160).hole(Circle(0.02, 0.015, 0.004)), 0.15),  # 0.07: the runs differ by the step alone as much
    "corners": (pulled(180, traction=10e6).notch(box(0, 0.012, 0.008, 0.018)), 0.05),  # 0.013
    "two materials": (
        pulled(180, traction=10e6)
        .region(box(0.02, 0, 0.04, 0.03), HARD, "hard")
        .crack([(0, 0.01525), (0.012, 0.01525)]),
        0.08,  # 0.028
    ),
    "two micromoduli": (
        pulled(180, traction=10e6)
        .region(box(0.02, 0, 0.04, 0.03), CONSTANT, "hard")
        .crack([(0, 0.01525), (0.012, 0.01525)]),
        0.08,  # 0.034
    ),
    "a constant micromodulus cracks": (
        pulled(180, msgspec.structs.replace(GLASS, micromodulus="constant"), 10e6)
        .region(box(0.02, 0, 0.04, 0.03), HARD, "hard")
        .crack([(0, 0.01525), (0.012, 0.01525)]),
        0.08,  # 0.006
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLATES)
def test_a_plate_cracks_as_the_uniform_one(name: str) -> None:
    """When its first bond breaks, what loads have done, what was spent; energy is conserved as in the uniform run."""
    scene, spent = PLATES[name]
    one, other = side_by_side(model(scene))
    assert abs(one.first - other.first) <= 1  # of 49 to 90 steps; measured 0 or 1
    assert one.books.broken > 200
    assert one.books.work == pytest.approx(other.books.work, rel=0.04)  # 0.001 to 0.024
    assert one.books.dissipated == pytest.approx(other.books.dissipated, rel=spent)
    assert one.balance == pytest.approx(other.balance, abs=2e-3)  # up to 1.5e-3 apart
    assert one.books.fine_share < 0.5
    assert one.books.clipped_stretch < 0.8


@pytest.mark.slow
def test_what_must_not_break_makes_no_cell_fine() -> None:
    """A plate that is pulled so hard that cracks run out of the fine zone, where the run stops; and one kept whole."""
    found = model(pulled(120, traction=60e6, spacing=1e-3))
    with pytest.raises(UnstableError, match=naming(found=("border", re.compile(r"1\.?\d*")))):
        side_by_side(found)
    whole = Load(box=(-1.0, -1.0, 1.0, 1.0), body_force=(0.0, 0.0), breakable=False)
    settings = msgspec.structs.replace(found.settings, conditions=(*found.settings.conditions, whole))
    kept, _ = side_by_side(dataclasses.replace(found, settings=settings))
    assert (kept.books.fine_share, kept.books.broken, kept.books.clipped_stretch) == (0.0, 0, 0.0)


@pytest.mark.slow
def test_a_shipped_scene_of_all_kinds() -> None:
    """Holes, notches, an inclusion and a curved crack: the elastic work of its ramp within a thousandth."""
    scene = read_scene(GEOMETRIES / "figure_19.py", trust=True)
    found = model(scene)
    one, other = side_by_side(found, 300)
    assert one.books.work == pytest.approx(other.books.work, rel=2e-3)  # 5e-4
    assert one.books.kinetic == pytest.approx(other.books.kinetic, rel=2e-3)
    assert one.books.fine_share < 0.25
