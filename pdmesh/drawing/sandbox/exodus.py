"""Reads an Exodus II file as a meshio mesh: blocks, attributes of particles, node sets and side sets.

meshio reads neither attributes, where particles have their volumes, nor side sets. `load` imports netCDF4 before walls
are raised, `read` reads one file after that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]
SHAPES = {  # beginnings of Exodus' names: meshio's names by the number of nodes
    "SPHERE": {1: "vertex"},
    "CIRCLE": {1: "vertex"},
    "POINT": {1: "vertex"},
    "BAR": {2: "line", 3: "line3"},
    "BEAM": {2: "line", 3: "line3"},
    "TRUSS": {2: "line", 3: "line3"},
    "EDGE": {2: "line", 3: "line3"},
    "TRI": {3: "triangle", 6: "triangle6", 7: "triangle7"},
    "QUAD": {4: "quad", 8: "quad8", 9: "quad9"},
    "SHELL": {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"},
    "TET": {4: "tetra", 10: "tetra10"},
    "PYR": {5: "pyramid", 13: "pyramid13", 14: "pyramid14"},
    "WEDGE": {6: "wedge", 15: "wedge15", 18: "wedge18"},
    "HEX": {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"},
}
SIDES: dict[str, tuple[tuple[int, ...], ...]] = {  # corners of the sides, in the order in which Exodus numbers them
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "hexahedron": ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
}


def load() -> None:
    """Import netCDF4. Raises ModuleNotFoundError."""
    import netCDF4
    import netCDF4.utils  # noqa: F401


def read(path: Path) -> meshio.Mesh:
    """The mesh in a file. Raises ValueError for what is no Exodus file."""
    import netCDF4

    try:
        file = netCDF4.Dataset(str(path))
    except OSError:
        raise ValueError("this is no netCDF file; use an Exodus II file") from None
    with file:
        file.set_auto_mask(False)
        variables = file.variables
        if "coord" in variables:
            points = np.array(variables["coord"][:], dtype=float).T
        else:
            columns = [
                np.array(variables[f"coord{axis}"][:], dtype=float) for axis in "xyz" if f"coord{axis}" in variables
            ]
            if len(columns) < 2:
                raise ValueError("the file has no coordinates; use an Exodus II file")
            points = np.column_stack(columns)
        blocks, volumes, sets = _blocks(variables)
        for name, cells in _side_sets(variables, blocks).items():
            for kind, rows in cells.items():
                sets.setdefault(name, {})[len(blocks)] = np.arange(len(rows))
                blocks.append((kind, rows))
                volumes.append(np.full(len(rows), np.nan))
        named = {
            name: [members.get(number, np.zeros(0, dtype=np.int64)) for number in range(len(blocks))]
            for name, members in sets.items()
        }
        data = {"volume": volumes} if any(np.isfinite(block_volumes).any() for block_volumes in volumes) else {}
        node_sets = {
            name: np.array(variables[f"node_ns{number}"][:], dtype=np.int64) - 1
            for number, name in enumerate(_names(variables, "ns_names", "ns_prop1", "nodeset"), start=1)
            if f"node_ns{number}" in variables
        }
        return meshio.Mesh(points, blocks, cell_data=data, cell_sets=named, point_sets=node_sets)


def _blocks(variables: Any) -> tuple[list[Any], list[NDArray[np.float64]], dict[str, dict[int, Rows]]]:
    """Blocks of cells, the volumes of those that are particles, and the sets that the blocks are."""
    names = _names(variables, "eb_names", "eb_prop1", "block")
    blocks: list[Any] = []
    volumes: list[NDArray[np.float64]] = []
    sets: dict[str, dict[int, Rows]] = {}
    for number, name in enumerate(names, start=1):
        connect = variables.get(f"connect{number}")
        if connect is None:
            continue  # a block without elements
        cells = np.array(connect[:], dtype=np.int64) - 1
        word = str(connect.elem_type).strip("\0 ").upper()
        kind = next((types.get(cells.shape[1]) for prefix, types in SHAPES.items() if word.startswith(prefix)), None)
        if kind is None:
            raise ValueError(f"elements '{word}' of {cells.shape[1]} nodes are not read")
        sets.setdefault(name, {})[len(blocks)] = np.arange(len(cells))
        blocks.append((kind, cells))
        attribute = variables.get(f"attrib{number}") if kind == "vertex" else None
        block_volumes = np.full(len(cells), np.nan)
        if attribute is not None:  # volumes are the attribute of that name, or the last (behind the radius)
            values = np.array(attribute[:], dtype=float).reshape(len(cells), -1)
            labels = [label.lower() for label in _texts(variables.get(f"attrib_name{number}"))]
            at = next((place for place, label in enumerate(labels) if "vol" in label), values.shape[1] - 1)
            block_volumes = values[:, at]
        volumes.append(block_volumes)
    return blocks, volumes, sets


def _side_sets(variables: Any, blocks: list[Any]) -> dict[str, dict[str, Rows]]:
    """By name: the cells, one dimension lower, that the sides of a set are."""
    ends = np.cumsum([0, *(len(cells) for _, cells in blocks)])
    sets: dict[str, dict[str, Rows]] = {}
    for number, name in enumerate(_names(variables, "ss_names", "ss_prop1", "sideset"), start=1):
        if f"elem_ss{number}" not in variables:
            continue
        elements = np.array(variables[f"elem_ss{number}"][:], dtype=np.int64) - 1
        sides = np.array(variables[f"side_ss{number}"][:], dtype=np.int64)
        of_block = np.searchsorted(ends, elements, side="right") - 1
        cells: dict[str, list[Rows]] = {}
        for block, (kind, nodes) in enumerate(blocks):
            for side, corners in enumerate(SIDES.get(kind.rstrip("0123456789"), ()), start=1):
                element_rows = elements[(of_block == block) & (sides == side)] - ends[block]
                if len(element_rows):
                    cell_kind = {2: "line", 3: "triangle", 4: "quad"}[len(corners)]
                    cells.setdefault(cell_kind, []).append(nodes[element_rows][:, list(corners)])
        sets[name] = {kind: np.concatenate(node_rows) for kind, node_rows in cells.items()}
    return sets


def _names(variables: Any, names: str, numbers: str, kind: str) -> list[str]:
    """Names of the blocks or sets of a kind; "block_1" after its number where it has none."""
    if numbers not in variables:
        return []
    ids, texts = np.array(variables[numbers][:], dtype=np.int64), _texts(variables.get(names))
    texts += [""] * (len(ids) - len(texts))
    return [text or f"{kind}_{number}" for text, number in zip(texts, ids.tolist(), strict=False)]


def _texts(variable: Any) -> list[str]:
    if variable is None:
        return []
    return [b"".join(np.atleast_1d(row)).split(b"\0")[0].decode("latin-1").strip() for row in variable[:]]
