"""Pictures: the same bytes each time, the right colours at the right places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pdpost import figures
from pdpost.figures import FigureError
from pdsolve.results import Results, ResultsError


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_picture_has_the_same_bytes_each_time(small_results: Path, tmp_path: Path, suffix: str) -> None:
    written = []
    for name in ("one", "two"):
        with Results.open(small_results) as results:
            figures.save(figures.draw(results, "damage", 60), tmp_path / f"{name}{suffix}")
        written.append((tmp_path / f"{name}{suffix}").read_bytes())
    assert written[0] == written[1]
    assert len(written[0]) > 1000


def test_the_damage_picture(small_results: Path) -> None:
    """A square of each node's size and value, equal axes, colours from 0 to 1, the time in the title."""
    with Results.open(small_results) as results:
        figure = figures.draw(results, "damage", 40)
        nodes, values = results.nodes(), results.field("damage", 40)
    axes = figure.axes[0]
    (cells,) = axes.collections
    assert axes.get_aspect() == 1.0
    assert cells.get_clim() == (0, 1)
    assert np.array_equal(np.asarray(cells.get_array(), dtype=np.float32), values)
    corners = np.array([path.vertices[:4] for path in cells.get_paths()])
    assert corners.mean(axis=1) == pytest.approx(nodes.position * 1e3, abs=1e-12)
    assert np.ptp(corners, axis=1) == pytest.approx(1.0, rel=1e-9)
    assert axes.get_title() == "Damage at 2 µs (step 40)"


@pytest.mark.parametrize(("name", "letter"), [("displacement", "u"), ("velocity", "v")])
def test_sizes_of_vectors_in_handy_units(small_results: Path, name: str, letter: str) -> None:
    with Results.open(small_results) as results:
        figure = figures.draw(results, name, 60)
        size = np.hypot(results.field(f"{letter}x", 60).astype(float), results.field(f"{letter}y", 60))
    scale, prefix = figures.prefixed(float(size.max()))
    (cells,) = figure.axes[0].collections
    assert np.asarray(cells.get_array()) == pytest.approx(size * scale, rel=1e-12)
    assert 1 <= size.max() * scale < 1000
    assert figure.axes[0].child_axes[0].get_ylabel() == f"{name}, {prefix}{figures.PICTURES[name].unit}"


@pytest.mark.parametrize(
    ("largest", "handy"), [(0.0, (1, "")), (3e-5, (1e6, "µ")), (1.0, (1, "")), (2e7, (1e-6, "M")), (1e-30, (1e9, "n"))]
)
def test_prefixes(largest: float, handy: tuple[float, str]) -> None:
    factor, prefix = figures.prefixed(largest)
    assert (factor, prefix) == (pytest.approx(handy[0], rel=1e-12), handy[1])


def test_fields_that_were_not_stored_are_named(small_results: Path) -> None:
    with Results.open(small_results) as results, pytest.raises(ResultsError, match="found no field 'energy'"):
        figures.draw(results, "energy", 60)


def test_formats_and_settings_that_are_none(small_results: Path, tmp_path: Path) -> None:
    with Results.open(small_results) as results:
        figure = figures.draw(results, "damage", 0)
    with pytest.raises(FigureError, match=r"x\.foo: found suffix '\.foo', expected one of .*\.png"):
        figures.save(figure, tmp_path / "x.foo")
    with pytest.raises(FigureError, match="--set fontsize: found no such matplotlib setting"):
        figures.styled({"fontsize": "3"})
    with pytest.raises(FigureError, match=r"--set font\.size=big: "):
        figures.styled({"font.size": "big"})
    assert list(tmp_path.glob("x*")) == []
