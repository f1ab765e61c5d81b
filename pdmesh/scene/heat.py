"""What conducts heat in a scene, and what physics the parts of a scene make together.

symbol  meaning                                     unit
k       thermal conductivity                        W/(m K)
c       specific heat capacity                      J/(kg K)
D       thermal diffusivity, k / (rho c)            m^2/s
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from pdmesh.model.base_structs import PlainFields
from pdmesh.model.document import MOST, Material, Region
from pdmesh.model.medium import Medium
from pdmesh.scene.shapes import SceneError

Physics = Literal["mechanics", "diffusion", "thermoelastic"]


@dataclass(frozen=True)
class Heat(PlainFields):
    """A medium that conducts heat; with the density rho of the scene's material, D = k / (rho c). Raises SceneError."""

    k: float  # W/(m K)
    c: float  # J/(kg K)
    broken: float = 1.0  # share of its conductance that a broken bond keeps
    deformation: bool = False  # whether stretching cools and compression heats

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in (("k", self.k), ("c", self.c)):
            if not isinstance(value, float | int) or not 0 < value <= MOST:
                raise SceneError(f"medium: {name} is {value!r:.40}; use a positive number of at most {MOST:g}")
        if not isinstance(self.broken, float | int) or not 0 <= self.broken <= 1:
            raise SceneError(f"medium: broken is {self.broken!r:.40}; use a number from 0 to 1")


def capacity(medium: Medium | Heat | None, material: Material | None, place: str) -> float:
    """Heat capacity of a volume, rho c, J/(m^3 K). Raises SceneError, beginning with `place`, if it is not known."""
    if not isinstance(medium, Heat):
        actual = "none" if medium is None else f"D = {medium.D:g} m^2/s alone"
        raise SceneError(f"{place}: medium has {actual}; give k and c, as heat is in watts")
    if material is None:
        raise SceneError(f"{place}: material is missing; give one, whose rho times medium.c is the heat capacity")
    return material.rho * medium.c


def medium_of(medium: Medium | Heat | None, material: Material | None) -> Medium | None:
    """The medium of the grid file: that of heat with D = k / (rho c). Raises SceneError without a density."""
    if not isinstance(medium, Heat):
        return medium
    rho_c = capacity(medium, material, "medium")
    return Medium(
        D=medium.k / rho_c,
        broken=medium.broken,
        heat_capacity=rho_c,
        deformation=medium.deformation,
        carries="heat",
    )


def physics_of(medium: Medium | Heat | None, material: Material | None, regions: Iterable[Region]) -> Physics:
    """The physics of a scene with this medium, material and regions of other materials.

    Thermoelastic is what has a medium and materials with alpha and T0. Raises SceneError for half of that.
    """
    every = [] if material is None else [("material", material)]
    every += [(f"material '{region.name}'", region.material) for region in regions]
    expands = any(solid.alpha is not None for _, solid in every)
    for place, solid in every:
        for name, partner in (("alpha", "T0"), ("T0", "alpha")):
            value = getattr(solid, partner)
            if getattr(solid, name) is None and (expands or value is not None):
                why = "as the other materials expand" if value is None else f"as {partner} is {value:g}"
                raise SceneError(f"{place}: {name} is missing; give a number, {why}")
        if isinstance(medium, Heat) and solid.rho != every[0][1].rho:
            raise SceneError(
                f"{place}: rho is {solid.rho:g} kg/m^3; use {every[0][1].rho:g} kg/m^3 as elsewhere: the medium has"
                " one heat capacity, or else use D and regions of another diffusivity"
            )
    if expands and medium is None:
        place, first = next(entry for entry in every if entry[1].alpha is not None)
        raise SceneError(f"medium is missing, as {place}.alpha is {first.alpha:g}; give D, or k and c, of heat")
    if medium is None:
        return "mechanics"
    return "thermoelastic" if expands else "diffusion"
