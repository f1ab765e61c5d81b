"""Solids of correspondence: what stress follows strain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pdmesh.model.document import Material
from pdmesh.model.materials.kind import Parameter, Refusal, Refusals, nothing


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A solid, `Material.solid`."""

    name: str
    parameters: tuple[Parameter, ...] = ()
    rates: bool = False  # may go from step to step, `Material.form`
    flows: bool = False  # remembers what it has been through
    particles: bool = False  # what is known of its tips lets cracks grow that are particles
    wrong: Callable[[Material], Refusals] = nothing  # in itself


def _yields(material: Material) -> Refusals:
    if material.yield_stress is None:
        yield Refusal("yield_stress", "more than 0 Pa with solid 'j2'")


SOLIDS = {
    solid.name: solid
    for solid in (
        Solid(name="linear", rates=True, particles=True),
        Solid(name="svk", particles=True),
        Solid(name="neo hooke"),
        Solid(
            name="j2",
            parameters=(
                Parameter("yield_stress", "Pa", used=("solid", "j2")),
                Parameter("hardening", "Pa", used=("solid", "j2")),
            ),
            rates=True,
            flows=True,
            wrong=_yields,
        ),
    )
}
