"""Figures for papers: exactly as wide as a column, several frames with the same colours."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from messages import mentions
from PIL import Image

from pdpost import figures
from pdpost.__main__ import main
from pdpost.figures.colours import spelled
from pdpost.figures.style import JOURNALS, FigureError, written
from pdsolve.results import Results


@pytest.mark.slow
@pytest.mark.parametrize("journal", ["elsevier", "aps-wide"])
def test_a_figure_is_exactly_as_wide_as_the_column(small_results: Path, journal: str) -> None:
    width = JOURNALS[journal][0]
    with Results.open(small_results) as results, figures.styled({"journal": journal}):
        for figure in (
            figures.field(results, "stress", scale=20),
            figures.crack(results),
            figures.frames(results, "damage", [20, 60]),
        ):
            picture = Image.open(io.BytesIO(written(figure, "png", dpi=200)))
            assert picture.width / 200 * 25.4 == pytest.approx(width, abs=0.2)  # mm; a pixel is 0.13
            edge = np.asarray(picture.convert("L"))[:, [0, -1]]
            assert (edge > 250).all()  # nothing is cut off
            sizes = {text.get_fontsize() for text in figure.findobj(match=lambda one: hasattr(one, "get_fontsize"))}
            assert max(sizes) == 8.0
    assert _box(small_results, journal)[2] == pytest.approx(width / 25.4 * 72, abs=1e-3)


def _box(results: Path, journal: str) -> list[float]:
    """The size of the page of a PDF, in points."""
    path = results.with_suffix(f".{journal}.pdf")
    assert main(["damage", str(results), "--journal", journal, "-o", str(path), "-q"]) == 0
    found = re.search(rb"/MediaBox \[([^\]]*)\]", path.read_bytes())
    assert found is not None
    return [float(number) for number in found[1].split()]


def test_a_journal_that_is_not_known_is_refused(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["balance", str(small_results), "--journal", "nature", "-o", "x.png"]) == 2
    assert mentions(capsys.readouterr().err, "--journal", found="'nature'", expected="elsevier-middle")
    with pytest.raises(FigureError), figures.styled({"journal": "none"}):
        pass


@pytest.mark.slow
def test_a_user_has_the_last_word_over_a_journal(small_results: Path) -> None:
    with figures.styled({"journal": "ieee", "font.size": 11}), Results.open(small_results) as results:
        axes = figures.field(results).axes[0]
        assert (axes.title.get_fontsize(), axes.xaxis.label.get_fontsize()) == (8.0, 11.0)


def test_frames_share_their_colours(small_results: Path) -> None:
    with Results.open(small_results) as results:
        figure = figures.frames(results, "velocity", [20, 40, 60])
    panels = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in panels] == ["1 µs", "2 µs", "3 µs"]
    norms = {id(one.norm) for axes in panels for one in axes.findobj(PathCollection) if one.get_array() is not None}
    assert len(norms) == 1
    fastest = max(one.get_array().max() for axes in panels for one in axes.findobj(PathCollection))
    assert panels[0].findobj(PathCollection)[0].norm.vmax == pytest.approx(fastest)


@pytest.mark.slow
def test_frames_are_chosen_and_refused(
    small_results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["damage", str(small_results), "--frames"]
    assert main([*words, "1,-1", "--json", "-o", "small.damage.frames.png"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == [20, 60]
    assert Path("small.damage.frames.png").is_file()
    assert main([*words, "1,9", "-o", "x.png"]) == 2
    assert mentions(capsys.readouterr().err, found="frame 9", expected=("0", "3", "-4", "-1"))
    assert main([*words, "1", "--csv", "-", "-o", "x.png"]) == 2
    for wrong in (["1,a"], ["1", "--frame", "2"]):
        with pytest.raises(SystemExit):
            main([*words, *wrong])


@pytest.mark.slow
def test_units_are_spelled_in_one_way_on_a_page(small_results: Path) -> None:
    assert (
        spelled("3 us, 2.5e-3 mm^2, 4 um, 1 MPa m^0.5, us 5 users") == "3 µs, 2.5e-3 mm², 4 µm, 1 MPa m^½, us 5 users"
    )
    with Results.open(small_results) as results, figures.styled():
        page = figures.report(results, "small")
    text = re.sub(r"<img[^>]*>|<style>.*?</style>", "", page, flags=re.DOTALL)
    assert "µs" in text
    assert not re.search(r"\bus\b|\^[23]", text)
    heads = re.findall(r"<h2>(.*?)</h2>", page)
    assert heads == ["Crack", "Animation", "Fields at 3 µs", "Balance", "Scene", "Grid", "Settings", "Provenance"]
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in page
    assert "prefers-color-scheme: dark" in page
