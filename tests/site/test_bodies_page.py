"""The page on bodies says what they do not have yet, in the words of the programs."""

from __future__ import annotations

import pytest

from benchmarks.combinations import SPACE, bodies, refused_of_bodies
from benchmarks.pages import read_block


@pytest.mark.slow
def test_what_bodies_do_not_have_is_on_their_page() -> None:
    sentences = refused_of_bodies()
    assert len(sentences) > 10
    assert bodies(sentences) == read_block(SPACE, "bodies")
