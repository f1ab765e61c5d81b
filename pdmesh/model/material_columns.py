"""Many materials as arrays: what differs from one to the next is a column, the rest is one material.

Functions of a `Material` whose arithmetic is elementwise then take the constants of many bonds at once: `at` returns a
material whose numbers are arrays. A plate with a material for each node costs as much as one with a single material.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material


class MaterialGroup(NamedTuple):
    """Materials that differ in numbers alone."""

    first: Material
    columns: dict[str, NDArray[np.float64]]  # (k,) of all materials; those outside the group have NaN

    def at(self, numbers: NDArray[np.int64]) -> Material:
        """The material whose numbers that differ are arrays (b,): those of the materials with these numbers (b,)."""
        if not self.columns:
            return self.first
        material = copy.copy(self.first)
        for name, column in self.columns.items():
            msgspec.structs.force_setattr(material, name, column[numbers])
        return material


class MaterialColumns:
    """Materials as a few groups of arrays."""

    def __init__(self, materials: Sequence[Material]) -> None:
        """Group `materials` by their words, switches and missing numbers."""
        columns = zip(
            Material.__struct_fields__, zip(*map(msgspec.structs.astuple, materials), strict=True), strict=True
        )
        differing = {name: column for name, column in columns if column.count(column[0]) < len(column)}
        words = (
            [None if isinstance(value, float | int) and not isinstance(value, bool) else (value,) for value in column]
            for column in differing.values()
        )
        keys, numbers = [*zip(*words, strict=True)] or [()] * len(materials), dict[tuple[Any, ...], int]()
        self._group_of = np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)
        self._groups = []
        for number in range(len(numbers)):
            members = np.flatnonzero(self._group_of == number)
            numeric = {}
            for name, values in differing.items():
                member_values = [values[member] for member in members]
                if member_values.count(member_values[0]) < len(member_values):
                    numeric[name] = np.full(len(values), np.nan)
                    numeric[name][members] = member_values
            self._groups.append(MaterialGroup(materials[members[0]], numeric))

    def of(self, numbers: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64] | slice, Material]]:
        """The places in `numbers` (b,) of each group's materials, and the material whose numbers are theirs."""
        if len(self._groups) == 1:
            yield slice(None), self._groups[0].at(numbers)
            return
        group_of = self._group_of[numbers]
        for number, group in enumerate(self._groups):
            places = np.flatnonzero(group_of == number)
            if len(places):
                yield places, group.at(numbers[places])
