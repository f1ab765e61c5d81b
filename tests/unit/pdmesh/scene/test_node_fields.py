"""Fields by node: what a source gives, what is refused, and the distribution of random strengths."""

from __future__ import annotations

from collections.abc import Callable
from math import gamma
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pdmesh import Body, Box, Material, Picture, Scene, SceneError, Weibull, box, build, read_scene
from pdmesh.model.document import read_file
from pdmesh.model.node_grid import grid_of

GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
PLATE = Scene(box(0, 0, 0.02, 0.01), 1e-3, GLASS)


def values(scene: Scene | Body, quantity: str = "E") -> NDArray[np.float64]:
    grid = build(scene).grid
    return next(column.values for column in grid.fields if column.quantity == quantity)


def linear(x: float, y: float) -> float:
    return 65e9 * (1 + x / 0.04)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a table, arrays, a mesh and a picture of E = 65 GPa (1 + x / 40 mm)."""
    monkeypatch.chdir(tmp_path)
    x, y = (each.ravel() for each in np.meshgrid([0.0, 0.01, 0.02], [0.0, 0.01]))
    rows = np.column_stack([x, y, linear(x, y)])  # type: ignore[arg-type]
    np.savetxt("E.csv", rows, delimiter=",", header="x,y,E", comments="")
    np.save("places.npy", rows)
    np.save("nodes.npy", linear(*build(PLATE).grid.position.T))
    cells = "<DataArray type='Int64' Name='connectivity'>0 1 4 3 1 2 5 4</DataArray>"
    cells += (
        "<DataArray type='Int64' Name='offsets'>4 8</DataArray><DataArray type='UInt8' Name='types'>9 9</DataArray>"
    )
    points = " ".join(f"{a} {b} 0" for a, b in zip(x, y, strict=True))
    Path("E.vtu").write_text(
        "<VTKFile type='UnstructuredGrid' version='0.1' byte_order='LittleEndian'><UnstructuredGrid>"
        f"<Piece NumberOfPoints='6' NumberOfCells='2'><Points><DataArray type='Float64' NumberOfComponents='3'>{points}"
        f"</DataArray></Points><Cells>{cells}</Cells><PointData><DataArray type='Float64' Name='E'>"
        + " ".join(map(repr, rows[:, 2].tolist()))
        + "</DataArray></PointData><CellData><DataArray type='Float64' Name='grain'>1e9 2e9</DataArray></CellData>"
        "</Piece></UnstructuredGrid></VTKFile>",
        encoding="ascii",
    )
    Image.fromarray(np.array([[0, 200], [90, 255]], dtype=np.uint8)).save("slice.png")
    return tmp_path


@pytest.mark.parametrize(
    "source", [linear, "65e9 * (1 + x / 0.04)", "E.csv", "E.csv:E", "places.npy", "nodes.npy", "E.vtu:E"]
)
def test_every_source_gives_the_same_values(here: Path, source: Any) -> None:
    found = values(PLATE.vary("E", source))
    assert found == pytest.approx(linear(*build(PLATE).grid.position.T), rel=1e-12)


def test_nearest_places_cells_and_pixels(here: Path) -> None:
    x, y = build(PLATE).grid.position.T
    assert set(values(PLATE.vary("E", "E.csv", rule="nearest"))) == {65e9, 81.25e9, 97.5e9}
    grains = values(PLATE.vary("E", "E.vtu:grain", rule="nearest"))
    assert (grains[x < 0.0099] == 1e9).all()
    assert (grains[x > 0.0101] == 2e9).all()
    grey = values(PLATE.vary("E", Picture("slice.png", levels=((0, 1e9), (100, 2e9)))))
    assert grey.tolist() == np.where(x >= 0.01, 2e9, 1e9).tolist()  # 0, 200 above 90, 255
    assert values(PLATE.vary("E", Picture("slice.png", ((0, 1e9), (80, 2e9)))))[(x < 0.01) & (y < 0.005)].min() == 2e9


def test_regions_and_later_fields_count(here: Path) -> None:
    stiff = Material(E=200e9, rho=7800.0, G0=1e4)
    scene = PLATE.region(box(0.0101, -1, 1, 1), stiff, "steel").vary("E", "210e9 + 0 * x", region="steel")
    grid = build(scene.vary("rho", 2000.0)).grid
    right = grid.position[:, 0] > 0.0101
    assert np.isnan(grid.fields[0].values[~right]).all()
    assert set(grid.fields[0].values[right]) == {210e9}
    assert set(grid.fields[1].values) == {2000.0}
    assert [column.source for column in grid.fields] == ["210e9 + 0 * x", "2000.0"]
    twice = build(PLATE.vary("G0", "100 + 0 * x").vary("G0", Weibull(8, 1e-6, 1))).grid.fields[0]
    once = build(PLATE.vary("G0", Weibull(8, 1e-6, 1))).grid.fields[0]
    assert twice.values == pytest.approx(once.values * 100 / 204, rel=1e-12)
    assert twice.source == "100 + 0 * x; Weibull(m=8, V0=1e-06, seed=1, block=0.003)"


def test_a_critical_stretch_is_the_energy_of_that_stretch() -> None:
    alone = build(Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=65e9, rho=2235.0, critical_stretch=1e-3)))
    assert alone.settings.material is not None
    assert set(values(PLATE.vary("critical_stretch", 1e-3), "G0")) == {alone.settings.material.G0}


@pytest.mark.process
def test_a_file_and_a_program_hand_over_the_values(here: Path) -> None:
    source = "from pdmesh import Material, Scene, box\n\ndef E(x, y):\n    return 65e9 * (1 + x / 0.04)\n\n"
    source += "glass = Material(E=65e9, rho=2235.0, G0=204.0)\n"
    source += "scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, glass).vary('E', E).vary('G0', 'G0.csv')\n"
    (here / "plate.py").write_text(source, encoding="utf-8")
    (here / "G0.csv").write_text("x,G0\n0,100\n0.02,200\n", encoding="utf-8")
    built = build(read_scene(here / "plate.py", trust=True))
    built.write(here / "plate.json")
    again = grid_of(read_file(here / "plate.json"), "plate.json")
    x = again.position[:, 0]
    for column, expected in zip(again.fields, (65e9 * (1 + x / 0.04), 100 + 5000 * x), strict=True):
        assert column.values == pytest.approx(expected, rel=1e-12)
    assert [column.source for column in again.fields] == ["function E", "G0.csv, linear"]


@pytest.mark.process
def test_a_body_has_fields() -> None:
    body = Body(Box((0, 0, 0), (0.008, 0.004, 0.004)), 1e-3, GLASS)
    found = values(body.vary("E", lambda x, y, z: 65e9 * (1 + z / 0.004)))
    assert found.reshape(4, -1).tolist() == [[65e9 * (1 + z)] * 32 for z in (0.125, 0.375, 0.625, 0.875)]


@pytest.mark.parametrize(
    ("quantity", "source", "says"),
    [
        ("E", "-x", r"field of E is 0 at \(0, 0\) m; use 1e-30"),
        ("E", lambda x, y: -1.0, r"field of E is -1 at \(0, 0\) m"),
        ("E", float("nan"), r"field of E is .* at \(0, 0\) m"),
        ("E", lambda x, y: x[0], r"field of E: the function raises TypeError at \(0, 0\) m"),
        ("E", np.ones(7), r"has the shape \(7,\); give \(231,\), one for each node"),
        ("E", "short.npy", r"short.npy, linear has the shape \(5,\); give \(231,\)"),
        ("E", "missing.csv", r"field of E: missing.csv: cannot be read: there is no such file"),
        ("E", "small.csv", r"m outside of its table; use a table that covers it"),
        ("E", "nan.csv", r"nan.csv: numbers in a table are not finite"),
        ("E", "E.vtu", r"E.vtu has the values E, grain; name one of them, E.vtu:NAME"),
        ("E", "E.vtu:nu", r"E.vtu has the values E, grain; name one"),
        ("E", "missing.vtu:E", r"missing.vtu: cannot be read"),
        ("E", "../E.vtu:E", r"cannot be used; give the name of one beside the model"),
        ("E", "text.vtu:E", r"text.vtu: cannot be read"),
        ("E", Picture("text.png", ((0, 1e9),)), r"text.png: cannot be read"),
        ("E", Picture("slice.png", ((50, 1e9),)), r"slice.png has a grey of 0, below all levels"),
        ("E", Picture("slice.png", ((0, 1e9),), (0, 0, 0.01, 0.01)), r"is outside of slice.png; use a box that covers"),
        ("E", Weibull(8, 1e-6, 1), r"Weibull draws strengths; use it for f_t"),
        ("G0", Weibull(-8, 1e-6, 1), r"use positive m, V0 and block"),
        ("G0", Weibull(8, 1e-6, 1, block=1e-3), r"block is 0.001 m; use at least 2 spacings"),
        ("f_t", 1e6, r"field of f_t cannot differ by node; give the material law 'cohesive'"),
        ("size", 1.0, r"field of size: no such constant; use E, rho, G0"),
        ("E", object(), r"use a number, numbers or one of the sources"),
    ],
)
def test_a_wrong_source_says_what_to_do(here: Path, quantity: str, source: Any, says: str) -> None:
    np.save("short.npy", np.ones(5))
    (here / "small.csv").write_text("x,y,E\n0,0,1e9\n0.005,0,1e9\n0,0.005,1e9\n", encoding="utf-8")
    (here / "nan.csv").write_text("x,E\n0,1e9\n0.02,nan\n", encoding="utf-8")
    for name in ("text.vtu", "text.png"):
        (here / name).write_text("no", encoding="utf-8")
    with pytest.raises(SceneError, match=says):
        build(PLATE.vary(quantity, source))


def test_an_unknown_region_or_rule_is_refused() -> None:
    with pytest.raises(SceneError, match="no region is called 'steel'; use none"):
        build(PLATE.vary("E", 1e9, region="steel"))
    with pytest.raises(SceneError, match="rule is 'cubic'; use linear or nearest"):
        PLATE.vary("E", 1e9, rule="cubic")  # type: ignore[arg-type]


def test_a_steep_stiffness_is_said() -> None:
    steps: Callable[[float, float], float] = lambda x, y: 65e9 if x < 0.01 else 6.5e9  # noqa: E731
    assert any(
        "E changes by a factor of 10 within a horizon of" in note for note in build(PLATE.vary("E", steps)).notes
    )
    assert not any("E changes" in note for note in build(PLATE.vary("E", linear)).notes)


@pytest.mark.slow
def test_strengths_have_the_mean_and_the_scatter_of_weibull() -> None:
    """At m = 8 over s0: mean 0.94174, coefficient of variation 0.14837; volumes 1:8:64 as 1 : 0.77111 : 0.59460."""
    side, spread = 200, 0.14837 / 200  # of the mean of 40 000
    corners = np.stack(np.meshgrid(*[np.arange(side)] * 2), axis=-1).reshape(-1, 2) + 0.5
    drawn = Weibull(8.0, 1.0, seed=3).factors(corners, 1.0)
    assert drawn.mean() == pytest.approx(gamma(1 + 1 / 8), abs=4 * spread)  # 0.94174
    assert drawn.std() / drawn.mean() == pytest.approx(0.14837, rel=0.02)  # 3 standard deviations
    assert np.median(drawn) == pytest.approx(0.95521, abs=5 * spread)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.02
    for volumes, ratio in ((8, 0.77111), (64, 0.59460)):
        weakest = drawn[: len(drawn) // volumes * volumes].reshape(-1, volumes).min(axis=1)
        scatter = 4 * 0.14837 / np.sqrt(len(weakest)) * np.sqrt(1 + 1 / volumes)
        assert weakest.mean() / drawn.mean() == pytest.approx(ratio, rel=scatter)
        larger = Weibull(8.0, 1.0, seed=3).factors(np.sqrt(volumes) * corners, np.sqrt(volumes))
        assert larger == pytest.approx(drawn * volumes**-0.125, rel=1e-12)  # the same draw on larger blocks


def test_a_draw_depends_on_seed_and_block_alone() -> None:
    fine = build(Scene(box(0, 0, 0.02, 0.01), 5e-4, GLASS).vary("G0", Weibull(8, 1e-6, 1, block=3e-3))).grid
    coarse = build(PLATE.vary("G0", Weibull(8, 1e-6, 1))).grid
    at = {tuple(place): value for place, value in zip(fine.position.tolist(), fine.fields[0].values, strict=True)}
    assert [at[tuple(place)] for place in coarse.position.tolist()] == coarse.fields[0].values.tolist()
    assert len(np.unique(coarse.fields[0].values)) == 7 * 4
    other = values(PLATE.vary("G0", Weibull(8, 1e-6, 2)), "G0")
    assert not (other == coarse.fields[0].values).any()
    assert values(PLATE.vary("G0", Weibull(8, 1e-6, 1)), "G0").tolist() == coarse.fields[0].values.tolist()
    strength = coarse.fields[0].values / 204
    assert np.sqrt(strength) == pytest.approx(Weibull(8, 1e-6, 1).factors(coarse.position, 3e-3), rel=1e-12)


def test_a_field_is_refused_that_another_material_does_not_use() -> None:
    weld = Material(E=65e9, rho=2235.0, G0=204.0, law="cohesive", f_t=1e6)
    scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, GLASS).region(box(0.01, 0, 0.02, 0.01), weld, "weld")
    with pytest.raises(SceneError, match="field of f_t cannot differ by node; give the material law 'cohesive'"):
        build(scene.vary("f_t", 2e6, region="weld"))


def test_energies_of_critical_stretches_follow_E() -> None:
    glass = Material(E=65e9, rho=2235.0, critical_stretch=1e-3)
    stiffer = Scene(box(0, 0, 0.02, 0.01), 1e-3, glass).vary("E", "65e9 * (1 + x / 0.02)")
    with pytest.raises(SceneError, match=r'field of E: .*vary\("critical_stretch"'):
        build(stiffer)
    fields = {column.quantity: column.values for column in build(stiffer.vary("critical_stretch", 1e-3)).grid.fields}
    earlier = build(
        Scene(box(0, 0, 0.02, 0.01), 1e-3, glass).vary("critical_stretch", 1e-3).vary("E", "65e9 * (1 + x / 0.02)")
    )
    assert fields["G0"] / fields["E"] == pytest.approx(fields["G0"][0] / fields["E"][0], rel=1e-12)
    assert np.array_equal(earlier.grid.fields[1].values, fields["G0"])
