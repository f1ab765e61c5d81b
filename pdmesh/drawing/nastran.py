"""Checks Nastran bulk data before Gmsh reads them, which takes fields that it does not know for others."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from pdmesh.drawing.text_fields import finite_number, whole_number
from pdmesh.files import read_bytes
from pdmesh.scene.shapes import SceneError

READ = ("CBAR", "CTRIA3", "CTRIA6", "CQUAD4", "CQUAD8", "CTETRA", "CHEXA", "CPENTA", "CPYRAM")
NODES = dict(zip(READ, (2, 3, 6, 4, 8, 10, 20, 15, 13), strict=True))  # the most that each has
ALIKE = {"CTRIAR": "CTRIA3", "CQUADR": "CQUAD4"}  # of other degrees of freedom
CELL = re.compile(r"C(?:TRI|QUAD|TETRA|HEX|PENT|PYR|SHEAR|PLST)")
CARD = re.compile(r"\s*([A-Z][A-Z0-9]*)(\*?)", re.IGNORECASE | re.ASCII)
SHORT = re.compile(r"(?<=[0-9.])(?=[+-][0-9])")  # where an exponent lacks its letter: 1.5-3
PLUS = re.compile(r"^( *)\+(?=[.0-9])")
LARGEST = 2**31 - 1  # id that Gmsh reads
PROPERTY = "1"  # of elements that name none


class _Card(NamedTuple):
    """A card: its name in capitals, the line that it begins on, and its fields, of the lines that go on as well."""

    name: str
    place: str
    fields: list[str]

    def check(self) -> None:
        """Raise SceneError for an id or a coordinate that is no number, of which Gmsh would read the beginning."""
        ids = self.fields[:1]
        if self.name != "GRID":  # an element has the numbers of its property and nodes too
            count = NODES.get(self.name, -2)
            ids = [*ids, *filter(None, self.fields[1 : 2 + count])] if count > 0 else []
        for word in ids:
            number = whole_number(word)
            if number is None or not 0 < number <= LARGEST:
                wanted = f"use a whole number from 1 to {LARGEST}"
                raise SceneError(f"{self.place}: {self.name}: '{word:.60}' is not an id; {wanted}")
        for word in filter(None, self.fields[2:5] if self.name == "GRID" else ()):
            if finite_number(SHORT.sub("E", word)) is None:
                raise SceneError(f"{self.place}: GRID: '{word:.60}' is not a coordinate; use a finite number")


def checked_bulk(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """The bulk data for Gmsh, with a property for each element, and a remark on elements that have no cells.

    Raises SceneError for what Gmsh would read wrongly or leave out in silence, and OSError.
    """
    lines, others, last = [], dict[str, None](), _Card("", "", [])
    for number, data in enumerate(read_bytes(path).splitlines(), start=1):
        line = data.decode("latin-1")  # in which columns are bytes, as Gmsh counts them
        match, place = CARD.match(line), f"{path}: line {number}"
        card, star = (match[1].upper(), match[2]) if match else ("", "*" * line.startswith("*"))
        if card in ALIKE:
            card, line = ALIKE[card], line.replace(match[1] if match else "", ALIKE[card], 1)
        _refuse_others(place, card, _field(line, star, 2))
        if card in READ and not _field(line, star, 2).strip():
            if "," in line:
                words = line.split(",")
                line = ",".join([*words[:2], PROPERTY, *words[3:]])
            else:
                wide, first = (16, 24) if star else (8, 16)
                line = line[:first].ljust(first) + PROPERTY.ljust(wide) + line[first + wide :]
        elif re.match(r"(?:C(?:ELAS|BUSH|DAMP|ROD|BEAM|GAP|ONROD|ONM|TUBE|BEND|VISC)|R(?:BE|BAR|ROD))", card):
            others[card] = None
        if match:
            last.check()
            last = _Card(card, place, [])
        if last.name == "GRID":
            # coordinates without plus signs: Gmsh reads +4. as 0
            pieces, before = line.split(",") if "," in line else _pieces(line, star), len(last.fields)
            for at in range(max(3 - before, 1), min(6 - before, len(pieces), 5 if star else 9)):
                pieces[at] = PLUS.sub(r"\1 ", pieces[at])
            line = ("," if "," in line else "").join(pieces)
        if line.strip() and not line.lstrip().startswith("$"):
            pieces = _pieces(line.partition("$")[0], star)
            last.fields.extend(piece.strip() for piece in pieces[1 : 5 if star else 9])
        lines.append(line)
    last.check()
    notes = (f"not used: elements {', '.join(others)}, which have no cells",) if others else ()
    return ("\n".join(lines) + "\n").encode("latin-1"), notes


def _refuse_others(place: str, card: str, second: str) -> None:
    """Raise SceneError for a card that Gmsh reads wrongly or leaves out; a GRID has its system in the second field."""
    if card == "INCLUDE":
        raise SceneError(f"{place}: INCLUDE is not read; put the mesh in one file")
    if card in ("GRID", "GRDSET") and second.strip() not in ("", "0"):
        raise SceneError(f"{place}: {card}: coordinate system {second.strip()} is not read; use the basic one, 0")
    if CELL.match(card) and card not in READ:
        raise SceneError(f"{place}: {card} is not read; use one of {', '.join(READ[1:])}")


def _field(line: str, star: str, number: int) -> str:
    """A field of a line: between commas, or in columns of 8, or of 16 behind the first where a star is."""
    return _pieces(line.partition("$")[0], star)[number]


def _pieces(line: str, star: str) -> list[str]:
    """A line cut into its name or mark, four or eight fields with data, and the rest."""
    count = 4 if star else 8
    if "," in line:
        pieces = line.split(",")
        return [*pieces, *[""] * (count + 2 - len(pieces))]
    ends = [0, *range(8, 73, 64 // count)]
    return [*(line[start:end] for start, end in pairwise(ends)), line[72:]]
