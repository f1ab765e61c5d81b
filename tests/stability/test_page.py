"""The page of failures is that of these tests."""

from __future__ import annotations

import pytest
from failure_cases import cases, described, reason_of, theme_of
from plates import ROOT

PAGE = (ROOT / "docs" / "verification" / "limitations.md").read_text(encoding="utf-8")


def test_the_page_names_the_cases_that_are_tested(request: pytest.FixtureRequest) -> None:
    """`make failures` writes it anew."""
    if request.config.getoption("--failures-page", None) is not None:
        pytest.skip("the page is being written")
    headings = [line.removeprefix("### ") for line in PAGE.splitlines() if line.startswith("### ")]
    assert headings == [heading for _, heading in cases()]
    assert "docs/verification/limitations.md" in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("docstring", [docstring for _, docstring in described()], ids=theme_of)
def test_the_page_gives_the_reason_of_a_case(docstring: str, request: pytest.FixtureRequest) -> None:
    """As its test does, below the heading."""
    if request.config.getoption("--failures-page", None) is not None:
        pytest.skip("the page is being written")
    assert f"### {theme_of(docstring)}\n\n{reason_of(docstring)}\n" in PAGE
