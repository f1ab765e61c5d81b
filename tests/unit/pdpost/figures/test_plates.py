"""Pictures of a plate with a bore on two scales: clipped, without gaps, its edges and its pre-crack drawn."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from messages import naming

from pdmesh import Circle, Material, Run, Scene, box
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdpost.figures import bond_figure, crack_figure, field_figure, scene_figure, sheets
from pdpost.figures.scene_figure import scene
from pdsolve.measures import plate_geometry
from pdsolve.measures.plate_geometry import clipped_voronoi_cells, expect_same_plate, read_plate_geometry
from pdsolve.model import read_model
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import simulate

BORE = (0.0207, 0.0193, 0.004)  # off the lattice: squares of nodes do not reach its edge everywhere
GLASS = Material(E=65e9, rho=2235, G0=204)


def solved(path: Path, plan: Scene) -> Path:
    """A scene, a few steps on."""
    grid, settings, _ = build_grid(plan)
    write_file(document_of(grid, settings), path.with_suffix(".json"))
    simulate(read_model(path.with_suffix(".json")), path).close()
    return path


def plan(*holes: Circle) -> Scene:
    """A plate of 60 x 40 mm with a corner cut off, 2 mm between nodes and 1 mm on the right."""
    outline = [(0, 0), (0.06, 0), (0.06, 0.03), (0.05, 0.04), (0, 0.04)]
    scene = Scene(outline, 2e-3, GLASS, 3, Run(time_step=5e-8, steps=20, every=10))
    for hole in holes:
        scene = scene.hole(hole)
    scene = scene.zone(box(0.04, 0, 0.06, 0.04), 1e-3, "fine").crack([(0, 0.0311), (0.01, 0.0311)])
    return scene.load("top", traction=(0, 1e6), rows=1).fix("bottom")


@pytest.fixture(scope="module")
def bored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate with an 8 mm bore, nodes 2 mm apart around it: by its nodes alone it is a plus sign."""
    return solved(tmp_path_factory.mktemp("bored") / "bored.sqlite", plan(Circle(*BORE)))


def shot(figure: Figure, axes: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of a picture (rows, columns, 3) and where they are on its plate (rows, columns, 2), in its unit."""
    figure.set_dpi(80)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(int)
    rows, columns = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    ends = np.column_stack([columns.ravel(), rows.ravel()]) + 0.5
    return pixels, figure.axes[axes].transData.inverted().transform(ends).reshape(*pixels.shape[:2], 2)


PICTURES = {
    "damage": lambda results: field_figure.field(results, "damage", 20),
    "displacement": lambda results: field_figure.field(results, "displacement", 20),
    "stress": lambda results: field_figure.field(results, "stress", 20),
    "crack": lambda results: crack_figure.crack(results),
    "scene": lambda results: scene(results, {"conditions": []}),
}


@pytest.mark.slow
@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("what", PICTURES)
def test_fields_fill_the_plate_and_nothing_else(
    bored: Path, monkeypatch: pytest.MonkeyPatch, what: str, many: bool
) -> None:
    """No pixel inside is white, between the spacings neither; none in the bore or beyond the edges is painted."""
    if many:
        monkeypatch.setattr(plate_geometry, "MANY", 10)
    with Results.open(bored) as results:
        figure = PICTURES[what](results)
        on = read_plate_geometry(results)
        levels_of = np.unique(results.nodes().delta)
    assert levels_of.tolist() == [1e-3, 2e-3]
    if what == "scene":  # white lines between its nodes belong to it
        for collection in figure.axes[0].collections:
            collection.set_edgecolor("face") if not isinstance(collection, LineCollection) else None
    pixels, places = shot(figure)
    places = shapely.points(places / 1e3)
    edges = shapely.union(on.plate_shape.boundary, shapely.multilinestrings(list(on.pre_cracks.reshape(-1, 2, 2))))
    clear = ~shapely.dwithin(edges, places, 0.6e-3)  # of the lines that are drawn
    white = (pixels > 252).all(axis=2)
    inside, outside = shapely.contains(on.plate_shape, places), shapely.disjoint(on.plate_shape, places)
    outside &= shapely.dwithin(on.plate_shape.envelope, places, 0.2e-3)
    assert (inside & clear).sum() > 5_000
    assert not white[inside & clear].any()
    assert white[outside & clear].all()
    assert (outside & clear & shapely.dwithin(shapely.Point(BORE[:2]), places, BORE[2])).sum() > 100


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("what", [*PICTURES, "nodes", "bonds"])
def test_edges_and_pre_cracks_are_drawn(bored: Path, what: str) -> None:
    """Every ring of the model and the pre-crack, with a word for it in a legend."""
    more = {
        "nodes": lambda results: scene_figure.nodes(results, 20),
        "bonds": lambda results: bond_figure.bonds(results, 20),
    }
    with Results.open(bored) as results:
        figure = (PICTURES | more)[what](results)
        on = read_plate_geometry(results)
    drawn = [lines for lines in figure.axes[0].collections if isinstance(lines, LineCollection)]
    rings = [line for lines in drawn for line in lines.get_segments() if len(line) > 5]
    assert sorted(len(ring) - 1 for ring in rings) == sorted(len(ring) for ring in on.outline_and_holes)
    bore = min(rings, key=lambda ring: float(np.ptp(ring[:, 0])))
    assert np.hypot(*(bore - 1e3 * np.array(BORE[:2])).T) == pytest.approx(4.0, abs=0.03)
    (pre_crack,) = [lines for lines in drawn if lines.get_label() == "pre-crack"]
    assert pre_crack.get_segments()[0] == pytest.approx(np.array([[0.0, 31.1], [10.0, 31.1]]), abs=0.01)


@pytest.mark.slow
def test_cells_share_the_plate_out(bored: Path) -> None:
    """They cover the plate, none twice, and each has its node in it or on its edge; areas are those of the nodes."""
    with Results.open(bored) as results:
        nodes, on = results.nodes(), read_plate_geometry(results)
        own = clipped_voronoi_cells(nodes, on.plate_shape)
    shapes = []
    for row in range(len(nodes.ids)):
        corners = own.corner_offsets[own.node_rows == row]
        rings = np.split(corners, np.flatnonzero(own.is_last_of_ring[own.node_rows == row]) + 1)
        shapes.append(shapely.Polygon(rings[0] + nodes.position[row]))
    area = shapely.area(shapes)
    assert area.sum() == pytest.approx(on.plate_shape.area, rel=1e-9)
    assert area == pytest.approx(nodes.area, rel=1e-4)
    assert shapely.union_all(shapes).area == pytest.approx(area.sum(), rel=1e-9)
    assert shapely.dwithin(shapes, shapely.points(nodes.position), 1e-6).all()


def test_a_bore_smaller_than_a_cell_is_a_hole_in_it() -> None:
    from pdsolve.results import Nodes

    y, x = np.mgrid[0:3, 0:3] * 1e-3
    count = 9
    nodes = Nodes(
        np.arange(count), np.column_stack([x.ravel(), y.ravel()]), np.full(count, 1e-3), *[np.ones(count)] * 3
    )  # type: ignore[arg-type]
    shape = shapely.box(0, 0, 2e-3, 2e-3).difference(shapely.Point(1.2e-3, 1.2e-3).buffer(0.1e-3))
    own = clipped_voronoi_cells(nodes, shape)
    assert own.is_last_of_ring[own.node_rows == 4].sum() == 2  # two rings
    middle = own.corner_offsets[own.node_rows == 4]
    assert len(middle) > 20


def test_a_deformed_plate_keeps_its_cells(bored: Path) -> None:
    """Displaced with their nodes; where the edges were is dotted."""
    with Results.open(bored) as results:
        still, moved = field_figure.field(results, "damage", 20), field_figure.field(results, "damage", 20, scale=2e4)
        u = sheets.displacement(results, 20)
    one, other = (figure.axes[0].collections[0].get_paths() for figure in (still, moved))
    way = np.array([b.vertices.mean(axis=0) - a.vertices.mean(axis=0) for a, b in zip(one, other, strict=True)])
    assert np.abs(way - 2e7 * u).max() < 1.0  # of 2 mm: corners are where neighbours have them too
    assert np.abs(way).max() > 2
    edges = [lines for lines in moved.axes[0].collections if isinstance(lines, LineCollection)]
    assert all(lines.get_linestyle()[0][1] is not None for lines in edges)


def test_a_plate_without_an_outline_is_where_its_nodes_are(small_results: Path) -> None:
    with Results.open(small_results) as results:
        on, nodes = read_plate_geometry(results), results.nodes()
    assert on.outline_and_holes == ()
    assert on.plate_shape.area == pytest.approx(nodes.area.sum(), rel=1e-9)


def test_other_plates_are_not_alike(bored: Path, tmp_path: Path) -> None:
    """The same box without the bore, and with a smaller one, is another plate; a finer grid of it is the same."""
    without = solved(tmp_path / "whole.sqlite", plan())
    with Results.open(bored) as one, Results.open(without) as other:
        expect_same_plate(one, one)
        with pytest.raises(ResultsError, match=naming("whole.sqlite", found=re.compile(r"\(0\.0\d+,\ 0\.0\d+\)\ m"))):
            expect_same_plate(other, one)
