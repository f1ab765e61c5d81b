"""Faces of pre-cracks under pressure in the frames of a run."""

from __future__ import annotations

import msgspec
import numpy as np

from pdmesh.model.document import ARC, CRACK, AnyCondition, Load, Material, Region, Run
from pdmesh.model.materials.kind import softens
from pdmesh.model.node_arrays import selected
from pdmesh.model.pressed_faces import area_vectors, pieces_of, rim_of
from pdmesh.model.values_at_places import values_at
from pdsolve.fracture.loaded_faces import LoadedFaces
from pdsolve.measures.embedded_model import at_rest, read
from pdsolve.measures.frame_steps import vector
from pdsolve.results import Results, ResultsError


class _PressureGridFileKeys(msgspec.Struct):
    """The keys of the grid file that say where pressure acts, and how."""

    material: Material
    regions: tuple[Region, ...] = ()
    conditions: tuple[AnyCondition, ...] = ()
    run: Run = Run()


def loaded_faces_at(results: Results, step: int) -> LoadedFaces | None:
    """Faces of cracks under a dead pressure after `step`, with their displacements; None without any.

    Raises ResultsError along an equilibrium path, whose load factors are not stored.
    """
    model = read(results, _PressureGridFileKeys)
    pressures = [load for load in model.conditions if isinstance(load, Load) and load.pressure is not None]
    loads = [load for load in pressures if load.faces and not load.following]  # of cracks
    if not loads:
        return None
    materials = (model.material, *(region.material for region in model.regions))
    if at_rest(results) and (model.run.static.control in (ARC, CRACK) or any(map(softens, materials))):
        raise ResultsError(
            f"{results.name}: faces of a crack are under pressure along an equilibrium path, whose load factor is not"
            " known here; use load steps of bonds that do not soften"
        )
    nodes, displacement = results.nodes(step), vector(results, "displacement", step)
    time = step * float(results.meta()["time_step"])
    parts = []
    for load in loads:
        rows = np.flatnonzero(selected(nodes, load.nodes, load.box))
        faces = pieces_of(load.faces or (), nodes.position[rows], nodes.delta[rows], nodes.area[rows])
        corners, moved = faces.corners, faces.weights @ displacement[rows]
        points, middles = np.array(load.profile or ((0.0, 1.0),)), corners[faces.pieces].mean(axis=1)
        pressure = np.interp(time, *points.T) * values_at(load.pressure or 0.0, middles, time)
        outward, at_rim = area_vectors(corners, faces.pieces), rim_of(faces)[faces.pieces]
        force = -pressure[:, None] * outward
        parts.append(LoadedFaces(corners[faces.pieces], moved[faces.pieces], force, outward, at_rim))
    return LoadedFaces(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
