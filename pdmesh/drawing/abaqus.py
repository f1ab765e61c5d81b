"""Reads the mesh of an Abaqus input file: parts, their instances in the assembly, and sets at both levels.

Coordinates, elements, element and node sets and surfaces are read; what else the file says - materials, steps, loads -
is named in one remark. Keywords that would make further nodes or elements are refused.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.abaqus_keywords import keywords
from pdmesh.drawing.abaqus_model import Elements, Instance, Model, words
from pdmesh.drawing.abaqus_sets import Copy, Numbered, SetName, SetRows
from pdmesh.drawing.mesh_arrays import SIDES, Block, Mesh, Rows, unused
from pdmesh.scene.shapes import SceneError

NONE = np.zeros(0, dtype=np.int64)
SIDE = re.compile(r"[ESes][0-9]{1,2}")  # of an element: an edge or a face
OF_CORNERS = {2: "line", 3: "triangle", 4: "quad"}


def read_abaqus(path: Path, trust: bool = False) -> Mesh:
    """The mesh in the input file at `path`; `trust` also reads files it includes. Raises SceneError and OSError."""
    model = Model(path)
    for keyword in keywords(path, trust):
        model.take(keyword)
    placed = {instance.part for instance in model.instances.values()}
    idle = [part.name for key, part in model.parts.items() if key not in placed]
    if model.parts and not placed:
        raise SceneError(f"{path} has parts but no *INSTANCE of any; add an assembly")
    notes = unused("part", idle, "no instance in the assembly, not built")
    if model.unread:
        listed = ", ".join(f"*{name.capitalize()}" for name in model.unread)
        notes.append(f"not used: {listed} (values come from --set)")
    points: list[NDArray[np.float64]] = []
    every: list[tuple[Elements, Rows]] = []
    copies: list[Copy] = []
    for instance in [None, *model.instances.values()]:
        copies.append(_copied(model, instance, points, every))
    if not sum(map(len, points)):
        raise SceneError(f"{model.path} has no points; add *NODE")
    blocks = [Block(elements.type.cell, nodes) for elements, nodes in every]
    every_set = SetRows({copy.name.upper(): copy for copy in copies})
    element_sets, node_sets = _sets(every_set, "element_sets"), _sets(every_set, "node_sets")
    first = np.cumsum([0, *(len(block.data) for block in blocks)])
    surfaces = list(_surfaces(every_set, blocks, first))
    for _, side in surfaces:
        blocks.append(side)
    sets: dict[str, list[Rows]] = {}
    for name, rows in element_sets.items():
        ends = pairwise(np.searchsorted(rows, first).tolist())  # rows are in order, so each block has a part of them
        in_blocks = [rows[start:end] - low for (start, end), low in zip(ends, first[:-1], strict=True)]
        sets[name] = in_blocks + [NONE] * len(surfaces)
    for number, (name, side) in enumerate(surfaces, start=len(every)):
        sets.setdefault(name, [NONE] * len(blocks))[number] = np.arange(len(side.data))
    plane, more = _plane([elements for elements, _ in every])
    part = (
        np.repeat(np.arange(len(points)), [len(instance_points) for instance_points in points])
        if len(model.instances) > 1
        else None
    )
    mesh = Mesh(np.concatenate(points), tuple(blocks), sets, node_sets, plane=plane, notes=(*notes, *more))
    return replace(mesh, parts=part)


def _copied(
    model: Model, instance: Instance | None, points: list[NDArray[np.float64]], every: list[tuple[Elements, Rows]]
) -> Copy:
    """Append the points and elements of an instance, or of what belongs to none, to those of the mesh."""
    scopes = (model.root,) if instance is None else (model.parts[instance.part], instance.scope)
    ids = np.array([number for scope in scopes for number in scope.ids], dtype=np.int64)
    places = np.array([place for scope in scopes for place in scope.places], dtype=float).reshape(-1, 3)
    name = "" if instance is None else instance.name
    _, last = np.unique(ids[::-1], return_index=True)  # a node that is defined again is where it was put last
    chosen = len(ids) - 1 - last
    nodes = Numbered.of(ids[chosen], sum(map(len, points)) + np.arange(len(chosen)))
    points.append(places[chosen] if instance is None else instance.moved(places[chosen]))
    first, numbers = sum(len(rows) for _, rows in every), [NONE]
    for elements in (element_block for scope in scopes for element_block in scope.elements):
        rows, missing = nodes.find(elements.nodes.ravel())
        if len(missing):
            raise elements.keyword.error(f"*ELEMENT: {missing[0]} is not defined; define it, or correct the name")
        every.append((elements, rows.reshape(elements.nodes.shape)))
        numbers.append(elements.ids)
    element_ids = np.concatenate(numbers)
    unique_ids, count = np.unique(element_ids, return_counts=True)
    if count.max(initial=0) > 1:
        twice = f"*ELEMENT: element {unique_ids[count.argmax()]} is defined {count.max()} times; define it once"
        raise SceneError(f"{model.path}: {twice}")
    return Copy.of(name, scopes, nodes, Numbered.of(element_ids, first + np.arange(len(element_ids))))


def _sets(every: SetRows, kind: str) -> dict[str, Rows]:
    """Sets by name: of all instances together, "INSTANCE.SET" where several have one, and the instances themselves."""
    rows_by_name: dict[str, list[Rows]] = {}
    spelled: dict[str, str] = {}

    def add(name: str, rows: Rows) -> None:
        if not name.startswith("_"):  # those that Abaqus/CAE names itself
            rows_by_name.setdefault(spelled.setdefault(name.upper(), name), []).append(rows)

    instances = {key: copy for key, copy in every.copies.items() if key}
    count = Counter(name for copy in instances.values() for name in copy.sets[kind])
    for instance, copy in [*instances.items(), ("", every.copies[""])]:
        for name, members in copy.sets[kind].items():
            rows = every.named(SetName(instance, kind, name))
            add(members.name, rows)
            if instance and count[name] > 1:
                add(f"{copy.name}.{members.name}", rows)
    if len(instances) > 1:
        for copy in instances.values():
            add(copy.name, copy.numbers(kind).rows)
    return {name: np.unique(np.concatenate(rows)) for name, rows in rows_by_name.items()}


def _surfaces(every: SetRows, blocks: list[Block], first: Rows) -> Iterator[tuple[str, Block]]:
    """Surfaces as cells of one dimension less, by name; those without the side of an element have none."""
    for instance, copy in every.copies.items():
        for members in copy.sets["surfaces"].values():
            for keyword, line, text in members.entries:
                name, side = [*words(text), ""][:2]
                if not SIDE.fullmatch(side):
                    continue
                rows = every.of_entry(instance, (keyword, line, name))
                for number, block in enumerate(blocks):
                    block_rows = rows[(rows >= first[number]) & (rows < first[number + 1])] - first[number]
                    # the corners of the side of each cell: an edge of a face, a face of a solid
                    side_number = int(side[1:]) - 1
                    if block.dimension == 3:
                        sides = SIDES[block.shape]
                    else:
                        count = block.corners.shape[1]
                        sides = tuple((at, (at + 1) % count) for at in range(count)) if block.dimension == 2 else ()
                    corners = sides[side_number] if 0 <= side_number < len(sides) else ()
                    if len(block_rows) and corners:
                        yield members.name, Block(OF_CORNERS[len(corners)], block.data[block_rows][:, list(corners)])


def _plane(every: list[Elements]) -> tuple[str, list[str]]:
    """Plane stress or strain, if all elements agree, and remarks on what they say else."""

    def names(chosen: Callable[[Elements], bool]) -> str:
        return ", ".join(sorted({elements.keyword.options["TYPE"].upper() for elements in every if chosen(elements)}))

    kinds = {elements.type.kind for elements in every}
    notes = []
    if "axisymmetric" in kinds:
        types = names(lambda elements: elements.type.kind == "axisymmetric")
        notes.append(f"warning: {types}: axisymmetric elements, built as a plate: nothing holds around the axis")
    if "line" in kinds:
        count = sum(len(elements.ids) for elements in every if elements.type.kind == "line")
        notes.append(
            f"{count} elements {names(lambda elements: elements.type.kind == 'line')}: lines, which get no nodes"
        )
    if {"stress", "strain"} <= kinds and "space" not in kinds:
        notes.append(
            f"warning: {names(lambda elements: elements.type.kind == 'strain')}: plane strain, others plane stress"
        )
        return "", notes
    return next((kind for kind in ("stress", "strain") if kind in kinds), ""), notes
