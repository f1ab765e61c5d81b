"""The page on bodies says what they do not have yet, in the words of the programs."""

from __future__ import annotations

import pytest

from benchmarks.combinations import SPACE, bodies, refused_of_bodies
from benchmarks.pages import sections


@pytest.mark.slow
def test_what_bodies_do_not_have_is_on_their_page() -> None:
    found = refused_of_bodies()
    assert len(found) > 10
    assert bodies(found) in [f"{part.rstrip()}\n" for part in sections(SPACE.read_text(encoding="utf-8"))]
