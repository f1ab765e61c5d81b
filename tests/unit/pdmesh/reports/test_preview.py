"""Pictures: what is drawn, not how it looks."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import pytest
from messages import naming

from pdmesh import Body, Box, Circle, Material, Scene, SceneError, build
from pdmesh.grid.bodies import build_body
from pdmesh.grid.lattice import build_grid
from pdmesh.model.node_grid import document_of
from pdmesh.plain_figure import FigureError, save
from pdmesh.reports.load_arrows import marker
from pdmesh.reports.preview import draw
from pdmesh.reports.report import info
from pdmesh.scene.solids import brick


@pytest.fixture
def scene(plate: Scene) -> Scene:
    plate = plate.hole(Circle(0.03, 0.01, 0.003)).crack([(0, 0.01), (0.012, 0.01)]).refine("crack", 1e-3)
    return plate.load("top", traction=(0, 1e6), rows=2).region(
        Circle(0.03, 0.01, 0.005), Material(1e9, 1e3, 1.0), "ring"
    )


def labels(scene: Scene, with_bonds: bool = False) -> list[str]:
    grid, settings, _ = build_grid(scene)
    figure = draw(document_of(grid, settings), "plate.json", with_bonds)
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_everything_has_its_entry(scene: Scene) -> None:
    grid, settings, _ = build_grid(scene)
    fine = int((grid.delta == 5e-4).sum())
    assert labels(scene) == [
        f"0.5 mm: {fine} nodes",
        f"1 mm: {len(grid) - fine} nodes",
        f"at a hole: {int((grid.hole_id >= 0).sum())} nodes",
        f"load 'top': {len(settings.conditions[0].nodes or ())} nodes, 40 kN/m",
        f"material 'ring': {len(settings.regions[0].nodes or ())} nodes",
        "crack",
    ]


@pytest.mark.slow
def test_bonds_around_a_crack(scene: Scene) -> None:
    intact, cut, *_ = labels(scene, with_bonds=True)
    assert intact.endswith(" bonds")
    assert cut.endswith(" bonds cut by a crack")
    assert int(cut.split()[0]) > 50


@pytest.mark.parametrize("micromodulus", ["conical", "constant"])
def test_bonds_drawn_are_those_of_the_run(micromodulus: str, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a window as large as the plate all bonds are drawn, and as many are cut as `info` says."""
    monkeypatch.setattr("pdmesh.reports.preview.WINDOW", 1e3)
    material = msgspec.structs.replace(scene.material, micromodulus=micromodulus)
    scene = dataclasses.replace(scene, material=material)
    grid, settings, _ = build_grid(scene)
    found = info(document_of(grid, settings), "plate.json")
    assert labels(scene, with_bonds=True)[:2] == [
        f"{found['bonds']} bonds",
        f"{found['bonds_cut_by_cracks']} bonds cut by a crack",
    ]


def test_bonds_without_a_crack_or_hole(plate: Scene) -> None:
    assert labels(plate, with_bonds=True)[0].endswith(" bonds")


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_pictures_are_files_with_the_same_bytes(suffix: str, magic: bytes, scene: Scene, tmp_path: Path) -> None:
    grid, settings, _ = build_grid(scene)
    figure = draw(document_of(grid, settings), "plate.json")
    save(figure, tmp_path / f"a{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes().startswith(magic)
    if suffix == ".png":
        save(figure, tmp_path / f"b{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_unknown_suffix(plate: Scene, tmp_path: Path) -> None:
    grid, settings, _ = build_grid(plate)
    with pytest.raises(FigureError, match=naming(found="suffix '.doc'")):
        save(draw(document_of(grid, settings), "plate.json"), tmp_path / "a.doc")
    assert not list(tmp_path.iterdir())


def test_the_sections_of_a_flat_body_leave_no_room_empty() -> None:
    heights = []
    for width in (1e-2, 3e-3):
        built = build(Body(brick((0, 0, 0), (1e-2, width, 3e-3)), 1e-3, Material(1e9, 1e3, 1.0)))
        heights.append(draw(built.document, "bar.json").get_figheight())
    assert heights == pytest.approx([9.2 - 0.3 * 4.2, 9.2 - 0.6 * 4.2])


def test_a_solid_without_a_surface_is_refused() -> None:
    with pytest.raises(SceneError, match=naming("body", found="Box", expected=("build", "read_scene"))):
        build_body(Body(Box((0, 0, 0), (1e-2, 3e-3, 3e-3)), 1e-3, Material(1e9, 1e3, 1.0)))


@pytest.mark.parametrize(
    ("spacing", "points", "size"), [(1e-3, 1e3, 0.6), (2e-3, 1e3, 1.2), (1e-3, 1e2, 0.25), (1, 1e2, 5)]
)
def test_the_mark_of_a_node_is_within_its_cell_and_can_be_seen(spacing: float, points: float, size: float) -> None:
    assert marker(spacing, points) == pytest.approx(size)
