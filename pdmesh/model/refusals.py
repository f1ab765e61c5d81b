"""A setting that is refused, and the materials of a model with their places."""

from __future__ import annotations

from typing import NamedTuple

from pdmesh.model.material import Material


class Impossible(NamedTuple):
    """A setting that is refused: its place, what was found, what was expected."""

    place: str  # dotted, from $ on
    found: str
    expected: str

    def __str__(self) -> str:
        return f"{self.place}: found {self.found}, expected {self.expected}"


Places = list[tuple[str, Material]]
