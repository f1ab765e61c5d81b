"""The page of settings is that of the structs that declare them."""

from __future__ import annotations

from benchmarks.settings import PAGE, page


def test_the_page_is_as_written() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()
