"""The page of names: each stands once, and is one of the code."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "developers" / "names.md"


def test_each_name_stands_once_and_is_one_of_the_code() -> None:
    cells = [line.split(" | ")[0] for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    names = [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]
    assert len(names) == len(set(names))
    files = (path for room in ("pdmesh", "pdsolve", "pdpost") for path in (ROOT / room).rglob("*.py"))
    words = set(re.findall(r"\w+", "\n".join(path.read_text(encoding="utf-8") for path in files)))
    assert [name for name in names if name not in words] == []


def test_the_page_has_60_to_100_words_and_none_that_was_replaced() -> None:
    rows = re.findall(r"^\| (.+?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    words = [row for row in rows if row not in ("name", "---")]
    assert 60 <= len(words) <= 100
    assert not {"`hold`", "`held`", "`ledger`", "`books`", "`team`", "`march`"} & set(words)
