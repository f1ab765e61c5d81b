"""The page on bodies says what they do not have yet, in the words of the programs."""

from __future__ import annotations

import pytest

from benchmarks.pages import sections
from benchmarks.plane_only import PAGE, refused, section


@pytest.mark.slow
def test_what_bodies_do_not_have_is_on_their_page() -> None:
    found = refused()
    assert len(found) > 10
    assert section(found) in [f"{part.rstrip()}\n" for part in sections(PAGE.read_text(encoding="utf-8"))]
