"""What a kind of material says of itself: its settings, what it fails by, where it is possible and what it refuses."""

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


def nothing_at_rest(material: Material, breaks: bool) -> Refusals:
    """Refuses nothing under load steps."""
    yield from ()


def bonds_alone(material: Material, first: Material, adapt: str) -> Refusals:
    """Refuses a kind that no cells that split and no fine zones take."""
    in_space = material.plane == "space"
    zones_removed = material.model == "ordinary" and adapt == "hybrid" and not in_space
    last = "; version 1.0.0 was the last with zones of ordinary solids" if zones_removed else ""
    yield Refusal("model", f"bond (or --adapt none{last}), as run.adapt is {adapt}{' in space' if in_space else ''}")


def symmetric_alone(material: Material) -> Refusals:
    """Refuses a kind that one-sided bonds do not make."""
    yield Refusal("model", "'bond' in the thesis mode")


@dataclass(frozen=True, kw_only=True)
class MaterialKind:
    """A kind of material, `Material.model`; each rule yields what is refused of one."""

    name: str
    structs: tuple[type[msgspec.Struct], ...]  # of parameters of its own, or shared with some others
    failures: tuple[str, ...]  # `Material.failure`
    wrong: Callable[[Material], Refusals] = nothing  # in itself
    in_space: Callable[[Material], Refusals] = nothing
    at_rest: Callable[[Material, bool], Refusals] = nothing_at_rest  # load steps, in which bonds break or not
    from_rest: Callable[[Material], Refusals] = nothing  # a run that begins there remembers nothing of it
    with_particles: Callable[[Material], Refusals] = nothing  # cracks that are particles
    one_sided: Callable[[Material], Refusals]  # the thesis mode
    adaptive: Callable[[Material, Material, str], Refusals]  # by the plate's own material and `Run.adapt`

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return tuple(name for struct in self.structs for name in struct.__struct_fields__)


def compressible(material: Material) -> Refusals:
    """Refuses a Poisson's ratio that is not known, or 0.5 and more."""
    if material.nu is None or material.nu >= 0.5:
        yield Refusal("nu", f"Poisson's ratio below 0.5 with model '{material.model}'")
