"""Prescribed and initial values that are functions of place, against closed solutions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pdmesh import Body, Box, Material, Run, Scene, box, build
from pdsolve import Model, simulate
from pdsolve.results import Results

MATERIAL = Material(E=70e9, rho=2500, G0=1e9)
H = 1e-3


def solved(scene: Scene | Body, path: Path | None = None) -> tuple[Results, Model]:
    """The results of a scene, and its model."""
    built = build(scene)
    model = Model(built.grid, built.settings, "place")
    return simulate(model, path), model


def last(results: Results, name: str) -> np.ndarray:
    """A field of the last frame."""
    return results.field(name, int(results.frames()[0][-1])).astype(float)


def test_a_plate_whose_edges_follow_a_linear_field_has_it_inside() -> None:
    # u = (a x + b y, c x + d y) on six rows all around, so that no bond inside is corrected for a surface: then exact
    plate = Scene(box(0, 0, 0.02, 0.016), H, MATERIAL, 3.0, Run(solver="static"))
    for side in ("left", "right", "top", "bottom"):
        plate = plate.fix(side, x=lambda x, y: 1e-5 * x + 2e-5 * y, y="-3e-5*x + 1e-5*y", rows=6, name=side)
    results, model = solved(plate)
    x, y = model.grid.position.T
    away = np.hypot(last(results, "ux") - 1e-5 * x - 2e-5 * y, last(results, "uy") + 3e-5 * x - 1e-5 * y)
    assert (
        away.max() < 2e-4 * 6e-7
    )  # measured 3e-5 of the largest displacement: the strain is not small beside round-off


@pytest.mark.slow
def test_a_bar_displaced_like_its_first_mode_swings_with_its_period() -> None:
    # u = A cos(pi x / L): after half a period, L / c with c = sqrt(E / rho), it is -u
    length, amplitude = 0.08, 1e-7
    bar = Scene(box(0, 0, length, 0.004), H / 2, MATERIAL, 3.0, Run(duration=length / float(np.sqrt(70e9 / 2500))))
    bar = bar.move(box(0, 0, length, 0.004), initial_displacement=(f"{amplitude} * cos(pi*x/{length})", None))
    results, model = solved(bar)
    x = model.grid.position[:, 0]
    mode = np.cos(np.pi * x / length)
    share = (last(results, "ux") @ mode) / (mode @ mode) / amplitude
    assert share == pytest.approx(-1.0, abs=0.02)
    start = results.history()
    assert start["strain"][0] > 0
    total = start["strain"] + start["kinetic"]
    assert total[-1] == pytest.approx(total[0], rel=3e-3)  # measured -2.0e-3


@pytest.mark.slow
def test_initial_displacements_in_space_go_on_after_a_stop(tmp_path: Path) -> None:
    block = Body(Box((0, 0, 0), (0.006, 0.006, 0.006)), H, MATERIAL, 3.0, Run(steps=20, every=10, time_step=2e-8))
    block = block.move(
        Box((0, 0, 0), (0.006, 0.006, 0.006)),
        initial_displacement=lambda x, y, z: (1e-8 * np.sin(500 * x), 0.0, 1e-8 * z),
    )
    whole, model = solved(block)
    assert np.abs(whole.field("uz", 0)).max() == pytest.approx(1e-8 * 5.5e-3, rel=1e-6)
    from pdsolve import resume

    path = tmp_path / "part.sqlite"
    simulate(model, path, watch=lambda progress: progress.step >= 10).close()
    again = resume(path)
    assert np.array_equal(again.field("ux", 20), whole.field("ux", 20))
    again.close()
