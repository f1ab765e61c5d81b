"""The pages for those who change the code name files that exist."""

from __future__ import annotations

import re

import pytest
from plates import ROOT

NEW = {"pdsolve/laws/pair_laws/saturating.py"}  # which a reader of the page makes
FOLDERS = ("pdmesh", "pdsolve", "pdpost", "tests", "benchmarks", "docs", "geometries", ".ci")


def named(page: str) -> set[str]:
    """The files and folders of the checkout that a page of docs names in backticks."""
    text = re.sub(r"```.*?```", "", (ROOT / "docs" / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    words = re.findall(r"`([\w./-]+)`", text)
    return {word for word in words if word.endswith((".py", ".md", ".toml")) or word.split("/")[0] in FOLDERS}


@pytest.mark.parametrize("page", ["developers/contributing.md", "developers/architecture.md", "how_to/add_material.md"])
def test_every_file_that_a_page_names_is_there(page: str) -> None:
    found = named(page)
    assert found
    for name in found - NEW:
        anywhere = (path for folder in FOLDERS for path in (ROOT / folder).rglob(name))
        assert (ROOT / name).exists() or next(anywhere, None) is not None, f"{page}: {name}"
