"""What an Abaqus input file defines: nodes, elements and sets of its parts, and the instances of these."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.abaqus_keywords import Keyword

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
MAKING = (  # keywords that make nodes or elements of others, or move them, which are not read
    *("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "SUBSTRUCTURE", "IMPORT", "PARAMETER"),
    *("SYMMETRICMODELGENERATION", "MODELCHANGE"),
)
PLAIN = ("HEADING", "PREPRINT", "INCLUDE", "PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "ENDINSTANCE")


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


@dataclass
class Members:
    """A set as it is written: its own numbers and the names of others."""

    name: str
    entries: list[tuple[Keyword, int, str]] = field(default_factory=list)  # keyword, line, number or name
    numbers: list[NDArray[np.int64]] = field(default_factory=list)
    ranges: list[tuple[Keyword, int, range]] = field(default_factory=list)  # of GENERATE


@dataclass
class Elements:
    """Elements of one type: numbers (k,) and nodes (k, count)."""

    keyword: Keyword
    type: ElementType
    ids: NDArray[np.int64]
    nodes: NDArray[np.int64]


@dataclass
class Scope:
    """What a part, an instance, or a file without parts defines."""

    name: str = ""
    ids: list[int] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)
    elements: list[Elements] = field(default_factory=list)
    element_sets: dict[str, Members] = field(default_factory=dict)
    node_sets: dict[str, Members] = field(default_factory=dict)
    surfaces: dict[str, Members] = field(default_factory=dict)


@dataclass
class Instance:
    """A part placed in the assembly: moved, then turned."""

    name: str
    part: str
    keyword: Keyword
    scope: Scope

    def moved(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) of the part where the instance has them. Raises SceneError for data that are none."""
        turned = False
        for row, (line, text) in enumerate(self.keyword.rows):
            numbers = self.keyword.numbers(line, text)
            if row == 0 and len(numbers) <= 3:
                points = points + np.pad(numbers, (0, 3 - len(numbers)))
            elif len(numbers) == 7 and not turned:  # also as the first, behind a blank line for no translation
                if numbers[:3] == numbers[3:6]:
                    raise self.keyword.error(
                        "*INSTANCE: the two points of the axis are at one place; move them apart", line
                    )
                with np.errstate(over="ignore", invalid="ignore"):  # which is refused below
                    points = _turned(points, np.array(numbers[:3]), np.array(numbers[3:6]), numbers[6])
                turned = True
            else:
                wanted = "x, y, z of a translation, then x, y, z of two points of an axis and an angle"
                raise self.keyword.error(f"*INSTANCE: {len(numbers)} numbers given; give {wanted}", line)
        if not np.isfinite(points).all():
            raise self.keyword.error("*INSTANCE: it moves points beyond all numbers; give lengths in metres")
        return points


def _turned(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64], degrees: float
) -> NDArray[np.float64]:
    """Points turned about the axis from `start` to `end`, by Rodrigues' formula."""
    axis = end - start
    axis, way = axis / math.hypot(*axis), points - start
    quarter = degrees / 90
    exact = quarter == round(quarter)  # so that what is turned by 90 degrees stays on its lattice
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    if exact:
        sine, cosine = float(round(sine)), float(round(cosine))
    return np.asarray(start + cosine * way + sine * np.cross(axis, way) + (1 - cosine) * (way @ axis)[:, None] * axis)


class Model:
    """All that a file defines, by parts and instances."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root, self.parts = Scope(), dict[str, Scope]()
        self.instances: dict[str, Instance] = {}
        self.current = self.root
        self.unread: dict[str, int] = {}  # keywords and their first lines

    def take(self, keyword: Keyword) -> None:
        """Add what a keyword defines. Raises SceneError."""
        if keyword.name in MAKING:
            raise keyword.error(f"'*{keyword.name}' is not read; give nodes and elements one by one")
        if "INPUT" in keyword.options and keyword.name in ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"):
            raise keyword.error(f"*{keyword.name}: INPUT= is not read; put the mesh in one file")
        match keyword.name:
            case "PART":
                name = keyword.word("NAME")
                if name.upper() in self.parts:
                    raise keyword.error(f"*PART: NAME={name} is used twice; give each part a name of its own")
                self.current = self.parts[name.upper()] = Scope(name)
            case "INSTANCE":
                self._place(keyword)
            case "ENDPART" | "ENDINSTANCE" | "ASSEMBLY" | "ENDASSEMBLY":
                self.current = self.root
            case name if name in TAKEN:
                TAKEN[name](self.current, keyword)
            case name if name not in PLAIN:
                self.unread.setdefault(name, keyword.line)

    def _place(self, keyword: Keyword) -> None:
        if "LIBRARY" in keyword.options:
            raise keyword.error("*INSTANCE: LIBRARY= is not read; use the instance of a part in the file")
        name, part = keyword.word("NAME"), keyword.word("PART")
        if name.upper() in self.instances:
            raise keyword.error(f"*INSTANCE: NAME={name} is used twice; give each instance a name of its own")
        if part.upper() not in self.parts:
            raise keyword.error(f"*INSTANCE: PART={part} is not defined; define it, or correct the name")
        scope = Scope(name)
        self.instances[name.upper()] = Instance(name, part.upper(), keyword, scope)
        self.current = scope


def _take_nodes(scope: Scope, keyword: Keyword) -> None:
    system, ids = keyword.options.get("SYSTEM", "R").upper()[:1], list[int]()
    for line, text in keyword.rows:
        ids.append(keyword.integer(line, text.partition(",")[0]))
        x, y, z = (*keyword.numbers(line, text)[1:], 0.0, 0.0, 0.0)[:3]
        if system == "C":
            x, y = x * np.cos(np.radians(y)), x * np.sin(np.radians(y))
        elif system == "S":
            out, around, up = x, np.radians(y), np.radians(z)
            x, y, z = out * np.cos(up) * np.cos(around), out * np.cos(up) * np.sin(around), out * np.sin(up)
        scope.places.append((x, y, z))
    scope.ids += ids
    if "NSET" in keyword.options:
        name = keyword.word("NSET")
        scope.node_sets.setdefault(name.upper(), Members(name)).numbers.append(np.array(ids, dtype=np.int64))


def _take_elements(scope: Scope, keyword: Keyword) -> None:
    word = keyword.word("TYPE")
    kind = element_type(word)
    if kind is None:
        raise keyword.error(f"*ELEMENT: TYPE={word} is not read; use one such as CPS4, S4R or C3D8")
    rows: list[list[int]] = []
    for line, text in keyword.rows:
        numbers = keyword.integers(line, text)
        if rows and len(rows[-1]) <= kind.nodes:
            rows[-1] += numbers
        else:
            rows.append(numbers)
        if len(rows[-1]) > kind.nodes + 1 and kind.kind != "line" and kind.nodes not in (15, 27):
            node_count = len(rows[-1]) - 1
            raise keyword.error(f"*ELEMENT: {node_count} nodes given; {word} has {kind.nodes}", line)
    if rows and len(rows[-1]) <= kind.nodes:
        node_count, line = len(rows[-1]) - 1, keyword.rows[-1][0]
        raise keyword.error(f"*ELEMENT: {node_count} nodes given; {word} has {kind.nodes}", line)
    table = np.array([row[: kind.nodes + 1] for row in rows], dtype=np.int64).reshape(-1, kind.nodes + 1)
    scope.elements.append(Elements(keyword, kind, table[:, 0], table[:, 1:]))
    if "ELSET" in keyword.options:
        name = keyword.word("ELSET")
        scope.element_sets.setdefault(name.upper(), Members(name)).numbers.append(table[:, 0])


def _take_set(scope: Scope, keyword: Keyword) -> None:
    name, sets = keyword.word(keyword.name), scope.element_sets if keyword.name == "ELSET" else scope.node_sets
    members = sets.setdefault(name.upper(), Members(name))
    for line, text in keyword.rows:
        if "GENERATE" in keyword.options:
            numbers = keyword.integers(line, text)
            first, last, step = (*numbers, 1)[:3] if len(numbers) in (2, 3) else (0, 0, 0)
            if step == 0 or (last - first) * step < 0:
                raise keyword.error(
                    f"*{keyword.name}: '{text.strip():.60}' is not a range; use first, last, step", line
                )
            members.ranges.append((keyword, line, range(first, last + (1 if step > 0 else -1), step)))
        else:
            members.entries += [(keyword, line, word) for word in words(text) if word]


def words(text: str) -> list[str]:
    """The words on a line of data, without the quotes that keep the blanks of a name."""
    return [word.replace('"', "").strip() for word in text.split(",")]


def _take_surface(scope: Scope, keyword: Keyword) -> None:
    if keyword.options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
        name = keyword.word("NAME")
        members = scope.surfaces.setdefault(name.upper(), Members(name))
        members.entries += [(keyword, line, text) for line, text in keyword.rows]


TAKEN: dict[str, Callable[[Scope, Keyword], None]] = {
    "NODE": _take_nodes,
    "ELEMENT": _take_elements,
    "ELSET": _take_set,
    "NSET": _take_set,
    "SURFACE": _take_surface,
}
