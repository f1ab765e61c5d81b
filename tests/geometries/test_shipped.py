"""Every scene that ships builds to the numbers its header states; the six of the thesis exactly."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pages import text_of
from plates import GEOMETRIES, shipped

from pdmesh.drawing.file_reading import Built, build_file
from pdmesh.model.document import Displacement, Load, Velocity
from pdmesh.model.visibility import plate_of

# nodes in all, by spacing (mm), and on each condition
QUARTER = [
    4 * int(each) for each in "844444344543444535445435444536363544453454453544434544344444"
]  # nodes of the ring's sectors
SHIPPED = {
    "duran50.geo": (2732, {1: 101 * 22, 2: 51 * 10}, [204, 204]),
    "soda_lime.geo": (2732, {1: 101 * 22, 2: 51 * 10}, [204, 204]),
    "duran50_one_scale.py": (4242, {1: 101 * 42}, [808, 808]),
    "soda_lime_one_scale.py": (4242, {1: 101 * 42}, [808, 808]),
    "kalthoff_winkler.geo": (13255, {1: 101 * 107, 2: 51 * 48}, [51, 51, 49]),
    "kalthoff_winkler_steel.py": (20301, {1: 101 * 201}, [51]),
    "kalthoff_winkler_projectile.py": (25_000, {1: 25_000}, [5000]),
    "oblique_crack.geo": (4591, {0.5: 61 * 59, 1: 31 * 32}, [124, 124]),
    "plate_with_hole.geo": (6288, {0.5: 101 * 59 - 793, 1: 51 * 22}, [204, 204]),
    "v_notch.geo": (8931, {0.5: 99 * 81 - 400, 1: 32 * 41}, [164, 164]),
    "figure_18.geo": (5094, {0.8: 3078, 1.6: 2016}, [84, 29]),
    "branching_plate.py": (16482, {0.5: 201 * 82}, [603, 603]),
    "inclined_crack.py": (11814, {0.5: 7402, 1: 1492, 2: 2920}, [61, 61]),
    "pressurized_crack.py": (15474, {0.5: 7402, 1: 1492, 2: 6580}, [82]),
    "double_edge_notch.py": (4880, {1: 61 * 80}, [61, 61]),
    "forked_crack.py": (16482, {0.5: 201 * 82}, [603, 603]),
    "bar.py": (1111, {10: 1111}, [11, 11]),
    "surfing_crack.py": (1681, {1: 41 * 41}, [592]),
    "graded_bar.py": (2425, {1: 97 * 25}, [25, 25, 1]),
    "fibre_in_matrix.py": (4941, {0.5: 81 * 61}, [243, 243]),
    "polycrystal.py": (6561, {0.05: 81 * 81}, [243, 243]),
    "rubber_block.py": (441, {50: 441}, [21, 21]),
    "plastic_beam.py": (341, {10: 341}, [1] * 67),
    "bent_square.py": (289, {62.5: 289}, [1] * 289),
    "bending.py": (2737, {0.625: 161 * 17}, [1, 1, 1]),
    "notched_beam.py": (1320, {18.181818182: 110 * 12}, [1, 1, 1]),
    "colliding_fragments.py": (1392, {1: 1392}, [96, 96, 600, 600]),
    "branched_fragments.py": (4880, {1: 4880}, [440, 440, 2000, 2000]),
    "composite_plate_with_hole.py": (5820, {0.5: 5820}, [49, 49]),
    "compact_tension.py": (6400, {0.5: 3467, 1: 2933}, [1, 1]),
    "cook_membrane.py": (1481, {1000: 1481}, [45, 17]),
    "double_cantilever.py": (8040, {1: 8040}, [1, 1, 1, 1]),
    "beam_on_rollers.py": (1240, {2: 1240}, [40, 40, 40]),
    "brazilian_disc.py": (1958, {2: 1958}, [5, 5, 1]),
    "brazilian_platens.py": (1296, {2.5: 1296}, [4, 4]),
    "nooru_mohamed.py": (1671, {5: 1671}, [41, 20, 20, 41]),
    "offset_notch.py": (736, {5.08: 736}, [1, 1, 1]),
    "fatigue_compact_tension.py": (3780, {1: 63 * 60}, [8, 8, 2, 1]),
    "l_panel.py": (1281, {12.5: 1281}, [21, 1]),
    "drop_weight.py": (2892, {1.5: 2892}, [128, 52, 52]),
    "duran_metre.py": (40401, {5: 201 * 201}, [201, 201]),
    "disc.geo": (13040, {0.05: 13040}, [1264, 1736]),
    "strip.py": (12060, {0.5: 201 * 60}, [201, 201]),
    "figure_19.py": (5045, {0.5: 1635, 1: 1542, 2: 1868}, [58, 62]),
    "hot_disc.py": (1249, {1.5: 1249}, [137, 1, 1]),
    "cracking_disc.py": (1808, {1.25: 1808}, [196, 4, 1]),
    "quenched_slab.py": (12801, {0.1: 251 * 51}, [12801, 251, 51, 251, 51]),
    "drying_mud.py": (14_641, {1: 121 * 121}, [14_641, 14_641]),
    "penny.geo": (27_000, {1: 30**3}, [900, 900]),
    "inclined_penny.py": (27_000, {1: 30**3}, [2700, 2700]),
    "screw.geo": (21_624, {0.25: 4992, 0.5: 16_632}, [800, 10_048]),
    "branching_block.py": (20_480, {0.5: 40 * 16 * 32}, [640, 640]),
    "lug.geo": (4236, {1: 4236}, [120, 168]),
    "slanted_notch.py": (31_200, {1: 104 * 12 * 25}, [12, 12, 12]),
    "ball_through_glass.py": (14_952, {1: 14_952}, [552]),
    "expanding_ring.py": (3984, {0.5: 3984}, 4 * QUARTER),
    "kalthoff_winkler_block.py": (78_750, {1.333333333: 75 * 150 * 7}, [38 * 7]),
}
BODIES = {
    "penny.geo": 0.03**3,
    "inclined_penny.py": 0.03**3,
    "screw.geo": 4 / 3 * np.pi * 0.008**3,
    "branching_block.py": 0.02 * 0.008 * 0.016,
    "lug.geo": 0.006 * (0.03 * 0.02 + np.pi * (0.01**2 / 2 - 0.004**2)),
    "slanted_notch.py": 0.104 * 0.012 * 0.025,
    "ball_through_glass.py": 0.06**2 * 4e-3 + 4 / 3 * np.pi * 5e-3**3,
    "expanding_ring.py": np.pi * (0.021**2 - 0.019**2) * 0.002,
    "kalthoff_winkler_block.py": 0.1 * 0.2 * 7 * 0.1 / 75,
}  # m^3


@cache
def built(name: str) -> Built:
    return shipped(name)


def test_no_shipped_scene_is_left_out() -> None:
    assert {path.name for path in GEOMETRIES.iterdir() if path.suffix in (".geo", ".py")} == set(SHIPPED)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in ("screw.geo", "expanding_ring.py") else ())
        for name in SHIPPED
    ],
)
def test_counts(name: str) -> None:
    """Cells tile the plate, or fill the body, and there is nothing to warn of."""
    nodes, by_spacing, on_conditions = SHIPPED[name]
    grid, settings, notes = built(name).grid, built(name).settings, built(name).notes
    assert len(grid) == nodes
    spacings, counts = np.unique(grid.delta, return_counts=True)
    assert dict(zip(np.round(spacings * 1e3, 9).tolist(), counts.tolist(), strict=True)) == by_spacing
    assert [len(condition.nodes or ()) for condition in settings.conditions] == on_conditions
    assert notes == ()
    if name in BODIES:
        assert grid.cells.sum() == pytest.approx(BODIES[name], rel=1e-9)  # measured: 1e-14
        assert grid.cells.min() > 0
    else:
        plate = plate_of(grid)
        assert plate is not None
        assert grid.areas is not None
        assert grid.areas.sum() == pytest.approx(plate.area, rel=1e-12)  # measured: below 3e-16
        assert grid.areas.min() > 0


@pytest.mark.parametrize("name", SHIPPED)
def test_header_names_its_source_and_what_is_calibrated(name: str) -> None:
    text = (GEOMETRIES / name).read_text(encoding="utf-8")
    assert "Source: " in text
    assert "Calibrated: " in text


def rows(built: Built, axis: int, spacing: float) -> list[float]:
    """The coordinates of the rows of one spacing, mm."""
    grid = built.grid
    return np.unique(np.round(grid.position[grid.delta == spacing, axis] * 1e3, 9)).tolist()


@pytest.mark.slow
def test_duran_rows() -> None:
    assert rows(built("duran50.geo"), 1, 1e-3) == np.arange(-10.5, 11, 1).tolist()
    assert rows(built("duran50.geo"), 1, 2e-3) == [-20, -18, -16, -14, -12, 12, 14, 16, 18, 20]
    assert rows(built("duran50_one_scale.py"), 1, 1e-3) == np.arange(-20.5, 21, 1).tolist()
    (shift,) = built("duran50.geo").shifts
    assert (shift.spacing, shift.offset) == (1e-3, (0.0, 0.5e-3))
    assert not built("duran50_one_scale.py").shifts


@pytest.mark.slow
def test_kalthoff_rows_and_conditions() -> None:
    model = built("kalthoff_winkler.geo")
    assert rows(model, 1, 1e-3) == list(range(47, 154))
    assert rows(model, 1, 2e-3) == [*range(0, 48, 2), *range(154, 202, 2)]
    bottom, top, impact = model.settings.conditions
    assert isinstance(impact, Velocity)
    assert (impact.x, impact.y, impact.profile) == (32, None, ())
    struck = model.grid.position[np.array(impact.nodes) - 1] * 1e3
    assert struck[:, 0].max() == 0
    assert sorted(np.round(struck[:, 1], 6)) == list(range(76, 125))
    for held, height in ((bottom, 0.0), (top, 0.2)):
        assert isinstance(held, Displacement)
        assert (held.x, held.y) == (0, 0)
        assert (model.grid.position[np.array(held.nodes) - 1, 1] == height).all()
    material = model.settings.material
    assert material is not None
    assert (material.law, material.kr, material.keep_G0) == ("bilinear", 1.638, False)


@pytest.mark.slow
def test_oblique_and_hole_rows() -> None:
    assert rows(built("oblique_crack.geo"), 1, 0.5e-3) == np.arange(15.5, 45, 0.5).tolist()
    assert rows(built("oblique_crack.geo"), 1, 1e-3) == [*range(16), *range(45, 61)]
    assert rows(built("plate_with_hole.geo"), 1, 0.5e-3) == np.arange(10.5, 40, 0.5).tolist()
    grid = built("plate_with_hole.geo").grid
    radius = np.hypot(*(grid.position * 1e3 - 25).T)
    assert radius.min() == pytest.approx(8, abs=1e-9)  # nodes on the edge of the hole stay
    assert (grid.hole_id >= 0).sum() == (radius < 8.5 - 1e-6).sum() == 96


@pytest.mark.slow
def test_v_notch_keeps_the_nodes_on_its_edges() -> None:
    grid = built("v_notch.geo").grid
    x, y = (grid.position * 1e3).T
    above = y - 30 - np.abs(x - 40)
    assert above[np.abs(x - 40) < 10].max() == pytest.approx(0, abs=1e-9)
    assert (np.abs(above) < 1e-9).sum() == 41  # 20 on each flank and the root


@pytest.mark.slow
def test_loads_of_both_edges_balance() -> None:
    for name in ("duran50.geo", "duran50_one_scale.py", "oblique_crack.geo", "plate_with_hole.geo", "v_notch.geo"):
        first, second = built(name).settings.conditions
        assert isinstance(first, Load)
        assert isinstance(second, Load)
        assert first.traction is not None
        assert second.traction is not None
        assert first.length == pytest.approx(second.length, rel=1e-12)
        assert np.add(first.traction, second.traction).tolist() == [0, 0]


@pytest.mark.slow
def test_the_scene_of_the_guide_builds(tmp_path: Path) -> None:
    blocks = text_of("guide/geometry").split("```python\n")[1:]
    code = next(block for block in blocks if "scene = (" in block).split("```")[0]
    path = tmp_path / "plate.py"
    path.write_text(code, encoding="utf-8")
    grid = build_file(path, trust=True).grid
    assert np.unique(grid.delta).tolist() == [5e-4, 1e-3]
    assert len(grid.holes) == 1
    assert len(grid.cracks) == 2
