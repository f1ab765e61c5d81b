"""What users read: the README, and the pages of the guide and of the site, in blocks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from plates import ROOT

DOCS = ROOT / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")
EVERY = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
ALONE = ("docs/how_to/add_material.md", "docs/reference/api/index.md")  # pages whose python has tests of its own


def text_of(address: str) -> str:
    """The text of the page at an address of the site, such as `guide/contact`."""
    return (DOCS / f"{address}.md").read_text(encoding="utf-8")


class Block(NamedTuple):
    """A block of code on a page."""

    language: str
    text: str


def blocks(page: Path, *languages: str) -> list[Block]:
    """The blocks of a page, of all languages or of those named, in their order."""
    found = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [Block(*each) for each in found if not languages or each[0] in languages]


def lines(text: str) -> list[str]:
    """The commands of a block, one a line; a comment is none."""
    joined = text.replace("\\\n", " ").splitlines()
    return [line for line in joined if line.strip() and not line.startswith("#")]


def named(page: Path) -> str:
    """A page's path in the checkout."""
    return str(page.relative_to(ROOT))


TEXTS = {named(page): page.read_text(encoding="utf-8") for page in EVERY if named(page) not in ALONE}
