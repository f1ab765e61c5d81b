"""Named sets of a mesh as groups of a drawing: by their own names, or by the parameters that are set for them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from pdmesh.drawing.parameters import MATERIAL, PREFIX

MOST_SAID = 4  # names of groups without effect that are listed
PLANE = f"{PREFIX}Material/{MATERIAL['plane']}"


def group_names(
    name: str, dimension: int, kinds: Mapping[str, tuple[Collection[int], str | None]], values: Iterable[str]
) -> list[str]:
    """The groups that a set of cells is: "load:top" as it is named, "top" where parameters below Loads/top are set."""
    if ":" in name:
        return [name]
    folders = {word.removeprefix(PREFIX).rpartition("/")[0] for word in values}
    return [
        f"{kind}:{name}"
        for kind, (dimensions, folder) in kinds.items()
        if kind != "zone" and folder and dimension in dimensions and f"{folder}/{name}" in folders
    ]


def unused(what: str, names: Collection[str], advice: str) -> list[str]:
    """One remark on sets that have no effect; `advice` has NAME where the first of their names belongs."""
    if not names:
        return []
    first, *_ = listed = list(names)
    shown = ", ".join(f"'{name}'" for name in listed[:MOST_SAID])
    more = f" and {len(listed) - MOST_SAID} more" if len(listed) > MOST_SAID else ""
    return [f"{what}{'s' * (len(listed) > 1)} {shown}{more}: {advice.replace('NAME', first)}"]


def with_plane(values: dict[str, Any], plane: str) -> tuple[dict[str, Any], list[str]]:
    """The values with plane stress or strain as the elements have it, and a remark on that."""
    plane_setting = values.get(PLANE)
    if not plane or (plane_setting is None and plane == "stress"):
        return values, []
    if plane_setting is not None:
        differs = f"warning: elements are of plane {plane}, {PLANE} is {plane_setting}, which counts"
        return values, [differs] if plane_setting != plane else []
    if any(name.startswith(f"{PREFIX}Material/") for name in values):
        return values | {PLANE: plane}, [f"plane {plane}, as the elements have it"]
    return values, [f"elements are of plane {plane}: --set Material/{MATERIAL['plane']}={plane} with the material"]
