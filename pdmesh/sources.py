"""From a file of any kind - drawing, script, CAD file, mesh, or a model built before - to what it describes."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pdmesh.geo import CAD
from pdmesh.grid import Document, Grid, Settings, document_of, read_file
from pdmesh.lattice import Shift, build_grid
from pdmesh.parameters import Parameter
from pdmesh.scene import Refinement, Scene
from pdmesh.shapes import SceneError

MESHES = (
    ".msh",
    ".inp",
    ".vtu",
    ".vtk",
    ".xdmf",
    ".mesh",
    ".e",
    ".exo",
    ".med",
    ".bdf",
    ".nas",
    ".ply",
    ".off",
    ".stl",
)
REFINE = "--refine "  # begins the names under which a model keeps what was refined when it was built


@dataclass(frozen=True)
class Built:
    """A grid with its settings, and what happened on the way."""

    grid: Grid
    settings: Settings
    shifts: tuple[Shift, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def document(self) -> Document:
        """What is written."""
        return document_of(self.grid, self.settings)


def read_scene(
    path: Path,
    assignments: Sequence[tuple[str, str]] = (),
    refine: Sequence[str] = (),
    trust: bool = False,
) -> Scene:
    """The scene in a .geo, .py, STEP or BREP file, or the one that the model in a .json file was built from.

    `refine` adds zones without drawing, ``crack:DISTANCE[:SPACING]``, m. Raises SceneError or GridError.
    """
    if path.suffix.lower() == ".json":
        return _again(path, assignments, refine, trust)
    scene = _read(path, assignments, trust)
    kept = dict(scene.parameters)
    try:
        for word in refine:
            request = refinement(word)
            scene = replace(scene, refinements=(*scene.refinements, request))
            kept[REFINE + word] = word
        return replace(scene, parameters=tuple(kept.items()))
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def refinement(word: str) -> Refinement:
    """What ``crack:4e-3`` or ``hole:4e-3:2.5e-4`` asks for. Raises SceneError."""
    target, *numbers = word.split(":")
    try:
        distance, *spacing = (float(number) for number in numbers)
    except ValueError:
        distance, spacing = 0.0, []
    if target not in ("crack", "notch", "hole") or len(numbers) not in (1, 2) or distance <= 0:
        raise SceneError(
            f"--refine: found '{word}', expected crack, notch or hole, then :DISTANCE or :DISTANCE:SPACING"
        )
    return Refinement(target, distance, spacing[0] if spacing else None)  # type: ignore[arg-type]


def build(
    path: Path,
    assignments: Sequence[tuple[str, str]] = (),
    refine: Sequence[str] = (),
    trust: bool = False,
) -> Built:
    """The grid of the file at `path`; see read_scene, and meshes. Raises SceneError or GridError."""
    if path.suffix.lower() in MESHES:
        from pdmesh.meshes import read_mesh

        if refine:
            raise SceneError(f"{path}: --refine: found a mesh, expected a drawing")
        grid, settings, notes = read_mesh(path, assignments, trust)
        return Built(grid, settings, notes=notes)
    scene = read_scene(path, assignments, refine, trust)
    try:
        return Built(*build_grid(scene), notes=scene.notes)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def parameters(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> list[Parameter]:
    """The parameters of a drawing, a script or a model. Raises SceneError or GridError."""
    suffix = path.suffix.lower()
    if suffix == ".json":
        return [Parameter(name, value) for name, value in read_file(path).parameters.items()]
    if suffix == ".py":
        from pdmesh.script import script_parameters

        return script_parameters(path)
    if suffix == ".geo":
        from pdmesh.geo import read_parameters

        return read_parameters(path, assignments, trust)
    raise SceneError(f"{path}: found suffix '{path.suffix}', expected .geo, .py or .json")


def _read(path: Path, assignments: Sequence[tuple[str, str]], trust: bool) -> Scene:
    suffix = path.suffix.lower()
    if suffix == ".py":
        from pdmesh.script import read_script

        return read_script(path, assignments)
    if suffix == ".geo":
        from pdmesh.geo import read_geo

        return read_geo(path, assignments, trust)
    if suffix in CAD:
        from pdmesh.geo import read_cad

        return read_cad(path, assignments)
    meshes = "" if suffix in MESHES else f", or a mesh's: {', '.join(MESHES)}"
    raise SceneError(f"{path}: found suffix '{path.suffix}', expected .geo, .py, .json, {', '.join(CAD)}{meshes}")


def _again(path: Path, assignments: Sequence[tuple[str, str]], refine: Sequence[str], trust: bool) -> Scene:
    """The scene of a model that carries its drawing, with the parameters it was built with."""
    document = read_file(path)
    if not document.drawing or not document.source:
        raise SceneError(f"{path}: $.drawing: found none, expected the text of the drawing it was built from")
    source = Path(document.source)
    plain = source.name == document.source and document.source.isprintable()
    if not plain or source.suffix.lower() not in (".geo", ".py", *CAD):
        raise SceneError(f"{path}: $.source: found {document.source!r}, expected the name of a .geo, .py or CAD file")
    if source.suffix.lower() == ".py" and not trust:
        raise SceneError(f"{path}: $.drawing: found a Python program, expected a drawing (--trust runs it)")
    used = {name: value for name, value in document.parameters.items() if not name.startswith(REFINE)}
    kept = [str(value) for name, value in document.parameters.items() if name.startswith(REFINE)]
    words = [(name, str(value)) for name, value in used.items()]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"drawing{source.suffix}"
        copy.write_text(document.drawing, encoding="utf-8", newline="")
        try:
            scene = read_scene(copy, [*words, *assignments], [*kept, *refine], trust)
        except SceneError as error:
            raise SceneError(f"{path}: {str(error).replace(str(copy), source.name)}") from None
    notes = tuple(note.replace(str(copy), f"{path}: {source.name}") for note in scene.notes)
    return replace(scene, source=source.name, notes=notes)
