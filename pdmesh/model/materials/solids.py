"""Solids of correspondence: what stress follows strain."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SolidKind:
    """A solid, `Material.solid`."""

    name: str
    rates: bool = False  # may go from step to step, `Material.form`
    flows: bool = False  # remembers what it has been through
    particles: bool = False  # what is known of its tips lets cracks grow that are particles


SOLIDS = {
    solid.name: solid
    for solid in (
        SolidKind(name="linear", rates=True, particles=True),
        SolidKind(name="svk", particles=True),
        SolidKind(name="neo hooke"),
        SolidKind(name="j2", rates=True, flows=True),
        SolidKind(name="orthotropic"),
    )
}
