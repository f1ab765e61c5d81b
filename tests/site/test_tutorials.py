"""Tutorials: each has its page, its picture and what draws it; curves are those of their sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks import tutorials
from benchmarks.tutorials import DATA, PAGES, TUTORIALS, table


def test_each_has_its_page_and_picture() -> None:
    listed = (PAGES / "index.md").read_text(encoding="utf-8")
    assert {path.stem for path in PAGES.glob("*.md")} == {*TUTORIALS, "index"}
    assert {path.stem for path in PAGES.glob("*.png")} == set(TUTORIALS)
    assert all(f"\n{name}\n" in listed for name in TUTORIALS)


@pytest.mark.parametrize("name", TUTORIALS)
def test_a_page_has_its_parts(name: str) -> None:
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    parts = ["The drawing", "The commands", "What is off, and why", "What to try next"]
    assert [line.removeprefix("## ") for line in text.splitlines() if line.startswith("## ")] == parts
    assert f"]({name}.png)" in text
    assert "?" in text.partition("## ")[0]


@pytest.mark.parametrize("name", TUTORIALS)
def test_commands_write_what_is_drawn(name: str) -> None:
    """Each page types a table, which its picture reads."""
    lines = tutorials.typed(PAGES / f"{name}.md")
    assert lines[0].startswith("pdmesh build")
    assert lines[1].startswith("pdsolve")
    assert any("--csv" in line or "--json" in line for line in lines)


def drawn(name: str, folder: Path) -> str:
    return TUTORIALS[name].draw(Figure().add_subplot(), folder)


def test_each_file_of_data_names_its_source_and_is_drawn() -> None:
    page = (DATA / "index.md").read_text(encoding="utf-8")
    drawn_by = Path(tutorials.__file__).read_text(encoding="utf-8")
    files = list(DATA.glob("*.csv"))
    assert len(files) == page.count(".csv`") == drawn_by.count(" DATA / ") + drawn_by.count("(DATA / ") > 10
    for path in files:
        assert path.read_text(encoding="utf-8").startswith("# ")
        assert f"`{path.name}`" in page
        assert f'"{path.name}"' in drawn_by


def test_data_of_formulas_are_those_of_the_formulas() -> None:
    x, stress = table(DATA / "kirsch_hole.csv").values()
    assert stress == pytest.approx((2 + x**-2 + 3 * x**-4) / 2, abs=1e-6)
    ratio, shape, opening = table(DATA / "compact_tension.csv").values()
    assert (ratio[0], shape[0]) == pytest.approx((0.5, 9.6591), abs=1e-4)  # ASTM E399 has 9.66
    slope = np.diff(opening) / np.diff(ratio)
    assert slope == pytest.approx(2 * ((shape[1:] + shape[:-1]) / 2) ** 2, rel=0.02)  # G = P^2 dC / 2 da; 0.013 found
    depth, T, stress = table(DATA / "quenched_slab.csv").values()
    assert T + stress == pytest.approx(np.trapezoid(T, depth), abs=1e-4)
    assert (T[1] - T[0]) / depth[1] == pytest.approx(10 * T[0], rel=0.01)  # Bi times that of the edge: 0.003 found
    (length,) = table(DATA / "fragments_of_a_ring.csv").values()
    assert length[0] ** 3 == pytest.approx(24, abs=1e-4)


def test_an_exact_wave_is_off_by_nothing(tmp_path: Path) -> None:
    rows = [f"{t},{1e-3 * (2 - abs(t - 2))}" for t in np.arange(0, 4, 0.25).tolist()]
    (tmp_path / "end.csv").write_text("\n".join(['"time, s","displacement, m"', *rows]))
    assert drawn("wave_in_a_bar", tmp_path).startswith("off by 0.0%")


def test_kirsch_has_three_times_the_stress_at_the_hole(tmp_path: Path) -> None:
    rows = ["5e-3,3e6", "1e-2,1.21875e6"]  # at 2 radii: 1 + 1 / 8 + 3 / 32
    (tmp_path / "line.csv").write_text("\n".join(['"x, m","stress_yy, Pa"', *rows]))
    assert drawn("plate_with_a_hole", tmp_path).startswith("1.00 of the largest stress at the hole; off by 0.0%")


def test_grady_has_twenty_fragments(tmp_path: Path) -> None:
    (tmp_path / "ring.json").write_text('{"fragments": {"pieces": [{"mass": 1e-3}, {"mass": 2e-3}]}}')
    assert drawn("fragmenting_ring", tmp_path) == "2 fragments, Grady 20"
