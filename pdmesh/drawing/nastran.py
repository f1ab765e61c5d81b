"""Checks Nastran bulk data before Gmsh reads them, which takes fields that it does not know for others."""

from __future__ import annotations

import re
from pathlib import Path

from pdmesh.files import read_bytes
from pdmesh.scene.shapes import SceneError

READ = ("CBAR", "CTRIA3", "CTRIA6", "CQUAD4", "CQUAD8", "CTETRA", "CHEXA", "CPENTA", "CPYRAM")
ALIKE = {"CTRIAR": "CTRIA3", "CQUADR": "CQUAD4"}  # of other degrees of freedom
CELL = re.compile(r"C(?:TRI|QUAD|TETRA|HEX|PENT|PYR|SHEAR|PLST)")
CARD = re.compile(r"\s*([A-Z][A-Z0-9]*)(\*?)", re.IGNORECASE)
PROPERTY = "1"  # of elements that name none


def checked_bulk(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """The bulk data for Gmsh, with a property for each element, and a remark on elements that have no cells.

    Raises SceneError for what Gmsh would read wrongly or leave out in silence, and OSError.
    """
    lines, others = [], dict[str, None]()
    for number, line in enumerate(read_bytes(path).decode("latin-1").splitlines(), start=1):
        match, place = CARD.match(line), f"{path}: line {number}"
        card, star = (match[1].upper(), match[2]) if match else ("", "")
        if card == "INCLUDE":
            raise SceneError(f"{place}: found INCLUDE, expected a mesh in one file")
        if card in ALIKE:
            card, line = ALIKE[card], line.replace(match[1] if match else "", ALIKE[card], 1)
        if card in ("GRID", "GRDSET") and _field(line, star, 2).strip() not in ("", "0"):
            system = _field(line, star, 2).strip()
            raise SceneError(f"{place}: {card}: found coordinate system {system}, expected the basic one, 0")
        if card in READ and not _field(line, star, 2).strip():
            line = _with_property(line, star)
        elif CELL.match(card) and card not in READ:
            raise SceneError(f"{place}: found {card}, which is not read, expected one of {', '.join(READ[1:])}")
        elif re.match(r"(?:C(?:ELAS|BUSH|DAMP|ROD|BEAM|GAP|ONROD|ONM|TUBE|BEND|VISC)|R(?:BE|BAR|ROD))", card):
            others[card] = None
        lines.append(line)
    notes = (f"not used: elements {', '.join(others)}, which have no cells",) if others else ()
    return ("\n".join(lines) + "\n").encode("latin-1"), notes


def _field(line: str, star: str, number: int) -> str:
    """A field of a line: between commas, or in columns of 8, or of 16 behind the first where a star is."""
    if "," in line:
        return ([*line.split(","), "", "", ""])[number]
    if star:
        return line.ljust(72)[8 + 16 * (number - 1) : 8 + 16 * number]
    return line.ljust(80)[8 * number : 8 * (number + 1)]


def _with_property(line: str, star: str) -> str:
    if "," in line:
        words = line.split(",")
        return ",".join([*words[:2], PROPERTY, *words[3:]])
    wide, first = (16, 24) if star else (8, 16)
    return line[:first].ljust(first) + PROPERTY.ljust(wide) + line[first + wide :]
