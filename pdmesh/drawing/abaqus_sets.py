"""Rows of the mesh that sets of an Abaqus file have: of its instances, and of the assembly or a file without parts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.abaqus_keywords import Keyword
from pdmesh.drawing.abaqus_model import Members, Scope
from pdmesh.drawing.mesh_arrays import Rows

NUMBER = re.compile(r"[+-]*[0-9]+")
Entry = tuple[Keyword, int, str]  # keyword, line, number or name


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
        present = self.ids[at] == ids if len(self.ids) else np.zeros(len(ids), dtype=bool)
        return self.rows[at[present]], ids[~present]

    def mark(self, id_range: range, inside: NDArray[np.bool_]) -> None:
        """Mark those numbers that are in a range."""
        low, high = min(id_range[0], id_range[-1]), max(id_range[0], id_range[-1])
        first, end = np.searchsorted(self.ids, np.array([low, high + 1])).tolist()
        step = abs(id_range.step)
        inside[first:end] |= (self.ids[first:end] - low) % step == 0 if step > 1 else True


class Copy(NamedTuple):
    """An instance, or a file without parts: what it defines, and where that is in the mesh."""

    name: str
    nodes: Numbered
    elements: Numbered
    sets: Mapping[str, Mapping[str, Members]]  # by kind and by name in capitals

    @classmethod
    def of(cls, name: str, scopes: tuple[Scope, ...], nodes: Numbered, elements: Numbered) -> Copy:
        """What scopes define together; a set of a later one replaces that of its name in an earlier one."""
        kinds = ("element_sets", "node_sets", "surfaces")
        sets = {
            kind: {key: members for scope in scopes for key, members in getattr(scope, kind).items()} for kind in kinds
        }
        return cls(name, nodes, elements, sets)

    def numbers(self, kind: str) -> Numbered:
        """Numbers and rows of the nodes, or of the elements, that sets of this kind have."""
        return self.nodes if kind == "node_sets" else self.elements


class SetName(NamedTuple):
    """The name of a set in capitals, and the instance that defines it: "" for the assembly or a file without parts."""

    instance: str
    kind: str
    name: str


@dataclass
class _Resolution:
    """A set whose rows are looked for: its own rows, and the sets that it names, with the entries that name them."""

    direct_rows: list[Rows]
    others: dict[SetName, Entry]
    waiting: Iterator[SetName]


@dataclass
class SetRows:
    """Rows of the sets of a mesh, each computed once."""

    copies: Mapping[str, Copy]  # by name in capitals; "" is what belongs to no instance
    rows_by_set: dict[SetName, Rows] = field(default_factory=dict)

    def named(self, wanted: SetName) -> Rows:
        """The rows of a set of this name. Raises SceneError for a member that is not there, or for a set in itself."""
        if wanted not in self.rows_by_set:
            # without recursion, as chains of names may be long
            begun = {wanted: self._begin(wanted, self.copies[wanted.instance].sets[wanted.kind][wanted.name])}
            while begun:
                name, resolution = next(reversed(begun.items()))
                reference = next(
                    (reference for reference in resolution.waiting if reference not in self.rows_by_set), None
                )
                if reference is None:
                    self.rows_by_set[name] = _union(
                        resolution.direct_rows, [self.rows_by_set[reference] for reference in resolution.others]
                    )
                    del begun[name]
                elif reference in begun:
                    keyword, line, word = resolution.others[reference]
                    raise keyword.error(f"*{keyword.name}: '{word}' is defined by itself; list its members", line)
                else:
                    begun[reference] = self._begin(
                        reference, self.copies[reference.instance].sets[reference.kind][reference.name]
                    )
        return self.rows_by_set[wanted]

    def of_entry(self, instance: str, entry: Entry) -> Rows:
        """The rows of one element, by its number, or of a set of them, on a line of data. Raises SceneError."""
        direct_rows, others = self._parts(SetName(instance, "element_sets", ""), Members("", [entry]))
        return _union(direct_rows, [self.named(set_name) for set_name in others])

    def _begin(self, name: SetName, members: Members) -> _Resolution:
        direct_rows, others = self._parts(name, members)
        return _Resolution(direct_rows, others, iter(others))

    def _parts(self, of: SetName, members: Members) -> tuple[list[Rows], dict[SetName, Entry]]:
        """The rows that a set has by numbers, and the sets that it names. Raises SceneError."""
        numbers: dict[str, list[tuple[Entry, int]]] = {}
        others: dict[SetName, Entry] = {}
        for entry in members.entries:
            keyword, line, word = entry
            instance = of.instance
            if not instance:  # it is by INSTANCE=, or before the dot of "INSTANCE.NAME"
                instance = self._instance(keyword, line)
                before, dot, member = word.partition(".")
                if not instance and dot and before and before.upper() in self.copies:
                    instance, word = before.upper(), member
            name = SetName(instance, of.kind, word.upper())
            if NUMBER.fullmatch(word):
                numbers.setdefault(instance, []).append((entry, keyword.integer(line, word)))
            elif name.name in self.copies[instance].sets[of.kind]:
                others.setdefault(name, entry)
            else:
                raise keyword.error(f"*{keyword.name}: '{word}' is not defined; define it, or correct the name", line)
        return [*self._rows(of, members, numbers)], others

    def _rows(self, of: SetName, members: Members, numbers: dict[str, list[tuple[Entry, int]]]) -> Iterator[Rows]:
        numbering = self.copies[of.instance].numbers(of.kind)
        yield numbering.find(np.concatenate([np.zeros(0, dtype=np.int64), *members.numbers]))[0]
        for instance, entries in numbers.items():
            rows, missing = self.copies[instance].numbers(of.kind).find(np.array([number for _, number in entries]))
            for (keyword, line, word), number in entries if len(missing) else ():
                if number == missing[0]:
                    raise keyword.error(f"*{keyword.name}: {word} is not defined; define it, or correct the name", line)
            yield rows
        ranges: dict[str, list[range]] = {}
        for keyword, line, some_numbers in members.ranges:
            ranges.setdefault(of.instance or self._instance(keyword, line), []).append(some_numbers)
        for instance, every in ranges.items():
            all_numbers = self.copies[instance].numbers(of.kind)
            inside = np.zeros(len(all_numbers.ids), dtype=bool)  # whatever else the ranges have
            for id_range in every:
                all_numbers.mark(id_range, inside)
            yield all_numbers.rows[inside]

    def _instance(self, keyword: Keyword, line: int) -> str:
        """The instance that a keyword names, "" for none. Raises SceneError."""
        instance = keyword.options.get("INSTANCE", "").upper()
        if instance not in self.copies:
            raise keyword.error(
                f"*{keyword.name}: INSTANCE={instance} is not defined; define it, or correct the name", line
            )
        return instance


def _union(direct_rows: list[Rows], named: list[Rows]) -> Rows:
    """The rows of a set in order: its own ones and those of the sets that it names."""
    if len(named) == 1 and not any(map(len, direct_rows)):
        return named[0]
    return np.unique(np.concatenate([*direct_rows, *named]))
