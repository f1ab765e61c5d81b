"""A setting that is refused, and the materials of a model with their places."""

from __future__ import annotations

from typing import NamedTuple

from pdmesh.messages import unfit
from pdmesh.model.material import Material


class Impossible(NamedTuple):
    """A setting that is refused: its place, its value, and what to use."""

    place: str  # dotted, from $ on
    value: str  # none: it is missing; some: it is not quoted
    use: str  # none, and why: it cannot be there

    def __str__(self) -> str:
        return unfit(self.place, self.value, self.use)


Places = list[tuple[str, Material]]
