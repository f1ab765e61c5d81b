"""Pages whose prose is typed, and on which commands write tables and pictures between two comments."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def read_block(page: Path, name: str) -> str:
    """The text of a page between `<!-- NAME: written by ... -->` and `<!-- end -->`, without the empty lines around it.

    Raises ValueError where the page does not have these comments exactly once.
    """
    return _parts(page, name)[1].strip("\n")


def write_block(page: Path, name: str, text: str) -> None:
    """Put a text in place of that between `<!-- NAME: written by ... -->` and `<!-- end -->`.

    Raises ValueError where the page does not have these comments exactly once.
    """
    before, _, after = _parts(page, name)
    lines = text.strip("\n")
    page.write_text(f"{before}\n{lines}\n\n{after}", encoding="utf-8")


def _parts(page: Path, name: str) -> tuple[str, str, str]:
    """The text until the end of the first comment, from there to the second comment, and from there on."""
    begin, text = f"<!-- {name}: written by ", page.read_text(encoding="utf-8")
    parts = re.split(rf"({re.escape(begin)}[^\n]* -->\n)(.*?)(?=<!-- end -->)", text, flags=re.DOTALL)
    if len(parts) != 4:
        raise ValueError(f"{page}: found {text.count(begin)} blocks '{begin}... -->' with '<!-- end -->', expected one")
    before, comment, block, after = parts
    return before + comment, block, after


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown, which ends with a line break."""
    lines = [f"| {' | '.join(map(str, row))} |" for row in (header, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(header), *lines[1:], ""])


def pictured(name: str) -> str:
    """A picture on a page, described by the parts of its file's name: what, scene, mode, step."""
    words = Path(name).stem.replace("_", " ").split(".")
    step = f" after step {words.pop()}" if words[-1].isdigit() else ""
    mode = f" in {words.pop()} mode" if words[-1] in ("thesis", "conservative") else ""
    return f"![{' of '.join(words)}{mode}{step}]({name})"
