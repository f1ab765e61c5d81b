"""The page of what runs endure: all counts, what did not fit, and a sum."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks import corrupted, endurance
from benchmarks.endured import Part
from benchmarks.pages import write_block

EMPTY = "# Page\n\n<!-- parts: written by python -m benchmarks.endurance -->\n\n<!-- end -->\n"


def test_the_page_says_what_fell_and_what_did_not_fit() -> None:
    parts = {"kills": (Part(40, 500, 1, 2, 3, "no time for bodies"), 90.0), "frames": (Part(0, 2000), 30.0)}
    lines = endurance.block(parts, 2.0).splitlines()
    assert "| kills | 40 of 500 | 1 | 2 | 3 | 1.5 | no time for bodies |" in lines
    assert "| frames | 0 of 2000 | 0 | 0 | 0 | 0.5 |  |" in lines
    assert lines[-1] == "| all | 40 | 1 | 2 | 3 | 2.0 |  |"


def test_parts_that_are_tried_again_are_in_the_page_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = {"one": (Part(40, 500, 1, 2, 3, "no time"), 90.0), "two": (Part(1, 2000), 30.0)}
    monkeypatch.setattr(endurance, "PAGE", tmp_path / "endurance.md")
    monkeypatch.setattr(endurance, "PARTS", {name: (1.0, lambda *_: Part(7, 7)) for name in parts})
    endurance.PAGE.write_text(EMPTY)
    write_block(endurance.PAGE, "parts", endurance.block(parts, 2.0))
    assert endurance.known(endurance.PAGE.read_text()) == parts
    assert endurance.main(["--minutes", "0.01", "--part", "one", "--again"]) == 0
    after = endurance.known(endurance.PAGE.read_text())
    assert (after["one"][0], after["two"]) == (Part(7, 7), parts["two"])


@pytest.mark.parametrize("part", [Part(1, 1), Part(1, 1, lost=1), Part(1, 1, traces=1), Part(1, 1, wrong=1)])
def test_what_falls_is_in_the_exit_code_and_in_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: Part
) -> None:
    def broken(*_: object) -> Part:
        raise RuntimeError("a test")

    monkeypatch.setattr(endurance, "PAGE", tmp_path / "endurance.md")
    monkeypatch.setattr(endurance, "PARTS", {"one": (1.0, lambda *_: part), "two": (1.0, broken)})
    for name, row in (("one", "| one | 1 of 1 |"), ("two", "| two | 0 of 1 | 0 | 1 | 0 |")):
        endurance.PAGE.write_text(EMPTY)
        monkeypatch.setattr(endurance, "side_by_side", lambda _, name=name: endurance.tried([name], 0.01))
        assert endurance.main(["--minutes", "0.01"]) == int(name == "two" or part != Part(1, 1))
        assert row in endurance.PAGE.read_text()


@pytest.mark.slow
def test_parts_are_tried_in_processes_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What such a process says is read; one that dies is a part that fell."""
    monkeypatch.setattr(endurance, "LANES", (["nodes in another order"], ["none such"]))
    found = {name: part for name, part, _ in endurance.side_by_side(0.01)}
    assert found["nodes in another order"] == Part(0, 7, note="no time")
    assert found["none such"].traces == 1


def test_all_parts_have_a_name_of_their_own() -> None:
    assert sum(map(len, endurance.LANES)) == len(endurance.PARTS)


@pytest.mark.slow
def test_a_database_that_goes_on_to_another_end_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is as it was is not, nor one that is refused."""
    monkeypatch.setattr(corrupted, "STOPPED", ("bonds",))
    monkeypatch.setattr(corrupted, "BATCH", 1)
    whole, cut = (SimpleNamespace(damaged=lambda data, _, size=size: data[:size]) for size in (None, 5000))
    halves = corrupted._halves(tmp_path)
    assert corrupted._stopped(tmp_path, whole, halves, 1) == ([], [])
    assert corrupted._stopped(tmp_path, cut, halves, 1) == ([], [])
    assert corrupted._stopped(tmp_path, whole, [(path, {}) for path, _ in halves], 1) == ([], ["bonds, 1 0"])
