"""Builds the grid of a scene and checks it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from pdmesh.files import FilePath
from pdmesh.grid import fields_on_nodes, implicit_lattice, soundness
from pdmesh.grid.adaptive_scene import nested, undivided
from pdmesh.grid.bodies import build_body
from pdmesh.grid.bodies_beside import build_scene, each_alone
from pdmesh.model.contradictions import wrong_monitors
from pdmesh.model.document import ON_ONE_LATTICE, Document, Settings, write_file
from pdmesh.model.interfaces import wrong_interface
from pdmesh.model.node_grid import Grid, document_of
from pdmesh.model.rigid_bodies import without_bonds
from pdmesh.model.selection import two_motions
from pdmesh.model.suggestions import called
from pdmesh.model.values_of_place import PlaceError
from pdmesh.scene import checks
from pdmesh.scene.body import Body
from pdmesh.scene.conditions import Shift, describe
from pdmesh.scene.missing_values import known, with_files
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError


@dataclass(frozen=True)
class Built:
    """A grid with its settings, and remarks on how it was built."""

    grid: Grid
    settings: Settings
    notes: tuple[str, ...] = ()
    shifts: tuple[Shift, ...] = ()

    @property
    def document(self) -> Document:
        """The grid file as a document."""
        return document_of(self.grid, self.settings)

    def _repr_svg_(self) -> str | None:
        """SVG for a notebook: that of the grid."""
        return self.grid._repr_svg_()

    def write(self, path: FilePath) -> None:
        """Write the grid file at `path` in one atomic step, over one that is there. Raises OSError."""
        write_file(self.document, Path(path))


def build(scene: Scene | Body) -> Built:
    """The grid of a plate, or of a body whose solids are shells.

    Files of values that are still named are read from the current folder. Raises SceneError if it does not represent
    the drawing.
    """
    try:
        scene = with_files(scene, Path())
        built = _build(scene)
        grid = fields_on_nodes.with_fields(built.grid, built.settings, scene.fields, scene.spacing)
        interfaces = scene.interfaces
        if isinstance(scene, Body):
            interfaces = (*interfaces, *(each for beside in scene.bodies for each in beside.body.interfaces))
        for number, interface in enumerate(interfaces, start=1):
            names = [region.name for region in built.settings.regions]
            wrong = wrong_interface(interface, names, built.grid.dimension)
            if wrong is not None:
                raise SceneError(f"interface '{called(interface.name, number)}'{wrong}")
        built = replace(built, settings=msgspec.structs.replace(built.settings, interfaces=interfaces))
        built = replace(built, grid=grid, notes=(*built.notes, *fields_on_nodes.remarks(grid, built.settings)))
    except PlaceError as error:
        raise SceneError(f"conditions: {error}") from None
    twice = two_motions(built.settings.conditions, lambda condition: built.grid.chosen(condition.nodes, condition.box))
    if twice is not None:
        number, axis, earlier_number, row = twice
        later, earlier = (describe(built.settings.conditions[at]) for at in (number, earlier_number))
        place = ", ".join(f"{value:g}" for value in built.grid.part(np.array([row])).position[0])
        raise SceneError(f"{later}: {axis}: the node at ({place}) m is in {earlier} too; use one of them")
    return built


def _build(scene: Scene | Body) -> Built:
    wrong = wrong_monitors(scene.run, [condition.action.name for condition in scene.conditions])
    if wrong is not None:
        raise SceneError(f"run.{wrong}")
    if isinstance(scene, Body):
        scene = known(scene)
        grid, settings, body_notes = build_body(scene)
        without_bonds(grid, settings, scene.source or "scene")
        units = checks.remarks_on_materials(scene, scene.horizon, scene.finest, 3)
        return Built(grid, settings, (*scene.notes, *body_notes, *units))
    scene = known(scene)
    notes = (*scene.notes, *checks.remarks(scene))
    if scene.run.adapt != "none":  # whose bonds know nothing of shared loads
        scene = replace(scene, conditions=tuple(condition.on_one_row() for condition in scene.conditions))
    if scene.run.adapt in ON_ONE_LATTICE:
        scene, more = nested(scene)
        notes = (*notes, *more)
    if scene.run.adapt == "split":
        scene, more = undivided(scene)
        notes = (*notes, *more)
    lattice = implicit_lattice.lattice_of(scene)
    if lattice is not None:
        notes = (*notes, *soundness.remarks(*implicit_lattice.stand_in(scene)))
        return Built(*implicit_lattice.build(scene, lattice), notes)
    checks.limit_nodes(scene.shape, scene.spacing, "spacing")
    grid, settings, shifts = build_scene(scene)
    built = Built(grid, settings, notes, shifts)
    if grid.bodies is None:
        return looked_at(built)
    without_bonds(grid, settings, scene.source or "scene")
    sound = (remark for alone in each_alone(grid, settings) for remark in soundness.remarks(*alone))
    return replace(built, notes=(*notes, *sound))


def looked_at(built: Built) -> Built:
    """The built grid with remarks on its soundness. Raises SceneError if it does not represent the drawing."""
    return replace(built, notes=(*built.notes, *soundness.remarks(built.grid, built.settings)))
