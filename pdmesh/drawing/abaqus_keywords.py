"""The grammar of Abaqus input files: keywords with parameters, each followed by lines of data."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pdmesh.files import read_bytes
from pdmesh.scene.shapes import SceneError

ADVICE = " (--trust reads it all the same)"
DEEPEST = 10  # files that include each other
PIECE = re.compile(r'(?:"[^"]*"|[^,"])+')


@dataclass
class Keyword:
    """A keyword, in capitals and without blanks, its parameters, and its lines of data with their numbers."""

    path: Path
    line: int
    name: str
    options: dict[str, str]
    rows: list[tuple[int, str]] = field(default_factory=list)

    def error(self, problem: str, line: int = 0) -> SceneError:
        """An error at a line, or at the keyword's own."""
        return SceneError(f"{self.path}: line {line or self.line}: {problem}")

    def word(self, name: str) -> str:
        """A parameter that must be there. Raises SceneError."""
        if not self.options.get(name):
            raise self.error(f"*{self.name}: found no {name}=, expected one")
        return self.options[name]

    def numbers(self, line: int, text: str) -> list[float]:
        """The numbers on a line of data, 0 for those left out. Raises SceneError."""
        try:
            words = text.rstrip().rstrip(",").split(",")
            return [float(word.strip().upper().replace("D", "E") or 0) for word in words]
        except ValueError:
            raise self.error(f"*{self.name}: found '{text.strip():.60}', expected numbers", line) from None

    def integers(self, line: int, text: str) -> list[int]:
        """The whole numbers on a line of data. Raises SceneError."""
        try:
            return [int(word) for word in text.replace(",", " ").split()]
        except ValueError:
            raise self.error(f"*{self.name}: found '{text.strip():.60}', expected whole numbers", line) from None


def keywords(path: Path, trust: bool, within: tuple[Path, ...] = ()) -> Iterator[Keyword]:
    """The keywords of the file at `path`, with those of files it includes if `trust`. Raises SceneError and OSError."""
    current: Keyword | None = None
    for number, text in _lines(path):
        if not text.startswith("*"):
            if current is None:
                raise SceneError(f"{path}: line {number}: found '{text.strip():.40}', expected a keyword (*NODE ...)")
            current.rows.append((number, text))
            continue
        if current is not None:
            yield current
        current = _keyword(path, number, text)
        if current.name == "INCLUDE":
            if not trust:
                raise current.error(f"found '*INCLUDE', expected a mesh in one file{ADVICE}")
            if len(within) >= DEEPEST:
                raise current.error(f"found {DEEPEST} files that include each other, expected fewer")
            yield from keywords(path.parent / current.word("INPUT"), trust, (*within, path))
            current = Keyword(path, number, "INCLUDE", {})
    if current is not None:
        yield current


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines without comments and blanks; lines of a keyword that goes on are one."""
    begun, first = "", 0
    for number, line in enumerate(read_bytes(path).decode("latin-1").splitlines(), start=1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if begun:
            text, number = begun + text, first
        if text.startswith("*") and text.endswith(","):
            begun, first = text, number
            continue
        begun = ""
        yield number, text
    if begun:
        yield first, begun


def _keyword(path: Path, number: int, text: str) -> Keyword:
    name, *pieces = PIECE.findall(text[1:]) or [""]
    options = {}
    for piece in pieces:
        key, _, value = piece.partition("=")
        options[key.strip().upper().replace(" ", "")] = value.strip().strip('"').strip()
    return Keyword(path, number, "".join(name.replace("*", "").split()).upper(), options)
