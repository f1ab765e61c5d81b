"""A drawing as it is written anew for Gmsh."""

from __future__ import annotations

import pytest

from pdmesh.drawing.sandbox.scan import partners
from pdmesh.drawing.sandbox.tokens import tokens_of, written


@pytest.mark.parametrize(
    ("text", "word"),
    [(b"If(0)x=1;EndIf\n", b"If"), (b"For(1:0)x=1;EndFor\n", b"For"), (b"For i In{1:0}x=1;EndFor\n", b"For")],
)
def test_what_gmsh_skips_begins_with_blanks(text: bytes, word: bytes) -> None:
    """It loses up to four characters behind the word, of which none may be a quote or the beginning of a comment."""
    anew, _ = written(tokens_of(text.decode()))
    after = anew.partition(word)[2]
    assert len(after) - len(after.lstrip(b" ")) >= 4 + 1
    assert anew.replace(b" ", b"") == text.replace(b" ", b"")


def test_brackets_in_strings_match_none() -> None:
    """A string's text begins with its quote, so that none is a bracket."""
    tokens = tokens_of("a = \"(\"; b = '[';\nc(1);")
    assert [token.text for token in tokens if token.kind == "string"] == ['"("', "'['"]
    found, depths = partners(tokens)
    assert found == {9: 11, 11: 9}
    assert depths == [0] * 10 + [1, 0, 0]
