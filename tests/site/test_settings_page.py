"""The page of settings is that of the structs that declare them."""

from __future__ import annotations

from benchmarks.pages import read_block
from benchmarks.settings import PAGE
from pdmesh.model.settings_table import markdown, settings


def test_the_page_is_as_written() -> None:
    assert read_block(PAGE, "settings") == "\n".join(markdown(settings()))
