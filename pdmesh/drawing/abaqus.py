"""Reads the mesh of an Abaqus input file: parts, their instances in the assembly, and sets at both levels.

Coordinates, elements, element and node sets and surfaces are read; what else the file says - materials, steps, loads -
is named in one remark. Keywords that would make further nodes or elements are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.abaqus_keywords import Keyword, keywords
from pdmesh.drawing.abaqus_model import Elements, Instance, Members, Model, Scope
from pdmesh.drawing.mesh_arrays import SIDES, Block, Mesh, Rows
from pdmesh.drawing.mesh_groups import unused
from pdmesh.scene.shapes import SceneError

NONE = np.zeros(0, dtype=np.int64)
OF_CORNERS = {2: "line", 3: "triangle", 4: "quad"}


class Numbered(NamedTuple):
    """Numbers of a scope, in order, and the rows that they are in the mesh."""

    ids: Rows
    rows: Rows

    @classmethod
    def of(cls, ids: Rows, rows: Rows) -> Numbered:
        """Numbers in any order."""
        order = np.argsort(ids, kind="stable")
        return cls(ids[order], rows[order])

    def find(self, ids: Rows) -> tuple[Rows, Rows]:
        """The rows of these numbers, and those of them that are not there."""
        at = np.minimum(np.searchsorted(self.ids, ids), max(len(self.ids) - 1, 0))
        there = self.ids[at] == ids if len(self.ids) else np.zeros(len(ids), dtype=bool)
        return self.rows[at[there]], ids[~there]

    def among(self, some: range) -> Rows:
        """The rows of those numbers that are in a range."""
        low, high = min(some[0], some[-1]), max(some[0], some[-1])
        inside = (self.ids >= low) & (self.ids <= high)
        return np.asarray(self.rows[inside][(self.ids[inside] - low) % abs(some.step) == 0])


class Copy(NamedTuple):
    """An instance, or a file without parts: what it defines, and where that is in the mesh."""

    name: str
    scopes: tuple[Scope, ...]
    nodes: Numbered
    elements: Numbered

    def numbers(self, kind: str) -> Numbered:
        """Numbers and rows of the nodes, or of the elements, that sets of this kind have."""
        return self.nodes if kind == "node_sets" else self.elements

    def members(self, kind: str) -> dict[str, Members]:
        """The sets of a kind, by their names in capitals."""
        return {key: one for scope in self.scopes for key, one in getattr(scope, kind).items()}

    def rows(self, kind: str, members: Members, within: tuple[str, ...] = ()) -> Rows:
        """The rows of a set. Raises SceneError for a member that is not there."""
        numbers, known = self.numbers(kind), self.members(kind)
        found = [numbers.find(np.concatenate([NONE, *members.numbers]))[0]]
        found += [numbers.among(some) for _, _, some in members.ranges]
        own = [entry for entry in members.entries if entry[2].lstrip("+-").isdigit()]
        rows, missing = numbers.find(np.array([int(entry[2]) for entry in own], dtype=np.int64))
        if len(missing):
            keyword, line, _ = next(entry for entry in own if int(entry[2]) == missing[0])
            raise keyword.error(f"*{keyword.name}: found {missing[0]}, which is defined nowhere", line)
        for keyword, line, word in members.entries:
            if word.lstrip("+-").isdigit():
                continue
            other = known.get(word.upper())
            if other is None or word.upper() in within:
                raise keyword.error(f"*{keyword.name}: found '{word}', which is defined nowhere", line)
            found.append(self.rows(kind, other, (*within, word.upper())))
        return np.unique(np.concatenate([rows, *found]))


def read_abaqus(path: Path, trust: bool = False) -> Mesh:
    """The mesh in the input file at `path`; `trust` also reads files it includes. Raises SceneError and OSError."""
    model = Model(path)
    for keyword in keywords(path, trust):
        model.take(keyword)
    return _mesh(model, _remarks(model))


def _remarks(model: Model) -> tuple[str, ...]:
    placed = {instance.part for instance in model.instances.values()}
    idle = [part.name for key, part in model.parts.items() if key not in placed]
    if model.parts and not placed:
        raise SceneError(f"{model.path}: found parts and no *INSTANCE of any, expected an assembly")
    notes = unused("part", idle, "no instance in the assembly, not built")
    return (*notes, *_unread(model.unread))


def _unread(names: Iterable[str]) -> list[str]:
    listed = [f"*{name.capitalize()}" for name in names]
    return [f"not used: {', '.join(listed)} (values come from --set)"] if listed else []


def _mesh(model: Model, notes: tuple[str, ...]) -> Mesh:
    """The mesh of all that is in the assembly. Raises SceneError."""
    points: list[NDArray[np.float64]] = []
    every: list[tuple[Elements, Rows]] = []
    copies: list[Copy] = []
    for instance in [None, *model.instances.values()]:
        copies.append(_copied(model, instance, points, every))
    if not sum(map(len, points)):
        raise SceneError(f"{model.path}: found no points, expected *NODE")
    blocks = [Block(elements.type.cell, nodes) for elements, nodes in every]
    element_sets, node_sets = _sets(model, copies, "element_sets"), _sets(model, copies, "node_sets")
    first = np.cumsum([0, *(len(block.data) for block in blocks)])
    surfaces = list(_surfaces(model, copies, blocks, first))
    for _, side in surfaces:
        blocks.append(side)
    sets = {
        name: [rows[(rows >= low) & (rows < high)] - low for low, high in pairwise(first)] + [NONE] * len(surfaces)
        for name, rows in element_sets.items()
    }
    for number, (name, side) in enumerate(surfaces, start=len(every)):
        sets.setdefault(name, [NONE] * len(blocks))[number] = np.arange(len(side.data))
    plane, more = _plane([elements for elements, _ in every])
    part = np.repeat(np.arange(len(points)), [len(some) for some in points]) if len(model.instances) > 1 else None
    mesh = Mesh(np.concatenate(points), tuple(blocks), sets, node_sets, plane=plane, notes=(*notes, *more))
    return replace(mesh, parts=part)


def _copied(
    model: Model, instance: Instance | None, points: list[NDArray[np.float64]], every: list[tuple[Elements, Rows]]
) -> Copy:
    """Append the points and elements of an instance, or of what belongs to none, to those of the mesh."""
    scopes = (model.root,) if instance is None else (model.parts[instance.part], instance.own)
    ids = np.array([number for scope in scopes for number in scope.ids], dtype=np.int64)
    places = np.array([place for scope in scopes for place in scope.places], dtype=float).reshape(-1, 3)
    if not np.isfinite(places).all():
        raise SceneError(f"{model.path}: points: found a coordinate that is not finite, expected metres")
    name = "" if instance is None else instance.name
    _, last = np.unique(ids[::-1], return_index=True)  # a node that is defined again is where it was put last
    chosen = len(ids) - 1 - last
    nodes = Numbered.of(ids[chosen], sum(map(len, points)) + np.arange(len(chosen)))
    points.append(places[chosen] if instance is None else instance.moved(places[chosen]))
    first, numbers = sum(len(rows) for _, rows in every), [NONE]
    for elements in (one for scope in scopes for one in scope.elements):
        rows, missing = nodes.find(elements.nodes.ravel())
        if len(missing):
            raise elements.keyword.error(f"*ELEMENT: found {missing[0]}, which is defined nowhere")
        every.append((elements, rows.reshape(elements.nodes.shape)))
        numbers.append(elements.ids)
    own = np.concatenate(numbers)
    known, count = np.unique(own, return_counts=True)
    if count.max(initial=0) > 1:
        twice = f"*ELEMENT: found element {known[count.argmax()]} {count.max()} times, expected once"
        raise SceneError(f"{model.path}: {twice}")
    return Copy(name, scopes, nodes, Numbered.of(own, first + np.arange(len(own))))


def _sets(model: Model, copies: list[Copy], kind: str) -> dict[str, Rows]:
    """Sets by name: of all instances together, "INSTANCE.SET" where several have one, and the instances themselves."""
    found: dict[str, list[Rows]] = {}
    spelled: dict[str, str] = {}

    def add(name: str, rows: Rows) -> None:
        if not name.startswith("_"):  # those that Abaqus/CAE names itself
            found.setdefault(spelled.setdefault(name.upper(), name), []).append(rows)

    instances = [copy for copy in copies if copy.name]
    of_copy = [(copy, key, members) for copy in instances for key, members in copy.members(kind).items()]
    several = {key for at, (_, key, _) in enumerate(of_copy) if key in {other for _, other, _ in of_copy[:at]}}
    for copy, key, members in of_copy:
        rows = copy.rows(kind, members)
        add(members.name, rows)
        if key in several:
            add(f"{copy.name}.{members.name}", rows)
    for members in getattr(model.root, kind).values():
        add(members.name, _of_assembly(copies, kind, members, (members.name.upper(),)))
    if len(instances) > 1:
        for copy in instances:
            add(copy.name, copy.numbers(kind).rows)
    return {name: np.unique(np.concatenate(rows)) for name, rows in found.items()}


def _of_assembly(copies: list[Copy], kind: str, members: Members, within: tuple[str, ...] = ()) -> Rows:
    """The rows of a set of the assembly: members of instances, by INSTANCE= or "INSTANCE.NAME", and of other sets."""
    by_name = {copy.name.upper(): copy for copy in copies}
    known, entries = copies[0].members(kind), dict[str, list[tuple[Keyword, int, str]]]()
    found = [copies[0].rows(kind, Members("", [], members.numbers))]
    for keyword, line, some in members.ranges:
        found.append(_instance(by_name, keyword, line).numbers(kind).among(some))
    for keyword, line, word in members.entries:
        instance, name = keyword.options.get("INSTANCE", "").upper(), word
        before, dot, behind = word.partition(".")
        if not instance and dot and before.upper() in by_name:
            instance, name = before.upper(), behind
        _instance(by_name, keyword, line)
        if not instance and word.upper() in known and word.upper() not in within:
            found.append(_of_assembly(copies, kind, known[word.upper()], (*within, word.upper())))
        elif not instance and word.upper() in within:
            raise keyword.error(f"*{keyword.name}: found '{word}', which is defined by itself", line)
        else:
            entries.setdefault(instance, []).append((keyword, line, name))
    found += [by_name[instance].rows(kind, Members("", some)) for instance, some in entries.items()]
    return np.unique(np.concatenate(found))


def _instance(by_name: Mapping[str, Copy], keyword: Keyword, line: int) -> Copy:
    """The instance that a keyword names, or what belongs to none. Raises SceneError."""
    instance = keyword.options.get("INSTANCE", "").upper()
    if instance not in by_name:
        raise keyword.error(f"*{keyword.name}: found INSTANCE={instance}, which is defined nowhere", line)
    return by_name[instance]


def _surfaces(model: Model, copies: list[Copy], blocks: list[Block], first: Rows) -> Iterator[tuple[str, Block]]:
    """Surfaces as cells of one dimension less, by name; those without the side of an element have none."""
    for copy in copies:
        for members in copy.members("surfaces").values():
            for keyword, line, text in members.entries:
                name, side = ([word.strip() for word in text.split(",")] + [""])[:2]
                if not (side[:1].upper() in "SE" and side[1:].isdigit()):
                    continue
                entry = Members("", [(keyword, line, name)])
                rows = (
                    _of_assembly(copies, "element_sets", entry) if not copy.name else copy.rows("element_sets", entry)
                )
                for number, block in enumerate(blocks):
                    some = rows[(rows >= first[number]) & (rows < first[number + 1])] - first[number]
                    corners = _side(block, int(side[1:]) - 1)
                    if len(some) and corners:
                        yield members.name, Block(OF_CORNERS[len(corners)], block.data[some][:, list(corners)])


def _side(block: Block, number: int) -> tuple[int, ...]:
    """The corners of a side of the cells of a block, an edge or a face; none if there is no such side."""
    if block.dimension == 3:
        sides = SIDES[block.shape]
    else:
        count = block.corners.shape[1]
        sides = tuple((at, (at + 1) % count) for at in range(count)) if block.dimension == 2 else ()
    return sides[number] if 0 <= number < len(sides) else ()


def _plane(every: list[Elements]) -> tuple[str, list[str]]:
    """Plane stress or strain, if all elements agree, and remarks on what they say else."""

    def names(chosen: Callable[[Elements], bool]) -> str:
        return ", ".join(sorted({one.keyword.options["TYPE"].upper() for one in every if chosen(one)}))

    kinds = {one.type.kind for one in every}
    notes = []
    if "axisymmetric" in kinds:
        types = names(lambda one: one.type.kind == "axisymmetric")
        notes.append(f"warning: {types}: axisymmetric elements, built as a plate: nothing holds around the axis")
    if "line" in kinds:
        count = sum(len(one.ids) for one in every if one.type.kind == "line")
        notes.append(f"{count} elements {names(lambda one: one.type.kind == 'line')}: lines, which get no nodes")
    if {"stress", "strain"} <= kinds and "space" not in kinds:
        notes.append(f"warning: {names(lambda one: one.type.kind == 'strain')}: plane strain, others plane stress")
        return "", notes
    return next((kind for kind in ("stress", "strain") if kind in kinds), ""), notes
