"""The physical groups of a drawing as Gmsh has them, with a zone where no group names one; Gmsh's module is an
argument."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from typing import Any

ZONE, BODY = "zone:", "body:"
SHAPES = ("point", "curve", "surface", "volume")
TURNED = re.compile(r"^Warning: \w+ -( BOPAlgo_AlertUnableToOrientTheShape)+ *$")
GROUP = re.compile(rf"^Warning: .* in physical ({'|'.join(SHAPES)}) (\d+)$")  # that has a shape that is not there
DEFAULT = {2: "plate", 3: "body"}  # names of a zone that neither a group nor a parameter names


def dimension_of(gmsh: Any) -> int:
    """3 for a body, 2 for a plate: the dimension of the zones or, where no group names one, of the shapes."""
    zones = {group[0] for group in gmsh.model.getPhysicalGroups() if gmsh.model.getPhysicalName(*group)[:5] == ZONE}
    shapes = {dimension for dimension, _ in gmsh.model.getEntities()}
    return 3 if 3 in (zones & {2, 3} or shapes) else 2


def add_zones(gmsh: Any, dimension: int, names: Iterable[str], bodies: Collection[str] = ()) -> list[dict[str, Any]]:
    """Make groups without a kind the zones that parameters name; if there is no zone, all groups without a kind are
    one, or all shapes.

    `names` and `bodies` are those of the parameters of zones and of bodies beside them, which no zone contains. Returns
    each new zone: its name, and the numbers of the groups it is made of, none if it is made of all shapes.
    """
    groups = {
        number: gmsh.model.getPhysicalName(dimension, number) for _, number in gmsh.model.getPhysicalGroups(dimension)
    }

    def shapes(numbers: Iterable[int]) -> set[int]:
        return {int(tag) for number in numbers for tag in gmsh.model.getEntitiesForPhysicalGroup(dimension, number)}

    zones = {name.removeprefix(ZONE) for name in groups.values() if name.startswith(ZONE)}
    body_groups = {number for number, name in groups.items() if name.startswith(BODY) or name in bodies}
    plain = {number: name for number, name in groups.items() if ":" not in name and number not in body_groups}
    wanted = sorted(set(names) - zones)
    parts = {name: [number for number, group_name in plain.items() if group_name == name] for name in wanted}
    new = {name: numbers for name, numbers in parts.items() if numbers}
    others = [name for name in wanted if name not in new] or [DEFAULT[dimension]]
    if not zones and not new and len(others) == 1:
        new = {others[0]: list(plain)}
    every = {tag for _, tag in gmsh.model.getEntities(dimension)} - shapes(body_groups)
    for name, numbers in new.items():
        if tags := shapes(numbers) or every:
            gmsh.model.addPhysicalGroup(dimension, sorted(tags), name=ZONE + name)
    return [{"name": name, "groups": numbers} for name, numbers in new.items()]


def with_names(gmsh: Any, messages: Iterable[str]) -> tuple[list[str], list[str]]:
    """Messages of Gmsh, those about a group with its name; those about a group without a kind in its name, and about
    faces of Boolean operations that have no one side, apart."""
    others: list[str] = []
    ours: list[str] = []
    for message in messages:
        group = GROUP.match(message)
        name = gmsh.model.getPhysicalName(SHAPES.index(group[1]), int(group[2])) if group else ""
        of_others = group is not None and ":" not in name
        (others if of_others or TURNED.match(message) else ours).append(f'{message} ("{name}")' if name else message)
    return ours, others
