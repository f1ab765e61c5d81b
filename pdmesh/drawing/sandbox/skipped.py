"""Statements of a drawing that say nothing of its shapes: meshing, views, pictures and files that Gmsh would write.

Layers of an extrusion are among them, which would bind the triangles of curved surfaces to a coarse mesh.
They are left out of what Gmsh reads. What is left is looked at as any drawing, so that leaving out allows nothing.
"""

from __future__ import annotations

from pdmesh.drawing.sandbox import words
from pdmesh.drawing.sandbox.scan import Drawing
from pdmesh.drawing.sandbox.tokens import Token

LAYERED = ("Layers", "Recombine")  # within an extrusion
PICTURES = (".pos", ".png", ".jpg", ".jpeg", ".gif")  # files that hold views and pictures


def without_skipped(drawing: Drawing) -> tuple[list[Token], dict[str, int]]:
    """The tokens without the statements that say nothing of shapes; the first line of each kind of those."""
    tokens: list[Token] = []
    skipped: dict[str, int] = {}
    place = 0
    while place < len(drawing.tokens):
        end = _end(drawing, place)
        what = _skips(drawing, place, end) if end else ""
        if what:
            skipped.setdefault(what, drawing.tokens[place].line)
            place = end
        else:
            tokens.append(drawing.tokens[place])
            place += 1
    return tokens, skipped


def _end(drawing: Drawing, place: int) -> int:
    """Position behind the semicolon of the plain statement that begins here; 0 if none does."""
    within = drawing.depths[place] > 0
    begins = drawing.starts(place) or (within and drawing.text(place - 1) == "{")
    if drawing.kind(place) != "word" or not begins or (within and drawing.text(place) not in LAYERED):
        return 0
    at = place
    while at < len(drawing.tokens) and drawing.text(at) != ";":
        last = drawing.partner.get(at, at)
        if last < at or last in drawing.heads:  # the end of what is around it, or a head
            return 0
        at = last + 1
    return at + 1 if at < len(drawing.tokens) else 0


def _skips(drawing: Drawing, place: int, end: int) -> str:
    """The command of a statement that says nothing of shapes; "" for all others."""
    first, second, third = (drawing.text(place + step) for step in range(3))
    if first == "Plugin" or (first in words.SKIPPED and second not in ("=", "(")):
        return first
    if first in LAYERED and drawing.depths[place]:
        return first
    if first == "Mesh" and second not in (".", "=", "("):
        return first
    if (first, second) == ("Background", "Mesh") or (first == "Delete" and second in ("Empty", "View")):
        return f"{first} {second}"
    if first == "Geometry" and third.startswith("DoubleClicked"):
        return f"{first}.{third}"
    if first in ("Merge", "Include") and drawing.kind(place + 1) == "string":
        name = drawing.tokens[place + 1].content
        return f'{first} "{name}"' if name.lower().endswith(PICTURES) else ""
    asks = any(drawing.text(at) == "View" and drawing.text(at + 1) == "[" for at in range(place, end))
    return "View" if asks else ""
