"""Pictures: the same bytes each time, the right colours at the right places."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure
from messages import mentions, naming
from new_databases import create_writer
from numpy.typing import NDArray
from pages import text_of

from pdpost.figures import (
    animation,
    bond_figure,
    colours,
    crack_figure,
    field_figure,
    scene_figure,
    sheets,
    style,
    tradeoff_figure,
)
from pdpost.figures.colours import prefixed
from pdpost.figures.style import FigureError
from pdsolve.measures import crack_summary, plate_geometry
from pdsolve.measures.bond_pairs import read_bond_pairs
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.fields import FIELDS, FieldError
from pdsolve.measures.tips import crack_branches
from pdsolve.results import Breaks, Families, FrameRecord, Results, ResultsError
from pdsolve.run.measures import EnergyBalanceRow

DRAW: dict[str, Callable[[Results], Figure]] = {
    "damage": lambda results: field_figure.field(results, "damage", 60),
    "stress": lambda results: field_figure.field(results, "stress", 60, scale=2.0),
    "nodes": lambda results: scene_figure.nodes(results, 60, scale=1.0),
    "bonds": lambda results: bond_figure.bonds(results, 60),
}


suffixes = pytest.mark.parametrize(
    "suffix", [".png", *(pytest.param(one, marks=pytest.mark.slow) for one in (".svg", ".pdf"))]
)


@pytest.mark.slow
@pytest.mark.parametrize("what", DRAW)
@suffixes
def test_a_picture_has_the_same_bytes_each_time(small_results: Path, tmp_path: Path, suffix: str, what: str) -> None:
    written = []
    for name in ("one", "two"):
        with Results.open(small_results) as results:
            style.save(DRAW[what](results), tmp_path / f"{name}{suffix}")
        written.append((tmp_path / f"{name}{suffix}").read_bytes())
    assert written[0] == written[1]
    assert len(written[0]) > 1000


def test_the_damage_picture(small_results: Path) -> None:
    """A cell of each node's size and value, equal axes, colours from 0 to 1, the time in the title."""
    with Results.open(small_results) as results:
        figure = field_figure.field(results, "damage", 40)
        nodes, values = results.nodes(), damage_without_pre_cracks_at(results, 40).astype(np.float32)
    axes = figure.axes[0]
    cells = axes.collections[0]
    assert axes.get_aspect() == 1.0
    assert cells.get_clim() == (0, 1)
    assert np.array_equal(np.asarray(cells.get_array(), dtype=np.float32), values)
    corners = np.array([path.vertices[:4] for path in cells.get_paths()])
    assert corners.mean(axis=1) == pytest.approx(nodes.position * 1e3, abs=1e-5)  # to a millionth of a spacing
    assert np.ptp(corners, axis=1) == pytest.approx(1.0, rel=1e-5)
    assert axes.get_title() == "Damage at 2 µs (step 40)"


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("name", "letter"), [("displacement", "u"), ("velocity", "v")])
def test_sizes_of_vectors_in_handy_units(small_results: Path, name: str, letter: str) -> None:
    with Results.open(small_results) as results:
        figure = field_figure.field(results, name, 60)
        size = np.hypot(results.field(f"{letter}x", 60).astype(float), results.field(f"{letter}y", 60))
    scale, prefix = prefixed(float(size.max()))
    cells = figure.axes[0].collections[0]
    assert np.asarray(cells.get_array()) == pytest.approx(size * scale, rel=1e-12)
    assert 1 <= size.max() * scale < 1000
    assert figure.axes[1].get_ylabel() == f"{name}, {prefix}{FIELDS[name].unit}"


@pytest.mark.parametrize(
    ("largest", "handy"), [(0.0, (1, "")), (3e-5, (1e6, "µ")), (1.0, (1, "")), (2e7, (1e-6, "M")), (1e-30, (1e9, "n"))]
)
def test_prefixes(largest: float, handy: tuple[float, str]) -> None:
    factor, prefix = prefixed(largest)
    assert (factor, prefix) == (pytest.approx(handy[0], rel=1e-12), handy[1])


def test_fields_that_were_not_stored_are_named(few_results: Path) -> None:
    with Results.open(few_results) as results, pytest.raises(ResultsError, match=naming(found="field 'energy'")):
        field_figure.field(results, "energy", 60)


def test_formats_and_settings_that_are_none(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        figure = field_figure.field(results, "damage", 0)
    with pytest.raises(FigureError, match=naming("x.foo", found="suffix '.foo'")):
        style.save(figure, tmp_path / "x.foo")
    for setting, message in (
        ({"fontsize": "3"}, "--style fontsize is no matplotlib setting"),
        ({"font.size": "big"}, r"--style font\.size=big: "),
    ):
        with pytest.raises(FigureError, match=message), style.styled(setting):
            pass
    assert list(tmp_path.glob("x*")) == []


@pytest.mark.slow
def test_signed_values_have_colours_on_both_sides_of_zero(small_results: Path) -> None:
    with Results.open(small_results) as results:
        figure = field_figure.field(results, "velocity", 60, part="y")
        largest = float(np.abs(results.field("vy", 60)).max())
        narrow = field_figure.field(results, "velocity", 60, part="y", largest=2.0)
        with pytest.raises(FieldError, match=naming("velocity", found="component 'xx'", expected=("magnitude", "x"))):
            field_figure.field(results, "velocity", 60, part="xx")
        with pytest.raises(FieldError, match=naming("damage", found="component 'x'", expected=("none", "scalar"))):
            field_figure.field(results, "damage", 60, part="x")
    cells = figure.axes[0].collections[0]
    factor, _ = prefixed(largest)
    assert cells.get_clim() == pytest.approx((-largest * factor, largest * factor))
    assert narrow.axes[0].collections[0].get_clim() == (-2.0, 2.0)


def test_colours_end_at_the_usual_largest() -> None:
    """One value in a thousand that is far above all others does not make the others all alike."""
    values = np.full(1000, 2.0)
    assert colours.usual(values) == 2.0
    values[7] = -3.9
    assert colours.usual(values) == 3.9
    values[7] = -100.0
    assert colours.usual(values) == 2.0
    shown = colours.colours("stress", "xx", values)
    assert (shown.low, shown.high, shown.beyond) == (-2.0, 2.0, "min")
    assert shown.full_label == "stress, xx, Pa\n(smallest -100)"
    assert colours.colours("energy", "", np.array([1.0, np.nan, 3e3])).label == "strain energy, kJ/m³"
    assert colours.colours("acceleration", "magnitude", np.array([2e7])).label == "acceleration, 10⁶ m/s²"
    assert colours.colours("strain", "xx", np.array([2e-3])).label == "strain, xx, 10⁻³"


def test_the_largest_that_a_picture_names_is_the_field_s() -> None:
    """The bar ends at 2 kJ/m^3, where all but one node are, and says what the last one has."""
    values = np.full(1000, 2e3)
    values[7] = 123456.0
    shown = colours.colours("energy", "", values)
    assert (shown.high, shown.full_label) == (2e3, "strain energy, kJ/m³\n(largest 123.5)")
    assert colours.colours("energy", "", values, 1e3).full_label == "strain energy, kJ/m³\n(largest 123.5)"
    assert colours.colours("energy", "", values, 1e6).full_label == "strain energy, MJ/m³"
    velocity = colours.colours("velocity", "x", np.concatenate([values, [-3e4, -3e4]]), 1e3)
    assert velocity.full_label == "velocity, x, 10³ m/s\n(smallest -30, largest 123.5)"


def test_a_film_names_the_largest_of_all_frames(small_results: Path) -> None:
    with Results.open(small_results) as results:
        steps = results.frames()[0].tolist()
        box = sheets.box_of([sheets.shape(results, steps[0], 0.0)])
        ranges = [animation._range(results, "energy", step, "", box) for step in steps]
        assert max(high for *_, high in ranges) == max(results.field("energy", step).max() for step in steps)


@pytest.mark.parametrize(("share", "seen_whole"), [(0.5, True), (0.005, False)])
def test_a_stretched_body_is_seen_whole_and_a_fragment_thrown_far_is_not(
    small_results: Path, share: float, seen_whole: bool
) -> None:
    """The part of the nodes at the right end moves by three lengths of the plate."""
    with Results.open(small_results) as results:
        shape = sheets.shape(results, results.frames()[0].tolist()[0], 0.0)
    position = shape.position.copy()
    length = np.ptp(position[:, 0])
    moved = np.argsort(position[:, 0])[-max(int(share * len(position)), 1) :]
    position[moved, 0] += 3 * length
    right_end = sheets.box_of([shape._replace(position=position, scale=1.0)])[2]
    assert (right_end > position[:, 0].max()) == seen_whole


def torn_plate() -> tuple[Results, NDArray[np.float64]]:
    """A lattice that is stretched by 1e-4, and the ids of two of its nodes that hang by a few bonds and are far off."""
    from damaged_results import at, lattice

    nodes = lattice(12, 9)._replace(cut=np.zeros(108, dtype=np.int64))
    near = np.abs(nodes.position[:, None] - nodes.position).max(axis=2)
    bonds = np.argwhere((near > 0) & (near < 1.5e-3))
    start = np.searchsorted(bonds[:, 0], np.arange(109))
    torn = [at(nodes, 5, 0), at(nodes, 6, 0)]
    breaks = [(1, node, int(nodes.ids[b])) for node in torn for b in bonds[start[node - 1] : start[node]][:5, 1]]
    breaks += [(1, int(nodes.ids[b]), node) for node in torn for b in bonds[start[node - 1] : start[node], 1]]

    def share(first: int, last: int) -> Families:
        return Families(start[first : last + 1] - start[first], bonds[start[first] : start[last], 1])

    material = json.dumps({"material": {"E": 65e9, "rho": 2235.0, "G0": 204.0}})
    meta = {"time_step": 1e-6, "model": material}
    writer = create_writer(None, nodes._replace(family=np.diff(start)), share, np.empty((0, 4)), meta)
    u = 1e-4 * nodes.position[:, 0]
    u[np.array(torn) - 1] += [-1e-4, 1e-4]
    fields = {"ux": u, "uy": 0 * u}
    ledger = [EnergyBalanceRow(1, 1e-6, *[0.0] * 6, len(breaks))]
    writer.write(FrameRecord(1, 1e-6, fields, Breaks(*np.array(breaks).T), ledger, [], {}))
    return Results(writer.connection, "memory"), np.array(torn)


def test_torn_nodes_have_no_say_in_the_colours_of_strain_and_stress() -> None:
    """Two nodes that lost more than 0.35 of their bonds are hatched, said to be left out, and do not widen the
    colours."""
    results, torn = torn_plate()
    for name, few in (("strain", 0.02), ("stress", 1e9)):
        shown = field_figure.values_of(results, name, 1, "xy")
        assert np.flatnonzero(shown.torn).tolist() == (torn - 1).tolist()
        assert np.abs(shown.values[shown.torn]).max() > few  # what is fitted to the bonds that are left
        figure = field_figure.field(results, name, 1, part="xy")
        low, high = figure.axes[0].collections[0].get_clim()
        factor, _ = colours.unit(FIELDS[name].unit, few / 10)
        assert high == -low
        assert high < few * factor
        grey = next(one for one in figure.axes[0].collections if len(one.get_paths()) == 2 and one.get_array() is None)
        assert grey.get_facecolor()[0] == pytest.approx(to_rgba(style.TORN))
        assert [path.vertices.mean(axis=0)[0] for path in grey.get_paths()] == pytest.approx([5, 6], abs=0.3)
        words = [text.get_text() for text in figure.legends[0].get_texts()]
        assert words == ["left out, more than 0.35 of the bonds gone: 2 nodes"]
        assert [one.get_hatch() for one in figure.axes[0].collections].count(sheets.HATCHES[style.TORN]) == 1
        assert figure.legends[0].get_patches()[0].get_hatch()
    for name in ("damage", "displacement"):
        assert not field_figure.values_of(results, name, 1, "" if name == "damage" else "x").torn.any()


def test_numbers_of_stress_leave_torn_nodes_out_too() -> None:
    from pdpost.commands.shared import numbers

    results, _ = torn_plate()
    shown = field_figure.values_of(results, "stress", 1, "xy")
    told = numbers(shown)
    assert (told["nodes"], told["torn"], told["unknown"]) == (108, 2, 0)
    assert told["largest"] == shown.values[~shown.torn].max() < shown.values.max()


def test_nodes_without_a_value_are_explained(small_results: Path) -> None:
    with Results.open(small_results) as results:
        shown = field_figure.Shown(np.where(np.arange(252) < 3, np.nan, 1.0), np.zeros(252, dtype=bool))
        figure = field_figure.field(results, "stress", 60, shown=shown)
    assert mentions([text.get_text() for text in figure.legends[0].get_texts()], "too few bonds", "3 nodes")


def test_colours_are_those_of_what_is_seen(small_results: Path) -> None:
    """A window on slow nodes has their speeds on its bar."""
    with Results.open(small_results) as results:
        speed = np.hypot(results.field("vx", 60), results.field("vy", 60))
        position = results.nodes().position
        slowest = position[int(speed.argmin())]
        window = (*(slowest - 1.2e-3).tolist(), *(slowest + 1.2e-3).tolist())
        figure = field_figure.field(results, "velocity", 60, window=window)
    inside = (np.abs(position - slowest) <= 1.2e-3).all(axis=1)
    factor, _ = prefixed(float(speed[inside].max()))
    assert figure.axes[0].collections[0].get_clim()[1] == pytest.approx(speed[inside].max() * factor, rel=1e-6)
    assert speed[inside].max() < speed.max()


@pytest.mark.slow
@pytest.mark.parametrize("what", DRAW)
def test_fonts_are_true_type_and_text_is_text(small_results: Path, tmp_path: Path, what: str) -> None:
    """A PDF holds TrueType fonts and no shapes of letters of its own (Type 3); in an SVG words can be searched."""
    with Results.open(small_results) as results, style.styled():
        figure = DRAW[what](results)
        style.save(figure, tmp_path / "a.pdf")
        style.save(figure, tmp_path / "a.svg")
    pdf = (tmp_path / "a.pdf").read_bytes()
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    texts = [
        "".join(one.itertext())
        for one in ElementTree.parse(tmp_path / "a.svg").iter("{http://www.w3.org/2000/svg}text")
    ]
    assert figure.axes[0].get_title() in texts
    assert "x, mm" in texts


def test_the_guide_names_the_colours_that_are_drawn() -> None:
    """Bonds in the guide's table, and charts of cost against error, in the words of Okabe and Ito's palette."""
    assert (bond_figure.INTACT, bond_figure.BROKEN) == (style.SKY_BLUE, style.VERMILION)
    (bonds,) = (line for line in text_of("guide/figures").splitlines() if line.startswith("| `bonds`"))
    assert re.search("intact.* sky blue, .*broken.* vermilion", bonds)
    assert mentions(text_of("verification/accuracy_and_cost"), "vermilion ring", "blue")
    best = tradeoff_figure.BLUE
    assert best == style.BLUE
    assert mentions(text_of("guide/figures"), "light grey", "dark grey")
    assert (style.TORN, style.UNKNOWN) == ("#c8c8c8", "#707070")


def test_a_panel_of_cost_and_error() -> None:
    """Log axes without a box; what none beats is linked, others are open; an error that is unknown has no name."""
    axes = Figure().add_subplot()
    tradeoff_figure.draw(axes, np.array([1.0, 2.0, 4.0, 3.0]), np.array([0.1, 0.2, 0.05, np.nan]), ["a", "b", "c", "d"])
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert not axes.spines["top"].get_visible()
    others, best = (np.asarray(line.get_xdata()).tolist() for line in axes.lines[:2])
    assert (others, best) == ([2.0, 3.0], [1.0, 4.0])
    assert [text.get_text() for text in axes.texts[:3]] == ["a", "b", "c"]


def test_the_deformed_shape(small_results: Path) -> None:
    """Cells are where displacement times the scale puts them; the title says so."""
    with Results.open(small_results) as results:
        figure = field_figure.field(results, "damage", 60, scale=3.0)
        nodes = results.nodes()
        u = np.column_stack([results.field("ux", 60), results.field("uy", 60)]).astype(float)
    cells = figure.axes[0].collections[0]
    middles = np.array([path.vertices[:4] for path in cells.get_paths()]).mean(axis=1)
    assert middles == pytest.approx((nodes.position + 3.0 * u) * 1e3, abs=2e-2)  # of 1: corners are those of neighbours
    assert "3 times the displacement" in figure.axes[0].get_title()


def test_the_scale_that_shows_displacements(small_results: Path) -> None:
    """A round number: it moves nodes 2 to 5 % of the plate, and not less than they moved."""
    with Results.open(small_results) as results:
        assert sheets.chosen_scale(results, 0) == 1.0
        scale = sheets.chosen_scale(results, 60)
        u = np.hypot(results.field("ux", 60), results.field("uy", 60))
    assert 0.02 <= scale * np.percentile(u, 99) / 20e-3 <= 0.05 + 1e-12 or scale == 1.0
    assert f"{scale:.0e}"[0] in "125"


def test_bonds_are_blue_and_red(small_results: Path) -> None:
    """A line for each pair of nodes, between them; as many red ones as there are breaks."""
    with Results.open(small_results) as results:
        figure = bond_figure.bonds(results, 60)
        found = read_bond_pairs(results, 60)
        early = read_bond_pairs(results, 0)
        nodes, breaks, families = results.nodes(), results.breaks(), results.families()
    gone = {frozenset(pair) for pair in zip(breaks.node.tolist(), breaks.neighbour.tolist(), strict=True)}
    assert len(found.is_broken) == len(families.neighbour) / 2
    assert {frozenset(pair) for pair in nodes.ids[found.node_rows[found.is_broken]].tolist()} == gone
    assert not early.is_broken.any()
    intact, broken, *_ = (lines for lines in figure.axes[0].collections if isinstance(lines, LineCollection))
    assert tuple(broken.get_color()[0][:3]) == pytest.approx(to_rgb("#d55e00"))
    assert (len(intact.get_segments()), len(broken.get_segments())) == (len(found.is_broken) - len(gone), len(gone))
    ends = nodes.position[found.node_rows[found.is_broken]] * 1e3
    assert np.array(broken.get_segments()) == pytest.approx(ends)


@pytest.mark.slow
@suffixes
def test_an_image_has_the_same_bytes_each_time(
    small_results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    monkeypatch.setattr(plate_geometry, "MANY", 10)
    written = []
    for name in ("one", "two"):
        with Results.open(small_results) as results:
            style.save(field_figure.field(results, "velocity", 60, scale=2.0), tmp_path / f"{name}{suffix}")
        written.append((tmp_path / f"{name}{suffix}").read_bytes())
    assert written[0] == written[1]


def test_a_large_plate_is_an_image(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same colours at the nodes' places as the squares have."""
    with Results.open(small_results) as results:
        squares = field_figure.field(results, "damage", 60)
        monkeypatch.setattr(plate_geometry, "MANY", 10)
        image = field_figure.field(results, "damage", 60)
        nodes = results.nodes()
    cells = squares.axes[0].collections[0]
    (painted,) = image.axes[0].images
    pixels = np.asarray(painted.get_array())
    x0, x1, y0, y1 = painted.get_extent()
    rows, columns, _ = pixels.shape
    column = ((nodes.position[:, 0] * 1e3 - x0) / (x1 - x0) * columns).astype(int)
    row = ((nodes.position[:, 1] * 1e3 - y0) / (y1 - y0) * rows).astype(int)
    assert np.array_equal(pixels[row, column], cells.to_rgba(np.asarray(cells.get_array()), bytes=True))
    painted_rows, painted_columns = (np.flatnonzero((pixels[:, :, 3] == 255).any(axis=axis)) for axis in (1, 0))
    inside = pixels[painted_rows[0] : painted_rows[-1] + 1, painted_columns[0] : painted_columns[-1] + 1, 3]
    assert (inside[1:-1, 1:-1] == 255).all()
    assert inside.size > 0.9 * rows * columns


def test_many_bonds_are_counted(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bond_figure, "LINES", 10)
    with Results.open(small_results) as results:
        figure = bond_figure.bonds(results, 60)
        share = read_bond_pairs(results, 60).is_broken.mean()
    assert len(figure.axes[0].images) == 1
    pixels = np.asarray(figure.axes[0].images[0].get_array())
    blue = np.array([*(255 * np.array(to_rgb("#56b4e9"))).round(), 255])
    full = pixels[:, :, 3] > 0
    whole = (pixels == blue).all(axis=2)
    assert full.any()
    assert 0 < (full & ~whole).mean() < 3 * share + 0.2
    assert whole.any()


def test_the_nodes_by_level(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        figure = scene_figure.nodes(results, 60)
        nodes = results.nodes()
    dots = figure.axes[0].collections[0]
    assert np.asarray(dots.get_offsets()) == pytest.approx(nodes.position * 1e3)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["1 mm: 252 nodes", "pre-crack"]


def test_the_legend_of_a_crack_covers_no_branch(small_results: Path) -> None:
    """It stands below the plate, on which branches may run anywhere."""
    from damaged_results import lattice, run

    branches = crack_branches(run(lattice(), [(x, x, y) for x in range(5, 16) for y in (-1, 0, 1)]))
    wide = [replace(one, is_narrow=np.zeros_like(one.is_narrow)) for one in branches]
    with Results.open(small_results) as results:
        figure = crack_figure.crack(results, replace(crack_summary.crack(results), branches=wide))
    assert figure.axes[0].get_legend() is None
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["pre-crack", "path of the crack", "wider than a crack"]
    figure.canvas.draw()
    assert not legend.get_window_extent().overlaps(figure.axes[0].get_window_extent())


@pytest.mark.parametrize(("largest", "end"), [(0.0, 1.0), (0.03, 0.05), (0.3, 0.5), (0.5, 0.5), (0.51, 1.0)])
def test_the_colours_of_damage_end_at_what_is_there(largest: float, end: float) -> None:
    """At a round number; at 1 where nothing is damaged."""
    assert colours.colours("damage", "", np.array([0.0, largest])).high == end
