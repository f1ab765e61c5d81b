"""Words of a drawing about mesh sizes, which a node grid does not use, for a note to the user."""

from __future__ import annotations

from pdmesh.drawing.sandbox import words
from pdmesh.drawing.sandbox.scan import Drawing

SIZES = ("Characteristic", "Field", "MeshSize", "Transfinite")


def unused(drawing: Drawing) -> dict[str, int]:
    """Words about the size of mesh elements, with the first line of each."""
    first_lines: dict[str, int] = {}
    for place, token in enumerate(drawing.tokens):
        what = _what(drawing, place) if token.kind == "word" else ""
        if what:
            first_lines.setdefault(what, token.line)
    return first_lines


def _what(drawing: Drawing, place: int) -> str:
    text = drawing.text(place)
    if text == "Point" and drawing.text(place + 1) == "(":
        values = drawing.partner[place + 1] + 2
        if drawing.text(values) != "{":
            return ""
        inside, depth = range(values + 1, drawing.partner[values]), drawing.depths[values] + 1
        commas = sum(drawing.text(i) == "," and drawing.depths[i] == depth for i in inside)
        return "mesh sizes of points" if commas >= 3 else ""
    if drawing.text(place - 1) == ".":
        return f"Mesh.{text}" if drawing.text(place - 2) == "Mesh" and text in words.OPTION_SIZES else ""
    return {"Characteristic": "MeshSize"}.get(text, text) if text in SIZES else ""
