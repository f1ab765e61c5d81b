"""Submodels: a part of a larger model whose rim moves as that model does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from pdmesh import Circle, Material, Run, Scene, Static, box, build, ramp
from pdpost.__main__ import main
from pdsolve import simulate
from pdsolve.measures.boundary_motion import boundary_motion
from pdsolve.measures.frame_steps import vector
from pdsolve.model import Model
from pdsolve.results import Results

GLASS = Material(E=65e9, rho=2235, G0=1e6)
COARSE = 5e-4
HOLE = Circle(0.02, 0.01, 0.003)
PART = (0.012, 0.004, 0.028, 0.016)
STATIC = Run(solver="static", static=Static(load_steps=2))


def solved(scene: Scene, path: Path | None = None) -> Results:
    built = build(scene)
    return simulate(Model(built.grid, built.settings), path)


def larger(run: Run) -> Scene:
    """A plate with a hole, pulled at both ends: slowly, or with 1 m/s each."""
    plate = Scene(box(0, 0, 0.04, 0.02), COARSE, GLASS, 3.0, run).hole(HOLE)
    if run.solver == "static":
        plate = plate.fix("left", 0.0, None, profile=ramp(1)).fix("right", 4e-6, None, profile=ramp(1))
        return plate.roller(0, 0.01, "x")
    plate = plate.move("left", velocity=(-1, None), profile=ramp(4e-6))
    return plate.move("right", velocity=(1, None), profile=ramp(4e-6))


def difference(large: Results, spacing: float, run: Run) -> float:
    """Largest difference of a submodel's displacements inside from those of the larger run, over the largest of these,
    at the end."""
    rim = box(*PART).difference(box(*PART).buffer(-3 * spacing + spacing / 2, join_style="mitre"))
    motion = boundary_motion(large, PART, 3 * spacing)
    part = Scene(box(*PART), spacing, GLASS, 3.0, run).hole(HOLE).fix(rim, *motion.tables)
    with solved(part) as small:
        last = int(large.frames()[0][-1])
        u = vector(small, "displacement", int(small.frames()[0][-1]))
        place, spread = small.nodes().position, large.nodes().position
        expected = LinearNDInterpolator(spread, vector(large, "displacement", last))(place)
        inside = np.minimum(place - PART[:2], np.array(PART[2:]) - place).min(axis=1) > 6 * COARSE
        inside &= np.hypot(*(place - [0.02, 0.01]).T) > 0.0034
        return float(np.abs(u - expected)[inside].max() / np.abs(expected[inside]).max())


@pytest.mark.slow
def test_a_part_at_rest_has_the_displacements_of_the_larger_model() -> None:
    with solved(larger(STATIC)) as large:
        assert difference(large, COARSE, STATIC) == pytest.approx(0.0013, abs=3e-4)
        assert difference(large, COARSE / 2, STATIC) == pytest.approx(0.0054, abs=1e-3)


@pytest.mark.slow
def test_a_part_in_motion_has_the_displacements_of_the_larger_model() -> None:
    with solved(larger(Run(duration=2e-5, every=5))) as large:
        run = Run(duration=float(large.frames()[1][-1]))
        assert difference(large, COARSE, run) == pytest.approx(0.008, abs=2e-3)
        assert difference(large, COARSE / 2, run) == pytest.approx(0.016, abs=3e-3)


@pytest.mark.slow
def test_the_command_writes_what_a_scene_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with solved(larger(STATIC), tmp_path / "plate.sqlite") as large:
        tables = boundary_motion(large, PART, 1.5e-3).tables
    assert main(["boundary", "plate.sqlite", "--box", "12,4,28,16mm", "--depth", "1.5mm", "-o", "rim.csv"]) == 0
    part = Scene(box(*PART), COARSE, GLASS, 3.0, STATIC)
    for by in (("rim.csv:ux", "rim.csv:uy"), tables):
        built = build(part.fix("left", *by))
        (condition,) = built.settings.conditions
        drives = np.array([condition.x.values, condition.y.values])
        assert sorted(drives.ravel()) == sorted(value for table in tables for value in table.values)
