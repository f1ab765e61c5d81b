"""Strength of zones of different spacings, for `pdmesh info` and `plan`, and a warning where coarse zones are loaded.

Bonds that cost the fracture energy break at a stretch that falls with the square root of their horizon, so that a zone
of twice the spacing has 0.71 of the strength. An even load breaks it first, along its border with the finer zone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model import cohesive_softening, node_arrays, selection
from pdmesh.model.document import (
    Acceleration,
    Displacement,
    InitialVelocity,
    Load,
    Material,
    Settings,
    Velocity,
)
from pdmesh.model.lattice_calibration import along_axes, calibration, has_partial_cells, lattice_ratios
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.node_grid import Grid
from pdmesh.model.orthotropic import ORTHOTROPIC
from pdmesh.model.suggestions import called

SAME = 1e-6  # relative: spacings this close are one
MOST = 16  # spacings that are shown one by one; of more, the finest and the coarsest


class ZoneStrength(NamedTuple):
    """Strength of the bonds of one spacing in even tension along an axis."""

    body: str | None  # its name, where there are several
    spacing: float  # m
    finest: float  # m, that of the finest zone of its body
    share: float  # of the strength of that zone; infinite where bonds do not break
    critical_stretch: float | None  # of brittle bonds
    strength: float | None  # Pa, the stress at which the first bonds break or, of softening ones, at the peak; of plies
    # along the fibres
    strength_across: float | None = None  # Pa, of plies across the fibres
    shear_strength: float | None = None  # Pa, of plies in shear along the fibres


def zone_strengths(grid: Grid, settings: Settings, mode: str) -> list[ZoneStrength]:
    """Strengths of each body that is not rigid at all of its spacings, from fine to coarse, of the material of most of
    its nodes; none of bodies without bonds that break."""
    if settings.material is None:
        return []
    materials = settings.material, *(region.material for region in settings.regions)
    number = selection.last_selecting(settings.regions, grid) if settings.regions else None
    zones: list[ZoneStrength] = []
    for at, finest in enumerate(grid.finest_spacings):
        if grid.bodies is not None and (at in grid.bodies.rigid or finest == np.inf):
            continue
        where: Any = slice(None) if grid.bodies is None else grid.bodies.number == at
        material = materials[0 if number is None else int(np.bincount(number[where]).argmax())]
        if material.failure == "none":
            continue
        if grid.dimension == 3:
            material = msgspec.structs.replace(material, plane="space")
        body = None if grid.bodies is None else grid.bodies.names[at]
        spacings = np.unique(np.round(grid.delta[where] if any(grid.delta.strides) else grid.delta[:1], 15))
        for spacing in spacings if len(spacings) <= MOST else spacings[[0, -1]]:
            strength = _strength(material, settings.horizon.ratio, float(spacing), float(finest), mode == "thesis")
            of_ply = (material.strength_across, material.shear_strength) if material.solid == ORTHOTROPIC else ()
            zones.append(ZoneStrength(body, float(spacing), float(finest), *strength, *of_ply))
    return zones


def weakest_zones(grid: Grid, settings: Settings) -> list[ZoneStrength]:
    """The weakest zone of each body whose zones differ in strength."""
    if settings.run.adapt != "none" or not any(grid.delta.strides):
        return []
    weakest: dict[str | None, ZoneStrength] = {}
    for zone in zone_strengths(grid, settings, "conservative"):
        if zone.share < min(1 - SAME, weakest[zone.body].share if zone.body in weakest else np.inf):
            weakest[zone.body] = zone
    return list(weakest.values())


def _strength(
    material: Material, ratio: float, spacing: float, finest: float, one_sided: bool
) -> tuple[float, float | None, float | None]:
    """Share of the strength at the finest spacing, critical stretch and strength, Pa; see `ZoneStrength`."""
    if material.coarse == "unbreakable" and spacing > finest * (1 + SAME):
        return np.inf, None, None
    reference_spacing = finest if material.coarse == "matched" else spacing
    if material.law == "cohesive" or material.failure == "stress":
        return 1.0, None, (material.f_t if material.law == "cohesive" else material.strength)
    share = float(np.sqrt(finest / reference_spacing))
    partial = has_partial_cells(material)
    if material.model != "bond" or not lattice_ratios(ratio, material.micromodulus, material.plane, partial).c11 > 0:
        return share, None, None
    critical = float(critical_stretch(material, np.array([ratio * reference_spacing]))[0])
    critical *= 1.0 if one_sided else calibration(ratio, material, partial).stretch
    if material.law == "bilinear" and material.kr > 1:
        return share, None, cohesive_softening.strength_of_peak(material, ratio, ratio * reference_spacing)
    return share, critical, critical * material.E * along_axes(material, ratio, one_sided).young


def lines(zones: list[dict[str, Any]]) -> list[str]:
    """The strengths of a model's zones in one line; none without zones."""
    words = []
    for zone in zones:
        body, spacing, _, share, critical, strength, across, shear = zone.values()
        if share is None:
            words.append(f"no breaking bonds at {spacing:g} m{of_body(body)}")
            continue
        said = [
            _with_directions(strength, across, shear) if strength is not None else "",
            f"critical stretch {critical:.4g}" if critical is not None else "",
            f"{share:.3g} of the finest zone's" if share != 1 or strength is None else "",
        ]
        more = ", ".join(filter(None, said[1:]))
        words.append(f"{said[0]} at {spacing:g} m{of_body(body)}".strip() + (f" ({more})" if more else ""))
    return ["strength: " + "; ".join(words)] if zones else []


def _with_directions(strength: float, across: float | None, shear: float | None) -> str:
    """A strength, Pa; of a ply that along the fibres, across them and in shear."""
    if across is None or shear is None:
        return f"{strength:.4g} Pa"
    return f"{strength:.4g} Pa along the fibres, {across:.4g} Pa across them, {shear:.4g} Pa in shear"


def described(zones: list[ZoneStrength]) -> list[dict[str, Any]]:
    """Strengths for JSON, which has no infinite numbers."""
    return [zone._asdict() | {"share": zone.share if np.isfinite(zone.share) else None} for zone in zones]


def remarks(grid: Grid, settings: Settings) -> Iterator[str]:
    """A warning for each body of loads and motions on zones that are weaker than its finest one."""
    for weakest in weakest_zones(grid, settings):
        coarse = coarse_nodes(grid, weakest)
        acting = [
            f"'{called(condition.name, number)}'"
            for number, condition in enumerate(settings.conditions)
            if _pulls(condition) and coarse[node_arrays.selected(grid, condition.nodes, condition.box)].any()
        ]
        if acting:
            verb = "acts" if len(acting) == 1 else "act"
            yield (
                f"nodes of {weakest.spacing:g} m{of_body(weakest.body)} have {weakest.share:.2g} of the strength of"
                f" those of {weakest.finest:g} m, as the critical stretch falls with the square root of the horizon,"
                f" and {', '.join(acting)} {verb} on coarse nodes: cracks may start there or follow the"
                ' border of the zones; material.coarse = "matched" or "unbreakable" prevents it'
            )


def of_body(body: str | None) -> str:
    """A body in words, " of body 'left'"; empty without a name, of a plate that is the only one."""
    return "" if body is None else f" of body '{body}'"


def coarse_nodes(grid: Grid, zone: ZoneStrength) -> NDArray[np.bool_]:
    """Mask (n,) of nodes of a zone's body that are coarser than its finest ones."""
    coarse = np.asarray(grid.delta > zone.finest * (1 + SAME))
    return coarse if grid.bodies is None else coarse & (grid.bodies.number == grid.bodies.names.index(str(zone.body)))


def _pulls(condition: Any) -> bool:
    """Whether a condition loads what it acts on, and is not a support."""
    if isinstance(condition, Displacement | Velocity | Acceleration | InitialVelocity):
        return any(getattr(condition, axis, None) for axis in ("x", "y", "z", "spin"))
    return isinstance(condition, Load)
