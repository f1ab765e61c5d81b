"""Reads a file of any kind - drawing, script, CAD file, mesh, or a model built earlier - as a scene or a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from pdmesh.drawing.additions import ADAPT, SET, adapted, added, sorted_out, split_settings, with_settings
from pdmesh.drawing.parameters import OF_SETTINGS, Parameter, full_name, unknown
from pdmesh.drawing.scratch import scratch
from pdmesh.file_kinds import CAD, MESHES, OF_PROGRAMS, SAVE_AS_STEP
from pdmesh.files import FilePath
from pdmesh.grid import building
from pdmesh.grid.building import Built, looked_at
from pdmesh.model.document import Document, Settings, read_file, settings_of
from pdmesh.model.node_grid import grid_of
from pdmesh.model.settings_overlay import overlaid
from pdmesh.scene.body import Body
from pdmesh.scene.missing_values import with_files
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError, errors_at


def read_scene(
    path: FilePath,
    assignments: Sequence[tuple[str, str]] = (),
    refine: Sequence[str] = (),
    trust: bool = False,
    cracks: Sequence[str] = (),
) -> Scene | Body:
    """The plate or body in a .geo, .py, STEP or BREP file, or the one that a .json model was built from.

    `refine` adds zones ``crack:DISTANCE[:SPACING]`` and `cracks` adds cracks ``x0,y0,x1,y1``, in the drawing's unit.
    `trust` allows a Python scene to run, and a drawing to run commands and read other files. Files of values that
    conditions name are read beside the file. Raises UntrustedError, SceneError or GridError.
    """
    path = Path(path)
    scene = _read_scene(path, assignments, refine, trust, cracks)
    with errors_at(path):
        return with_files(scene, path.parent)


def _read_scene(
    path: Path, assignments: Sequence[tuple[str, str]], refine: Sequence[str], trust: bool, cracks: Sequence[str]
) -> Scene | Body:
    if path.suffix.lower() == ".json":
        # a model that carries its drawing is read with the parameters it was built with
        document = read_file(path)
        if not document.drawing or not document.source:
            raise SceneError(
                f"{path}: $.drawing is missing, the text of the drawing it was built from; use the drawing itself"
            )
        source = Path(document.source)
        plain = source.name == document.source and document.source.isprintable()
        if not plain or source.suffix.lower() not in (".geo", ".py", *CAD):
            raise SceneError(f"{path}: $.source is {document.source!r}; give the name of a .geo, .py or CAD file")
        words, refined, cracked = sorted_out(document.parameters)
        with scratch() as folder:
            copy = folder / f"drawing{source.suffix}"
            copy.write_text(document.drawing, encoding="utf-8", newline="")
            try:
                scene = _read_scene(copy, [*words, *assignments], [*refined, *refine], trust, [*cracked, *cracks])
            except SceneError as error:
                raise type(error)(f"{path}: {str(error).replace(str(copy), source.name)}") from None
        notes = tuple(note.replace(str(copy), f"{path}: {source.name}") for note in scene.notes)
        return replace(scene, source=source.name, notes=notes)
    # a program has variables, without dots in their names; a drawing has settings of the solver as parameters
    drawn = () if path.suffix.lower() == ".py" else OF_SETTINGS
    to_drawing, to_settings = split_settings([pair for pair in assignments if pair[0] != ADAPT], drawn)
    scene = _read(path, to_drawing, trust)
    with errors_at(path):
        if isinstance(scene, Body):
            for option, option_value in (("--refine", refine), ("--crack", cracks)):
                if option_value:
                    raise SceneError(f"{option} is for plates; leave it out for a body in space")
            return adapted(with_settings(scene, path, to_settings), dict(assignments).get(ADAPT))
        return added(with_settings(scene, path, to_settings), refine, cracks, dict(assignments).get(ADAPT))


def build_file(
    path: FilePath,
    assignments: Sequence[tuple[str, str]] = (),
    refine: Sequence[str] = (),
    trust: bool = False,
    cracks: Sequence[str] = (),
) -> Built:
    """The grid of the file at `path`, which may also be a mesh; arguments are those of `read_scene`.

    Raises UntrustedError, SceneError or GridError.
    """
    path = Path(path)
    if path.suffix.lower() == ".json" and not (refine or cracks):
        document = document_with_settings(path, assignments)
        if document is not None and not document.drawing:
            return Built(grid_of(document, str(path)), settings_of(document))
    if path.suffix.lower() in MESHES:
        from pdmesh.drawing.meshes import read_mesh

        adapt = dict(assignments).get(ADAPT)
        to_mesh, to_settings = split_settings([pair for pair in assignments if pair[0] != ADAPT], OF_SETTINGS)
        plate_or_body = read_mesh(path, to_mesh, cracks, trust)
        for option, option_value in (("--refine", refine), (ADAPT, not isinstance(plate_or_body, Body) and adapt)):
            if option_value:
                raise SceneError(f"{path}: {option} is for drawings; leave it out for a mesh")
        if not isinstance(plate_or_body, Body):
            with errors_at(path):
                built = looked_at(Built(*plate_or_body))
            return replace(built, settings=overlaid(built.settings, path, None, to_settings))
        with errors_at(path):
            scene: Scene | Body = adapted(with_settings(plate_or_body, path, to_settings), adapt)
    else:
        scene = read_scene(path, assignments, refine, trust, cracks)
    with errors_at(path):
        return building.build(scene)


def document_with_settings(path: Path, assignments: Sequence[tuple[str, str]]) -> Document | None:
    """The model in a .json file with settings laid over its own; None without any or with parameters of a drawing.

    Raises GridError or ModelError.
    """
    if not assignments or split_settings(assignments, ())[0]:
        return None
    document = read_file(path)
    settings = overlaid(settings_of(document), path, None, assignments, document.dimension)
    return msgspec.structs.replace(document, **{name: getattr(settings, name) for name in Settings.__struct_fields__})


def file_parameters(
    path: FilePath, assignments: Sequence[tuple[str, str]] = (), trust: bool = False
) -> list[Parameter]:
    """The parameters of a drawing, a script, a CAD file, a mesh or a model. Raises SceneError or GridError."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        parameters = {name.removeprefix(SET): value for name, value in read_file(path).parameters.items()}
        for name, value in assignments:
            complete_name = name if name in parameters else full_name(name)
            if complete_name not in parameters:
                raise SceneError(f"{path}: {unknown(name, parameters)}")
            parameters[complete_name] = value
        return [Parameter(name, value) for name, value in parameters.items()]
    if suffix == ".py":
        from pdmesh.drawing.script import script_parameters

        return script_parameters(path, assignments, trust)
    if suffix == ".geo":
        from pdmesh.drawing.geo import read_parameters

        return read_parameters(path, assignments, trust)
    if suffix in CAD:
        from pdmesh.drawing.geo import cad_parameters

        return cad_parameters(path, assignments)
    if suffix in MESHES:
        from pdmesh.drawing.meshes import mesh_parameters

        return mesh_parameters(path, assignments, trust)
    raise _unknown(path)


def _read(path: Path, assignments: Sequence[tuple[str, str]], trust: bool) -> Scene | Body:
    suffix = path.suffix.lower()
    if suffix == ".py":
        from pdmesh.drawing.script import read_script

        if any(name == "Units" for name, _ in assignments):
            raise SceneError(f"{path}: --unit is not for a Python scene, whose lengths are in metres; leave it out")
        return read_script(path, assignments, trust)
    if suffix == ".geo":
        from pdmesh.drawing.geo import read_geo

        return read_geo(path, assignments, trust)
    if suffix in CAD:
        from pdmesh.drawing.geo import read_cad

        return read_cad(path, assignments)
    if suffix in MESHES:
        from pdmesh.drawing.meshes import read_mesh

        plate_or_body = read_mesh(path, assignments, (), trust)
        if isinstance(plate_or_body, Body):
            return plate_or_body
        raise SceneError(f"{path} is a mesh of a plate, which has its nodes; use a drawing, or a mesh of solids")
    raise _unknown(path)


def _unknown(path: Path) -> SceneError:
    """The error of a file whose suffix no reader has."""
    if path.suffix.lower() in OF_PROGRAMS:
        return SceneError(f"{path}: suffix '{path.suffix}' is not known; {SAVE_AS_STEP}")
    suffixes = f"{', '.join(CAD)}, or a mesh's: {', '.join(MESHES)}"
    return SceneError(f"{path}: suffix '{path.suffix}' is not known; use .geo, .py, .json, {suffixes}")
