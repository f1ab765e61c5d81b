"""Scenes whose materials have a critical stretch in place of a fracture energy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import msgspec

from pdmesh.model.document import Material
from pdmesh.model.fracture_energy import with_fracture_energy
from pdmesh.scene.body import Body, SolidBeside
from pdmesh.scene.scene import Scene

S = TypeVar("S", bound=Scene | Body)


def known(scene: S) -> S:
    """The scene whose materials have the fracture energies of their critical stretches, with its finest nodes."""
    every: list[Material | None] = [scene.material, *(part.region.material for part in scene.regions)]
    for other_body in scene.bodies:
        every.append(other_body.body.material if isinstance(other_body, SolidBeside) else other_body.material)
    if all(material is None or material.critical_stretch is None for material in every):
        return scene
    changed: dict[str, Any] = {"material": _energetic(scene.material, scene, scene.finest)}
    changed["regions"] = tuple(
        replace(part, region=msgspec.structs.replace(part.region, material=material))
        for part in scene.regions
        for material in [_energetic(part.region.material, scene, scene.finest)]
    )
    if isinstance(scene, Scene):
        changed["bodies"] = tuple(
            replace(body, material=_energetic(body.material, scene, body.spacing)) for body in scene.bodies
        )
    else:
        changed["bodies"] = tuple(replace(solid_body, body=known(solid_body.body)) for solid_body in scene.bodies)
    return replace(scene, **changed)


def _energetic(material: Material | None, scene: Scene | Body, spacing: float) -> Material | None:
    dimension = 3 if isinstance(scene, Body) else 2
    return None if material is None else with_fracture_energy(material, scene.horizon, spacing, dimension)
