"""Values that a scene names or implies: tables in files, and fracture energies of critical stretches."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from pdmesh.model.document import Material
from pdmesh.model.fracture_energy import with_fracture_energy
from pdmesh.model.values_at_places import read_table, with_read_values
from pdmesh.model.values_of_place import PlaceError, Table, is_file
from pdmesh.scene.body import Body, SolidBeside
from pdmesh.scene.conditions import describe
from pdmesh.scene.mesh_files import is_mesh, table_of_mesh
from pdmesh.scene.node_fields import STRETCH
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

S = TypeVar("S", bound=Scene | Body)


def with_files(scene: S, folder: Path) -> S:
    """The scene with tables in place of the names of files in a folder. Raises SceneError."""
    dimension, changed = len(scene.AXES), []

    def read(words: str) -> Table:
        return (table_of_mesh if is_mesh(words) else read_table)(words, folder, dimension)

    for condition in scene.conditions:
        try:
            action = with_read_values(condition.action, is_file, read)
        except PlaceError as error:
            raise SceneError(f"{describe(condition.action)}: {error}") from None
        changed.append(condition if action is condition.action else replace(condition, action=action))
    fields = []
    for field in scene.fields:
        try:
            fields.append(field.read(folder, dimension))
        except PlaceError as error:
            raise SceneError(f"{field.place}: {error}") from None
    if all(new is old for new, old in zip((*changed, *fields), (*scene.conditions, *scene.fields), strict=True)):
        return scene
    return replace(scene, conditions=tuple(changed), fields=tuple(fields))  # type: ignore[arg-type]


def known(scene: S) -> S:
    """The scene whose materials have the fracture energies of their critical stretches, with its finest nodes."""
    every: list[Material | None] = [scene.material, *(part.region.material for part in scene.regions)]
    for other_body in scene.bodies:
        every.append(other_body.body.material if isinstance(other_body, SolidBeside) else other_body.material)
    if all(material is None or material.critical_stretch is None for material in every):
        return scene
    quantities = {field.quantity: field.place for field in scene.fields}
    if "E" in quantities and STRETCH not in quantities:
        raise SceneError(
            f"{quantities['E']}: the energy of material.critical_stretch depends on E; let it vary as well"
            ' (.vary("critical_stretch", ...)), or give G0'
        )
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
