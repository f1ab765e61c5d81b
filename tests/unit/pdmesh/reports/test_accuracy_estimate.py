"""What a proposal is made of: the smallest feature, the spacing for an error, zones that keep their shape."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from plates import GEOMETRIES, GLASS

from pdmesh import Circle, Run, Scene, SceneError, box
from pdmesh.__main__ import main
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.lattice import build_grid
from pdmesh.reports import accuracy_estimate
from pdmesh.reports.accuracy_estimate import changed, feature, measured, proposal, settings

PLATE = Scene(box(0, 0, 0.1, 0.06), 2e-3, GLASS, 3, Run(time_step=1e-7, steps=400, every=20))


@pytest.mark.parametrize(
    ("scene", "size", "named"),
    [
        (PLATE, 0.03, "half of the smaller side"),
        (PLATE.hole(Circle(0.05, 0.03, 0.01)), 0.01, "radius of cutout 1"),
        (PLATE.hole(Circle(0.05, 0.05, 0.008)), 0.002, "from cutout 1 to the edge"),
        (PLATE.crack([(0, 0.0305), (0.04, 0.0305)], "a"), 0.0295, "from crack 'a' to the edge"),
        (PLATE.crack([(0.04, 0.0305), (0.05, 0.0305)], "a"), 0.01, "length of crack 'a'"),
        (
            PLATE.crack([(0.02, 0.0205), (0.06, 0.0205)], "a").crack([(0.02, 0.0265), (0.06, 0.0265)], "b"),
            0.006,
            "from crack 'a' to crack 'b'",
        ),
    ],
)
def test_the_smallest_feature(scene: Scene, size: float, named: str) -> None:
    found = feature(scene)
    assert found[0] == pytest.approx(size, rel=2e-3)  # a circle is its chords
    assert found[1] == named


def test_errors_were_measured_for_several_spacings_and_grow_with_them() -> None:
    assert set(measured()) == {3.0, 4.0}
    assert [len(curves) for curves in measured().values()] == [3, 3]
    for curve in itertools.chain(*measured().values()):
        assert len(curve.spacing) == 4
        assert (np.diff(curve.spacing) > 0).all()
        assert (np.diff(curve.error) >= 0).all()
        assert curve.share(0.4 * curve.error[0]) is None
        assert curve.share(0.8 * curve.error[0]) == pytest.approx(0.8 * curve.spacing[0])
        assert curve.at(0.8 * curve.spacing[0]) == pytest.approx(0.8 * curve.error[0])
        middle = curve.share(float(np.sqrt(curve.error[0] * curve.error[-1])))
        assert middle is not None
        assert curve.at(middle) == pytest.approx(np.sqrt(curve.error[0] * curve.error[-1]))


def test_a_stricter_error_needs_a_finer_grid() -> None:
    scene = PLATE.hole(Circle(0.05, 0.03, 0.01))
    found = [proposal(scene, within) for within in (0.05, 0.03, 0.02)]
    assert all(one.error <= one.within for one in found)
    assert [one.guessed for one in found] == [False, False, True]
    finest = [one.scene.finest for one in found]
    assert finest == sorted(finest, reverse=True)
    assert finest[0] > finest[-1]


def test_more_than_was_measured_is_not_promised() -> None:
    with pytest.raises(SceneError, match=naming("--within", found="1e-06", expected=re.compile(r"0\.\d+"))):
        proposal(PLATE, 1e-6)


def test_a_scene_without_zones_gets_one_around_its_features() -> None:
    scene = PLATE.hole(Circle(0.05, 0.03, 0.01)).load("right", traction=(1e6, 0), rows=4)
    found = changed(scene, 1e-3, 3.0)
    assert [(request.target, request.spacing) for request in found.refinements] == [("hole", 1e-3)]
    assert found.spacing == 2e-3
    grid, _, _ = build_grid(found)
    assert np.unique(grid.delta).tolist() == [1e-3, 2e-3]
    assert found.conditions[0].place.rows == 4  # of 2 mm, as before
    assert found.run.time_step is not None
    assert found.run.steps * found.run.time_step == pytest.approx(400e-7, rel=0.01)


@pytest.mark.slow
def test_drawn_zones_keep_their_shape_and_ratio() -> None:
    scene = read_scene(GEOMETRIES / "duran50.geo")
    found = changed(scene, 5e-4, 4.0)
    assert {zone.name: zone.spacing for zone in found.zones} == {"fine": 5e-4, "coarse": 1e-3}
    assert [one.place.rows for one in found.conditions] == [8, 8]
    asked = settings(accuracy_estimate.Proposal(0.1, 0.02, "", 0.1, False, found))
    assert asked["Zones/fine/Spacing"] == "0.0005"
    assert asked["Loads/top/Rows"] == "8"
    again = read_scene(GEOMETRIES / "duran50.geo", list(asked.items()))
    assert [one.place.rows for one in again.conditions] == [8, 8]
    assert again.finest == 5e-4


@pytest.mark.process
def test_what_is_proposed_is_in_the_unit_of_the_drawing() -> None:
    scene = read_scene(GEOMETRIES / "duran50.geo")
    in_mm = dataclasses.replace(scene, parameters=(*scene.parameters, ("Peridynamics/Units", "mm")))
    found = accuracy_estimate.Proposal(0.1, 0.02, "", 0.1, False, changed(in_mm, 5e-4, 4.0))
    assert settings(found)["Zones/fine/Spacing"] == "0.5"


@pytest.mark.slow
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(GEOMETRIES / "duran50.geo"), "--within", "10%", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["proposal"]["promised"] <= 0.1
    assert found["scene"]["nodes"] > 0
    assert main(["plan", str(GEOMETRIES / "duran50.geo"), "--within", "10%"]) == 0
    assert mentions(capsys.readouterr().out, "--set", "'Zones/fine/Spacing=")
    assert main(["plan", str(GEOMETRIES / "duran50.geo"), "--within", "0.0001%"]) == 2
    assert mentions(capsys.readouterr().err, "finer", "grids", "measured")
    with pytest.raises(SystemExit):
        main(["plan", str(GEOMETRIES / "duran50.geo"), "--within", "much"])
    assert mentions(capsys.readouterr().err, found="'much'", expected=("2%", "0.02"))


@pytest.mark.slow
def test_a_fine_zone_that_moves_is_proposed_where_it_takes_fewer_updates(capsys: pytest.CaptureFixture[str]) -> None:
    """For a crack in a large plate; not without a crack, and not where the solver would refuse it."""
    drawing = GEOMETRIES / "duran50.geo"
    scene = read_scene(drawing)
    found = proposal(scene, 0.05)
    assert found.adapt == "hybrid"
    assert found.error <= 0.05
    two_scales = changed(scene, found.scene.finest, found.scene.horizon)
    assert accuracy_estimate.updates(found.scene) < 0.7 * accuracy_estimate.updates(two_scales)
    held = scene.move("left", acceleration=(0.0, -9.81))
    assert proposal(held, 0.05).adapt == "none"
    assert proposal(PLATE.hole(Circle(0.05, 0.03, 0.01)), 0.05).adapt == "none"
    struck = read_scene(GEOMETRIES / "kalthoff_winkler.geo")  # a run of that is stopped in step 23
    assert proposal(struck, 0.05).adapt == "none"
    assert main(["plan", str(drawing), "--within", "5%"]) == 0
    assert "\n  --adapt hybrid\n" in capsys.readouterr().out
