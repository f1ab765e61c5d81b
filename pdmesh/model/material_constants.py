"""Constants of bond-based materials: micromodulus, critical stretch, stiffness, wave speeds. Plane: per unit thickness.

A bond-based model has one Poisson's ratio, 1/3 in plane stress, 1/4 in plane strain and in space, and C12 = C66. The
micromodulus matches the strain energy of a classical solid of that ratio. Plane stress is eq. 7 and 8 of the thesis
(9E/pi h^3 and 36E/pi h^3); plane strain is after W. Gerstle, N. Sau, S. Silling, Nucl. Eng. Des. 237 (2007) 1250-1258.
The critical stretch s_c in 2D is eq. 10 and 11 of the thesis, after S. A. Silling, E. Askari, Comput. Struct. 83 (2005)
1526-1535. In space, where "plane" is "space", c is 12 E / pi horizon^4 and s_c^2 = 5 G0 / 6 E horizon (the same
source); with a conical micromodulus they are 60 E / pi horizon^4 and G0 / E horizon.

Many materials are arrays: what differs from one to the next is a column, the rest is one material. Functions of a
`Material` whose arithmetic is elementwise then take the constants of many bonds at once: `at` returns a material whose
numbers are arrays. A plate with a material for each node costs as much as one with a single material.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material

Number = TypeVar("Number", float, NDArray[np.float64])
BONDS_NU = {"stress": 1 / 3, "strain": 1 / 4, "space": 1 / 4}  # Poisson's ratio of bonds, by plane
C11 = {"stress": 1.125, "strain": 1.2, "space": 1.2}  # over E, by plane
C66 = {"stress": 0.375, "strain": 0.4, "space": 0.4}  # over E; C12 is the same
STIFFNESS = {  # c(0) horizon^3 / E, in space horizon^4, by plane and micromodulus
    ("stress", "constant"): 9 / np.pi,
    ("stress", "conical"): 36 / np.pi,
    ("strain", "constant"): 48 / (5 * np.pi),
    ("strain", "conical"): 192 / (5 * np.pi),
    ("space", "constant"): 12 / np.pi,
    ("space", "conical"): 60 / np.pi,
}
SQUARED = {  # s_c^2 E horizon / G0, by plane and micromodulus
    ("stress", "constant"): 4 * np.pi / 9,
    ("stress", "conical"): 5 * np.pi / 9,
    ("strain", "constant"): 5 * np.pi / 12,
    ("strain", "conical"): 25 * np.pi / 48,
    ("space", "constant"): 5 / 6,
    ("space", "conical"): 1.0,
}


def micromodulus(material: Material, length: NDArray[np.float64], horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """c(xi), N/m^5 (in space N/m^6), for bonds of `length` <= `horizon`, m.

    It is the force per unit stretch and per area, in space per volume, of both cells.
    """
    c0 = STIFFNESS[material.plane, material.micromodulus] * material.E / horizon ** (dimension_of(material.plane) + 1)
    if material.micromodulus == "constant":
        return c0
    return np.asarray(c0 * np.maximum(1 - length / horizon, 0.0))


def critical_stretch(material: Material, horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Critical stretch s_c of a brittle bond in a family of this horizon (m), for a fracture energy G0."""
    factor = SQUARED[material.plane, material.micromodulus]
    return np.asarray(np.sqrt(factor * material.G0 / (material.E * horizon)))


def dimension_of(plane: str) -> int:
    """The dimension of a model: 2 for a plane, 3 for space."""
    return 3 if plane == "space" else 2


def poisson(material: Material) -> float:
    """Poisson's ratio of a material's model: the given one, or that of bond-based models."""
    return BONDS_NU[material.plane] if material.model == "bond" or material.nu is None else material.nu


def lame(E: Number, nu: Number) -> tuple[Number, Number]:
    """Lamé's constants lambda and mu, in the unit of E, in space and in plane strain."""
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def bulk_modulus(E: Number, nu: Number, space: str) -> Number:
    """Bulk modulus, mean stress over dilatation: within the plane for "stress" and "strain", or in "space"."""
    if space == "stress":
        return E / (2 * (1 - nu))
    first, shear = lame(E, nu)
    return first + shear if space == "strain" else first + 2 * shear / 3


def pressure_speed(material: Material) -> NDArray[np.float64]:
    """Speed of P waves in a plate, m/s; (n,) of n materials."""
    nu = poisson(material)
    C11 = 1 / (1 - nu**2) if material.plane == "stress" else (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    return np.asarray(np.sqrt(C11 * material.E / material.rho))


def rayleigh_ratio(nu: float) -> float:
    """Rayleigh wave speed over shear wave speed in plane strain, for the Poisson's ratio `nu`.

    The root below 1 of Rayleigh's equation, x = (c_R / c_s)^2 and k = (c_s / c_p)^2: x^3 - 8 x^2 + (24 - 16 k) x - 16
    (1 - k) = 0 (K. F. Graff, Wave Motion in Elastic Solids, 1975, 6.1).
    """
    k = (1 - 2 * nu) / (2 * (1 - nu))
    roots = np.roots([1.0, -8.0, 24 - 16 * k, -16 * (1 - k)])
    real = roots.real[np.abs(roots.imag) < 1e-9]
    return float(np.sqrt(real[(real > 0) & (real < 1)].min()))


def rayleigh_speed(E: float, rho: float, plane: str, nu: float | None = None) -> float:
    """Rayleigh wave speed, m/s, along a plate's edge; E in Pa, rho in kg/m^3. `nu` defaults to that of bonds.

    The edge of a plate in plane stress behaves as in plane strain with the Poisson's ratio nu / (1 + nu).
    """
    nu = BONDS_NU[plane] if nu is None else nu
    shear = np.sqrt(E / (2 * (1 + nu)) / rho)
    return float(shear * rayleigh_ratio(nu / (1 + nu) if plane == "stress" else nu))


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
