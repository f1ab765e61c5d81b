"""What the public names do."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from pdpost import Results, crack, figures
from pdpost.__main__ import main
from pdsolve.measures.crack_summary import CrackPathSummary


def test_all_of_it_at_once() -> None:
    names: dict[str, object] = {}
    exec("from pdpost import *", names)
    assert names["Results"] is Results
    assert names["figures"] is importlib.import_module("pdpost.figures")


@pytest.mark.slow
def test_the_last_frame_and_step_are_what_is_meant_without_one(small_results: Path) -> None:
    with Results.open(small_results) as results:
        found, expected = crack(results), crack(results, 60)
        titles = [draw(results).axes[0].get_title() for draw in (figures.field, figures.nodes, figures.bonds)]
        assert figures.crack(results).axes[0].get_title().endswith("3 µs")
    assert isinstance(found, CrackPathSummary)
    assert (found.step, found.events) == (60, expected.events)
    assert all(title.endswith("(step 60)") for title in titles)


@pytest.mark.slow
def test_styled_pictures_are_those_of_the_commands(
    small_results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bytes; without the style others."""
    monkeypatch.chdir(tmp_path)
    for command in ("damage", "crack", "bonds"):
        assert main([command, str(small_results), "-q", "-o", f"{command}.png"]) == 0
    with Results.open(small_results) as results:
        draw = {"damage": figures.field, "crack": figures.crack, "bonds": figures.bonds}
        for command, figure in draw.items():
            with figures.styled():
                figures.save(figure(results), Path("a.png"))
            figures.save(figure(results), Path("b.png"))
            assert Path("a.png").read_bytes() == Path(f"{command}.png").read_bytes()
            assert Path("b.png").read_bytes() != Path(f"{command}.png").read_bytes()
