"""Text from files stays text in a terminal, a table, a page and a figure."""

from __future__ import annotations

import csv
import html
import io

import pytest
from matplotlib.text import Text

from pdmesh.plain_figure import Figure, formats
from pdmesh.plain_text import (
    for_csv,
    for_figure,
    for_file_name,
    for_html,
    for_legend,
    for_line,
    for_quotes,
    shortened,
    visible,
)

HOSTILE = [
    "$x^$",
    "$\\undefined{}$",
    "=HYPERLINK(1)",
    "a\nb\n" * 50,
    "\x1b[31mred\x1b]0;x\x07",
    "\u202egnp",
    "<script>alert(1)</script>",
    "nul\0",
    "x" * 1_000_000,
    " word " * 100_000,
    "a,b;c\"d'",
    "_under",
    "b\udcff",
    "lone \ud800",
    "日本",
]


@pytest.mark.parametrize("name", HOSTILE, ids=lambda name: ascii(name[:12]))
def test_a_line_is_printable_and_bounded(name: str) -> None:
    line = for_line(f"m.json: unknown field {name}, expected E")
    assert line.isprintable()
    assert len(line) < 5000
    assert line.startswith("m.json: unknown field")
    assert line.endswith("expected E")


@pytest.mark.parametrize("name", HOSTILE, ids=lambda name: ascii(name[:12]))
def test_a_cell_is_one_cell_that_no_spreadsheet_computes(name: str) -> None:
    """Also with a semicolon between cells, as in half of Europe."""
    for separator in ",;\t":
        text = f"{for_csv(1.5)}{separator}{for_csv(name)}{separator}{for_csv(None)}\n"
        (row,) = csv.reader(io.StringIO(text), delimiter=separator)
        assert len(row) == 3
        assert row[0] == "1.5"
        assert row[1].strip()[0] not in "=+-@"
        assert row[2] == ""
        assert len(row[1]) < 32_768
    for_csv(name).encode()


@pytest.mark.parametrize("text", ["=1+1", "+cmd|' /C calc'!A0", "-1+1", "@SUM(A1)", "\t=1", " =1", "\uff1d1", "\n=1"])
def test_formulas_are_marked_as_text(text: str) -> None:
    (cell,) = next(csv.reader([for_csv(text)]))
    assert cell.startswith(("'", "\\n", "\\t"))


@pytest.mark.parametrize("value", ["-1e-3", "+4", "top", "a b", "x, m"])
def test_usual_cells_stay_as_they_are(value: str) -> None:
    assert next(csv.reader([for_csv(value)])) == [value]


@pytest.mark.parametrize("name", HOSTILE, ids=lambda name: ascii(name[:12]))
def test_a_page_shows_letters(name: str) -> None:
    page = for_html(name)
    assert not set(page) & set("<>\"'\0\x1b\u202e")
    assert len(page) < 30_000
    assert html.unescape(page) == shortened(visible(name), 4000)
    page.encode()


@pytest.mark.parametrize("name", HOSTILE, ids=lambda name: ascii(name[:12]))
def test_a_file_that_other_files_name(name: str) -> None:
    assert for_file_name(name).isprintable()


@pytest.mark.filterwarnings("ignore:Glyph")
@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_a_figure_draws_any_name(kind: str) -> None:
    """In a title, at an axis, in a legend and beside a point."""
    figure = Figure(figsize=(2, 2), dpi=20)
    axes = figure.add_subplot(title=HOSTILE[0])
    for name in HOSTILE:
        axes.plot([0, 1], [0, 1], label=for_legend(name))
    axes.set_xlabel(HOSTILE[1])
    axes.annotate(HOSTILE[3], (0, 0))
    axes.set_xscale("log")  # whose numbers are formulas
    figure.legend()
    figure.savefig(io.BytesIO(), format=kind)
    (legend,) = figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert len(shown) == len(HOSTILE)
    assert shown[0] == HOSTILE[0]
    assert all(len(text) < 600 and text.count("\n") < 4 for text in shown)
    assert not any(text.get_parse_math() for text in legend.get_texts())


def test_lines_of_a_figure_are_few() -> None:
    assert for_figure("one\ntwo") == "one\ntwo"
    assert for_figure("a\n" * 100).count("\n") == 3


def test_a_figure_keeps_its_own_powers() -> None:
    figure = Figure(figsize=(2, 2), dpi=20)
    axes = figure.add_subplot(xscale="log", xlim=(1e-3, 1e3))
    figure.draw_without_rendering()
    ticks = [text for text in axes.get_xticklabels() if isinstance(text, Text)]
    assert all(text.get_parse_math() for text in ticks)
    assert any("10^" in text.get_text() for text in ticks)


def test_no_format_runs_its_text() -> None:
    assert "pgf" not in formats()
    assert {"png", "pdf", "svg"} <= set(formats())


@pytest.mark.parametrize("name", ["\u4e00" * 60 + "a" * 300, "a" * 300 + "\u4e00" * 60, "plain", 'a "b"\nc'])
def test_a_name_in_quotes_is_one_short_line(name: str) -> None:
    """Gmsh reads lines of up to 255 bytes, and has no sign for a quote."""
    line = for_quotes(name)
    assert len(line.encode()) <= 200
    assert not {'"', "\n"} & set(line)
