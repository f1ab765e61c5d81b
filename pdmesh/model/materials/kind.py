"""What a kind of material says of itself: its settings, what it fails by and what it cannot be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import msgspec

from pdmesh.model.material import USUAL_LAW, Material


class Refusal(NamedTuple):
    """A setting of a material that is refused, and what is expected instead."""

    name: str
    expected: str


Refusals = Iterator[Refusal]


def softens(material: Material) -> bool:
    """Whether bonds, alone or with rotations, are of a law that is not brittle."""
    if material.model not in ("bond", "micropolar"):
        return False
    return material.law != USUAL_LAW and not (material.law == "bilinear" and material.kr == 1)


def nothing(material: Material) -> Refusals:
    """Refuses nothing."""
    yield from ()


@dataclass(frozen=True, kw_only=True)
class MaterialKind:
    """A kind of material, `Material.model`; `wrong` yields what is refused of one."""

    name: str
    structs: tuple[type[msgspec.Struct], ...]  # of parameters of its own, or shared with some others
    failures: tuple[str, ...]  # `Material.failure`
    wrong: Callable[[Material], Refusals] = nothing  # in itself

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(name for struct in self.structs for name in struct.__struct_fields__)


def compressible(material: Material) -> Refusals:
    """Refuses a Poisson's ratio that is not known, or 0.5 and more."""
    if material.nu is None or material.nu >= 0.5:
        yield Refusal("nu", f"Poisson's ratio below 0.5 with model '{material.model}'")
