"""Blocks of pages that commands write; what is typed around them stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.pages import markdown_table, read_block, write_block

PAGE = """# Page

Typed.

<!-- one: written by python -m benchmarks.one -->

1

<!-- end -->
<!-- two: written by make two -->
<!-- end -->

Typed too.
"""


def test_a_page_keeps_what_is_typed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    write_block(page, "two", "## Two\n\n2\n")
    assert page.read_text(encoding="utf-8") == PAGE.replace("two -->\n", "two -->\n\n## Two\n\n2\n\n")
    assert (read_block(page, "one"), read_block(page, "two")) == ("1", "## Two\n\n2")
    write_block(page, "two", "3")
    assert page.read_text(encoding="utf-8") == PAGE.replace("two -->\n", "two -->\n\n3\n\n")


@pytest.mark.parametrize("text", ["# Page\n", PAGE + PAGE, PAGE.replace("<!-- end -->", "")])
def test_a_block_that_is_not_there_once_is_an_error(tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"page\.md: found [0-2] blocks '<!-- one: written by"):
        write_block(page, "one", "2")
    assert page.read_text(encoding="utf-8") == text


def test_a_table_has_a_line_for_each_row() -> None:
    assert markdown_table(["a", "b"], [["1", 2], ["", "3"]]) == "| a | b |\n|---|---|\n| 1 | 2 |\n|  | 3 |\n"
