"""`pdpost line`: picture, JSON, table, and one line for what is wrong."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest
from messages import mentions, naming

from pdpost.__main__ import main

WAY = ["--from", "0.001,-0.0055", "--to", "0.001,0.0055"]  # through the crack of the small plate


@pytest.mark.slow
def test_a_picture_numbers_and_a_table(small_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["line", str(small_results), *WAY, "--component", "y", "--component", "magnitude"]) == 0
    said = capsys.readouterr().out
    assert (here / "small.line.png").stat().st_size > 10_000
    assert mentions(said, "displacement y", "3 us", "23 of 23")
    assert main(["line", str(small_results), *WAY, "--component", "y", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["step"], found["components"], found["unit"]) == (60, ["y"], "m")
    assert found["values"]["displacement_y"][0] < 0 < found["values"]["displacement_y"][-1]
    assert main(["line", str(small_results), *WAY, "--field", "stress", "--frame", "1", "--csv", "-"]) == 0
    header, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert header[:5] == ["along, m", "x, m", "y, m", "stress_largest, Pa", "stress_smallest, Pa"]
    assert len(rows) == len(found["along"]) == 23
    assert len(list(here.iterdir())) == 2  # the results and the one picture


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--from", "1,0", "--to", "2,0"], naming(found=("1,0", "2,0"), expected="-0.0005")),
        (["--from", "0,0", "--to", "20,5"], naming(found=("20,5", "20.6155"), expected=("-0.0005", "20mm"))),
        (["--from", "0,0", "--to", "0,0"], naming("--to", found="0,0", expected="place")),
        ([*WAY, "--component", "xx"], naming("displacement", found="component 'xx'", expected=("magnitude", "x"))),
        ([*WAY, "--frame", "9"], naming(found="frame 9", expected=("0", "3"))),
    ],
)
def test_what_is_wrong_is_one_line(
    small_results: Path, here: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    assert main(["line", str(small_results), *words]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert re.search(message, err)
    assert list(here.glob("*.png")) == []


def test_a_frame_without_the_field(few_results: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["line", str(few_results), *WAY, "--field", "energy"]) == 2
    assert mentions(capsys.readouterr().err, found="field 'energy'", expected=("ux", "uy"))


@pytest.mark.parametrize("words", [["--from", "0", "--to", "1,0"], ["--to", "1,0"], ["--from", "0,nan", "--to", "1,0"]])
def test_places_that_are_none(small_results: Path, words: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["line", str(small_results), *words])
    assert stop.value.code == 2
