"""Types of Abaqus elements: the shape of their cells, and what they say of plane stress or strain."""

from __future__ import annotations

import re
from typing import NamedTuple

FLAT = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
SOLID = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra10",
    15: "wedge15",
    20: "hexahedron20",
    27: "hexahedron27",
}
LINE = {2: "line", 3: "line3"}
OPTIONS = "[EHIMPRSTWV]*"  # hybrid, incompatible modes, modified, reduced integration, heat, pore pressure ...
FAMILIES: tuple[tuple[str, dict[int, str], str], ...] = (  # names with the number of nodes, cells, the kind
    (rf"CPEG?([3468]){OPTIONS}", FLAT, "strain"),
    (rf"CPS([3468]){OPTIONS}", FLAT, "stress"),
    (rf"(?:CG?AX|DCAX|DCCAX|ACAX)([3468]){OPTIONS}D?", FLAT, "axisymmetric"),
    (rf"(?:DC2D|DCC2D|AC2D)([3468]){OPTIONS}D?", FLAT, ""),
    (rf"(?:M3D|SFM3D)([34689]){OPTIONS}", FLAT, "stress"),
    (r"R3D([34])", FLAT, ""),
    (rf"(?:S|DS)([34689]){OPTIONS}5?", FLAT, "stress"),
    (r"STRI6(5)", {5: "triangle6"}, "stress"),
    (r"STRI(3)", FLAT, "stress"),
    (rf"(?:C3D|DC3D|DCC3D|AC3D|Q3D)(10|15|20|27|4|5|6|8){OPTIONS}D?", SOLID, "space"),
    (rf"(?:SC|CSS)([68]){OPTIONS}", SOLID, "space"),
    (rf"(?:T2D|T3D|DC1D|R2D)([23]){OPTIONS}", LINE, "line"),
    (r"(?:B|PIPE)[23]([123])(?:H|OS|OSH)*", {1: "line", 2: "line3", 3: "line"}, "line"),
)
COUNTS = {cell: count for cells in (FLAT, SOLID, LINE) for count, cell in cells.items()}


class ElementType(NamedTuple):
    """What a type of element is read as."""

    cell: str  # meshio's name
    nodes: int
    kind: str  # plane "stress" or "strain", "axisymmetric", "space", "line", or "" where it says nothing


def element_type(name: str) -> ElementType | None:
    """The type of this name; None for one that is not known."""
    for pattern, cells, kind in FAMILIES:
        match = re.fullmatch(pattern, name.upper())
        if match and int(match[1]) in cells:
            cell = cells[int(match[1])]
            return ElementType(cell, COUNTS[cell], kind)
    return None
