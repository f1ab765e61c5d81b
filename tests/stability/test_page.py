"""The page of failures is that of these tests."""

from __future__ import annotations

import pytest
from failures import cases
from plates import ROOT


def test_the_page_names_the_cases_that_are_tested(request: pytest.FixtureRequest) -> None:
    """`make failures` writes it anew."""
    if request.config.getoption("--failures-page", None) is not None:
        pytest.skip("the page is being written")
    text = (ROOT / "docs" / "where_methods_fail.md").read_text(encoding="utf-8")
    headings = [line.removeprefix("### ") for line in text.splitlines() if line.startswith("### ")]
    assert headings == [heading for _, heading in cases()]
    assert "docs/where_methods_fail.md" in (ROOT / "README.md").read_text(encoding="utf-8")
