"""Messages are told apart by what they name."""

from __future__ import annotations

import re

import pytest
from messages import mentions

SAID = "plate.json: $.run.steps[1]: found 61 and (0.5, 0) m, expected 0 to 60.5 (--force ends it)"


def test_what_a_message_names_is_found_in_any_order() -> None:
    assert mentions(SAID, "$.run.steps[1]", "plate.json", found=(61, "(0.5, 0) m"), expected=("0", "60.5", "--force"))
    assert mentions(SAID, found=re.compile(r"6\d"))


@pytest.mark.parametrize("part", ["late.json", "plate.js", "$.run", "6", "run.step", "other.json"])
def test_a_part_of_a_word_or_a_number_is_not_named(part: str) -> None:
    assert not mentions(SAID, part)


def test_what_was_expected_was_not_found() -> None:
    assert not mentions(SAID, found="60.5")
    assert not mentions(SAID, expected=61)
    assert not mentions("plate.json: found 61", expected=61)
