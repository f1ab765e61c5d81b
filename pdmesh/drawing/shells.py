"""Triangles of Gmsh as shells and sheets, and whether they are the surfaces of its volumes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pdmesh.model.triangulated_surface import gap, orientation, volume
from pdmesh.scene.solids import Sheet, Shell

EXACT = 1e-3  # relative: a volume of Gmsh this near to that of curved triangles is right
ROUND_OFF = 1e-9  # relative, of volumes


def shell_of(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> Shell:
    """The shell of a group of volumes.

    Its volume is that of Gmsh. Where Gmsh has none, or another than its own curved triangles, it is theirs.
    """
    triangles, volume_of_gmsh = sheet_of(geometry, group).triangles, float(group["volume"])
    if group.get("cones"):
        curved = float(orientation(triangles) @ np.array(group["cones"]))
        return Shell(triangles, volume_of_gmsh if abs(volume_of_gmsh - curved) <= EXACT * abs(curved) else curved)
    return Shell(triangles, volume_of_gmsh or volume(triangles))


def sheet_of(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> Sheet:
    """The triangles of a group of surfaces or volumes."""
    points = np.array(geometry["points"], dtype=float).reshape(-1, 3)
    return Sheet(points[np.array(group["triangles"], dtype=np.int64).reshape(-1, 3)])


def closes(geometry: Mapping[str, Any]) -> bool:
    """Whether triangles close around all volumes."""
    return all(gap(sheet_of(geometry, group).triangles) is None for group in _volumes(geometry))


def fits(geometry: Mapping[str, Any]) -> bool:
    """Whether triangles close around all volumes, and enclose what Gmsh says that they do."""
    return closes(geometry) and all(_agrees(geometry, group) for group in _volumes(geometry))


def with_own_volumes(geometry: Mapping[str, Any]) -> dict[str, Any]:
    """Triangles whose groups have no volume of Gmsh where the triangles enclose a different one."""
    *groups, zone_union = (
        group | ({} if group["dimension"] != 3 or _agrees(geometry, group) else {"volume": 0.0})
        for group in [*geometry["groups"], geometry["whole"]]
    )
    return {**geometry, "groups": groups, "whole": zone_union}


def _volumes(geometry: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [group for group in [*geometry["groups"], geometry["whole"]] if group["dimension"] == 3]


def _agrees(geometry: Mapping[str, Any], group: Mapping[str, Any]) -> bool:
    sheet, group_volume = sheet_of(geometry, group), float(group["volume"])
    if group["cones"] or not group_volume:
        return True
    return bool(
        abs(group_volume - volume(sheet.triangles)) <= geometry["tolerance"] * sheet.area + ROUND_OFF * group_volume
    )
