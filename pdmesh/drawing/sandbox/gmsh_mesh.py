"""Reads a mesh by Gmsh as a meshio mesh: MSH 1 to 4, Nastran, UNV.

`load` imports Gmsh before walls are raised, `read` reads one file after that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import numpy.ctypeslib  # Gmsh's module imports it when it is first used
import numpy.ma  # likewise, np.unique
from numpy.typing import NDArray

from pdmesh.drawing.sandbox.walls import WITHOUT_WORDS

TYPES = {  # Gmsh's numbers, meshio's names
    15: "vertex", 1: "line", 8: "line3",
    2: "triangle", 9: "triangle6", 3: "quad", 16: "quad8", 10: "quad9",
    4: "tetra", 11: "tetra10", 5: "hexahedron", 17: "hexahedron20", 12: "hexahedron27",
    6: "wedge", 18: "wedge15", 13: "wedge18", 7: "pyramid", 19: "pyramid13", 14: "pyramid14",
}  # fmt: skip
FEWER = "use a mesh of fewer elements"
BY_PROPERTY = (".bdf", ".nas")  # formats whose groups are properties, which Gmsh has as entities


def load() -> None:
    """Import and start Gmsh. Raises ModuleNotFoundError and OSError."""
    import gmsh

    gmsh.initialize(interruptible=False, readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.IgnoreUnknownSections", 1)


def read(path: Path) -> meshio.Mesh:
    """The mesh in a file. Raises ValueError with what Gmsh says of it."""
    import gmsh

    gmsh.logger.start()
    try:
        gmsh.merge(str(path))
    except Exception as error:  # gmsh raises bare Exception
        logged = [line.partition(":")[2].strip() for line in gmsh.logger.get() if line.startswith("Error")]
        words = next(filter(None, [*logged, " ".join(str(error).split())]), f"{WITHOUT_WORDS}; {FEWER}")
        raise ValueError(f"Gmsh says: {words}") from None
    tags, places, _ = gmsh.model.mesh.getNodes()
    if not len(tags):
        raise ValueError("the mesh has no points")
    row = np.full(int(max(tags)) + 1, -1) if max(tags) < 100 * len(tags) else None
    order = np.argsort(tags)
    if row is not None:
        row[tags] = np.arange(len(tags))

    def rows(nodes: Any) -> NDArray[np.int64]:
        if row is not None:
            return np.asarray(row[nodes], dtype=np.int64)
        return np.asarray(order[np.searchsorted(tags, nodes, sorter=order)], dtype=np.int64)

    blocks, entities = _blocks(gmsh, rows)
    # names of groups, or their numbers, with the keys of their entities
    if path.suffix in BY_PROPERTY:
        groups = [(str(tag), [dimension * 2**40 + tag]) for dimension, tag in gmsh.model.getEntities() if dimension]
    else:
        groups = [
            (
                gmsh.model.getPhysicalName(dimension, tag).strip() or str(tag),
                [dimension * 2**40 + int(entity) for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)],
            )
            for dimension, tag in gmsh.model.getPhysicalGroups()
        ]
    sets: dict[str, list[NDArray[np.int64]]] = {}
    for name, members in groups:
        chosen = [np.isin(of[0], members) if len(of[0]) else np.zeros(0, dtype=bool) for of in entities]
        group_rows = [
            np.unique(of[1][in_group]).astype(np.int64) for of, in_group in zip(entities, chosen, strict=True)
        ]
        set_rows = sets.setdefault(name, [np.zeros(0, dtype=np.int64)] * len(blocks))
        sets[name] = [np.union1d(first, second) for first, second in zip(set_rows, group_rows, strict=True)]
    return meshio.Mesh(np.reshape(places, (-1, 3)), blocks, cell_sets=sets)


def _blocks(gmsh: Any, rows: Any) -> tuple[list[tuple[str, NDArray[np.int64]]], list[Any]]:
    """One block a type, in the order of the file, and for each element its entity's key and its row in the block.

    MSH 1 and 2 repeat an element for each of its groups: those of the same nodes are one.
    """
    parts_by_type: dict[str, list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]] = {}
    for dimension, entity in gmsh.model.getEntities():
        for kind, elements, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
            name = TYPES.get(int(kind))
            if name is None:
                raise ValueError(f"elements '{gmsh.model.mesh.getElementProperties(kind)[0]}' are not read")
            key = np.full(len(elements), dimension * 2**40 + entity)
            parts_by_type.setdefault(name, []).append(
                (elements.astype(np.int64), key, rows(nodes).reshape(len(elements), -1))
            )
    first: list[int] = []
    blocks, entities = [], []
    for name, parts in parts_by_type.items():
        number, key, cells = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.argsort(number, kind="stable")
        number, key, cells = number[order], key[order], cells[order]
        _, index, inverse = np.unique(np.sort(cells, axis=1), axis=0, return_index=True, return_inverse=True)
        place = np.argsort(np.argsort(index))  # cells stay in the order of the file
        blocks.append((name, cells[np.sort(index)]))
        entities.append((key, place[inverse.ravel()]))
        first.append(int(number[0]))
    by_file = np.argsort(first, kind="stable")
    return [blocks[at] for at in by_file], [entities[at] for at in by_file]
