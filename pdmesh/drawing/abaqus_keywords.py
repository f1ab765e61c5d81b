"""The grammar of Abaqus input files: keywords with parameters, each followed by lines of data."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pdmesh.drawing.text_fields import finite_number, text_lines, whole_number
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
            raise self.error(f"*{self.name}: {name}= is missing; add it")
        return self.options[name]

    def numbers(self, line: int, text: str) -> list[float]:
        """The finite numbers on a line of data, 0 for those left out. Raises SceneError."""
        values = [finite_number(word.strip() or "0") for word in text.rstrip().rstrip(",").split(",")]
        numbers = [value for value in values if value is not None]
        if len(numbers) < len(values):
            raise self.error(f"*{self.name}: '{text.strip():.60}' is not a list of numbers; use finite numbers", line)
        return numbers

    def integer(self, line: int, word: str) -> int:
        """The whole number that a word on a line of data is. Raises SceneError."""
        number = whole_number(word.strip())
        if number is None:
            wanted = "a whole number of at most 18 digits"
            raise self.error(f"*{self.name}: '{word.strip():.60}' is not an integer; use {wanted}", line)
        return number

    def integers(self, line: int, text: str) -> list[int]:
        """The whole numbers on a line of data, between commas or blanks. Raises SceneError."""
        fields = [field.split() or [""] for field in text.rstrip().rstrip(",").split(",")]
        return [self.integer(line, word) for words in fields for word in words]


def keywords(path: Path, trust: bool, within: tuple[Path, ...] = ()) -> Iterator[Keyword]:
    """The keywords of the file at `path`, with those of files it includes if `trust`. Raises SceneError and OSError."""
    current: Keyword | None = None
    for number, text in _lines(path):
        if not text.startswith("*"):
            if current is None:
                raise SceneError(
                    f"{path}: line {number}: '{text.strip():.40}' comes before any keyword; begin with a keyword"
                    " (*NODE ...)"
                )
            current.rows.append((number, text))
            continue
        if current is not None:
            yield current
        name, *pieces = PIECE.findall(text[1:]) or [""]
        options = {}
        for piece in pieces:
            key, _, value = piece.partition("=")
            options[key.strip().upper().replace(" ", "")] = value.strip().strip('"').strip()
        current = Keyword(path, number, "".join(name.replace("*", "").split()).upper(), options)
        if current.name == "INCLUDE":
            if not trust:
                raise current.error(f"'*INCLUDE' is not read; put the mesh in one file{ADVICE}")
            if len(within) >= DEEPEST:
                raise current.error(f"{DEEPEST} files include each other; include fewer")
            yield from keywords(path.parent / current.word("INPUT"), trust, (*within, path))
            current = Keyword(path, number, "INCLUDE", {})
    if current is not None:
        yield current


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines without comments and blanks; lines of a keyword that goes on are one."""
    pieces, first = list[str](), 0
    for number, line in enumerate(text_lines(path), start=1):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        first = first if pieces else number
        pieces.append(text)
        if not (pieces[0].startswith("*") and text.endswith(",")):
            yield first, "".join(pieces)
            pieces = []
    if pieces:
        yield first, "".join(pieces)
