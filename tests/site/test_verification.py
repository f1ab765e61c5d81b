"""The page of verification names tests that exist, and numbers that they hold."""

from __future__ import annotations

import re

import pytest
from pages import DOCS
from plates import ROOT

PAGE = (DOCS / "verification" / "index.md").read_text(encoding="utf-8")
ROWS = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| case")]
FOLDERS = ("unit", "geometries", "stability", "contracts", "laws", "cli")


def test_every_row_names_a_test_that_exists() -> None:
    assert len(ROWS) >= 50
    for row in ROWS:
        (file, name) = re.fullmatch(r"\|.*\| `(\S+\.py)::(test_\w+)` \|", row).groups()  # type: ignore[union-attr]
        folder = ROOT / "tests" if file.split("/")[0] in FOLDERS else ROOT / "tests" / "verification"
        assert f"\ndef {name}(" in (folder / file).read_text(encoding="utf-8"), row


def test_every_row_has_an_expected_number_its_source_a_measured_one_and_a_tolerance() -> None:
    for row in ROWS:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert len(cells) == 5, row
        assert all(cells), row
        assert "see the test" not in row


@pytest.mark.parametrize("topic", re.findall(r"^## (.+)$", PAGE, re.MULTILINE))
def test_every_topic_has_a_table(topic: str) -> None:
    section = PAGE.partition(f"## {topic}\n")[2].partition("\n## ")[0]
    assert "| case | expected, source | measured | tolerance | test |" in section
    assert section.count("`test_") + section.count(".py::test_") >= 3
