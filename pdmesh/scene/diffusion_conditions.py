"""Conditions on a concentration or a temperature, which plates and bodies share."""

from __future__ import annotations

from typing import Self

from pdmesh.model.base_structs import plain
from pdmesh.model.document import (
    Concentration,
    Exchange,
    InitialConcentration,
    Material,
    Source,
)
from pdmesh.model.medium import Medium
from pdmesh.scene.conditions import Conditioned, Profile, W
from pdmesh.scene.functions_of_place import ValueOfPlace, divided
from pdmesh.scene.heat import Heat, capacity
from pdmesh.scene.shapes import SceneError


class DiffusionConditions(Conditioned[W]):
    """What `pdmesh.Scene` and `pdmesh.Body` add to themselves where something diffuses or is heated.

    `rows`, `profile` and `name` are those of `load`, and values may depend on the place likewise.
    A flux goes through a curve of a plate or a sheet of a body.
    """

    medium: Medium | Heat | None
    material: Material | None

    def begin(self, where: W, concentration: ValueOfPlace, name: str = "") -> Self:
        """With a concentration (mol/m^3) in a shape or a solid at time 0."""
        return self._with(InitialConcentration, {"value": concentration}, where, 1, name)

    def hold(self, where: W, concentration: ValueOfPlace, rows: int = 1, profile: Profile = (), name: str = "") -> Self:
        """With a concentration (mol/m^3) prescribed on a side or a curve, or at the nodes of a surface or a solid."""
        return self._with(Concentration, {"value": concentration}, where, rows, name, profile=profile)

    def supply(
        self,
        where: W,
        flux: ValueOfPlace | None = None,
        rate: ValueOfPlace | None = None,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
    ) -> Self:
        """With a flux (mol/(m^2 s)), or a rate (mol/(m^3 s)) of supply there or throughout."""
        name = name or self._named(where, "source")
        if (flux is None) == (rate is None):
            raise SceneError(f"source '{name}': neither or both of flux and rate are given; give one of them")
        size = {} if flux is None else self._size(where, f"source '{name}'")
        return self._with(Source, {"flux": flux, "rate": rate} | size, where, rows, name, profile=profile)

    def exchange(
        self,
        where: W,
        coefficient: float,
        outside: ValueOfPlace = 0.0,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
    ) -> Self:
        """With a flux in of `coefficient` (m/s) times (`outside` - C), mol/m^3."""
        name = name or self._named(where, "exchange")
        values = {"coefficient": coefficient, "value": outside} | self._size(where, f"exchange '{name}'")
        return self._with(Exchange, values, where, rows, name, profile=profile)

    def initial_temperature(self, where: W, T: ValueOfPlace, name: str = "") -> Self:
        """With a temperature T (K) in a shape or a solid at time 0; elsewhere that is T0 of the material."""
        return self.begin(where, T, name)

    def temperature(self, where: W, T: ValueOfPlace, rows: int = 1, profile: Profile = (), name: str = "") -> Self:
        """With a temperature T (K) prescribed on a side or a curve, or at the nodes of a surface or a solid."""
        return self.hold(where, T, rows, profile, name)

    def heat(
        self,
        where: W,
        flux: ValueOfPlace | None = None,
        rate: ValueOfPlace | None = None,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
    ) -> Self:
        """With heat supplied: a flux (W/m^2), or a rate (W/m^3) there or throughout."""
        rho_c = capacity(self.medium, self.material, f"source '{name or self._named(where, 'source')}'")
        flux, rate = (None if value is None else divided(plain(value), rho_c) for value in (flux, rate))
        return self.supply(where, flux, rate, rows, profile, name)

    def convection(
        self,
        where: W,
        h: float | None = None,
        outside: ValueOfPlace | None = None,
        rows: int = 1,
        profile: Profile = (),
        name: str = "",
    ) -> Self:
        """With a heat flux in of h (W/(m^2 K)) times (`outside` - T), K. Raises SceneError without both."""
        name = name or self._named(where, "exchange")
        for word, value, unit in (("h", h, "W/(m^2 K)"), ("outside", outside, "K")):
            if value is None:
                raise SceneError(f"exchange '{name}': {word} is missing; give a number, {unit}")
        assert h is not None
        assert outside is not None
        rho_c = capacity(self.medium, self.material, f"exchange '{name}'")
        return self.exchange(where, plain(h) / rho_c, outside, rows, profile, name)

    def _size(self, where: W, place: str) -> dict[str, float]:
        """Length (m) or area (m^2) that a flux goes through, by the name that the condition has for it.

        Raises SceneError, beginning with `place`, where no flux goes through.
        """
        raise NotImplementedError
