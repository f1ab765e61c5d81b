"""Fracture energies that follow from the critical stretch of brittle bonds, and the other way round.

The critical stretch s_c of a lattice with the horizon h is f sqrt(a G0 / (E h)); a is that of the continuum
(`material_constants.SQUARED`), f that of the lattice's calibration. A given s_c is that of the finest nodes. Coarser
ones then have the same G0, and a lower critical stretch.
"""

from __future__ import annotations

import msgspec
import numpy as np

from pdmesh.model.lattice_calibration import calibration, has_partial_cells
from pdmesh.model.material import UNKNOWN, USUAL_LAW, Material
from pdmesh.model.material_constants import SQUARED, Number, critical_stretch

LARGE_STRETCH = 0.1  # at which bonds break: beyond, an E below that of rubber is taken for one in GPa or MPa
SOFT = 1e6  # Pa, the Young's modulus of rubber
TOUGH = 1e7  # J/m^2, more than any solid has: bonds that are not to break
LEAST = 1e-20  # of a critical stretch, whose G0 is lost in round-off below


def wrong_energy(material: Material) -> str | None:
    """What is wrong with the fracture energy and the critical stretch of a material, with its key; None if nothing."""
    stretch = material.critical_stretch
    if stretch is None:
        expected = "a fracture energy, or the critical_stretch of brittle bonds"
        return f"G0 is missing or 0; give {expected}" if material.G0 == UNKNOWN else None
    if material.G0 != UNKNOWN:
        return f"critical_stretch ({stretch:g}) cannot be combined with G0; give one of them"
    if material.model != "bond" or material.law != USUAL_LAW:
        kind = f"model '{material.model}'" if material.model != "bond" else f"law '{material.law}'"
        return f"critical_stretch ({stretch:g}) cannot be used with {kind}; give G0"
    if not LEAST <= stretch <= 1 / LEAST:
        return f"critical_stretch is {stretch:g}; use {LEAST:g} to {1 / LEAST:g}"
    return None


def with_fracture_energy(material: Material, ratio: float, spacing: float, dimension: int) -> Material:
    """The material with the G0 of its critical stretch at a spacing, m, and a `ratio` of the horizon to it.

    Raises ValueError for one without either, and for a critical stretch of bonds that are not brittle.
    """
    wrong = wrong_energy(material)
    if wrong is not None:
        raise ValueError(wrong)
    if material.critical_stretch is None:
        return material
    G0 = energy_of_stretch(material.critical_stretch, material.E, material, ratio, spacing, dimension)
    return msgspec.structs.replace(material, G0=float(G0), critical_stretch=None)


def energy_of_stretch(
    stretch: Number, E: Number, material: Material, ratio: float, spacing: float, dimension: int
) -> Number:
    """G0, J/m^2, of brittle bonds with this critical stretch and Young's modulus, Pa, on the lattice of a material."""
    in_dimension = _in_dimension(material, dimension)
    stretch = stretch / calibration(ratio, in_dimension, has_partial_cells(in_dimension)).stretch
    return stretch**2 * E * ratio * spacing / SQUARED[in_dimension.plane, in_dimension.micromodulus]


def stretch_of_lattice(material: Material, ratio: float, spacing: float, dimension: int) -> float | None:
    """The critical stretch of brittle bonds of the conservative mode at a spacing, m; None for other materials."""
    if material.model != "bond" or material.law != USUAL_LAW or material.G0 == UNKNOWN:
        return None
    material_in_dimension = _in_dimension(material, dimension)
    factor = calibration(ratio, material_in_dimension, has_partial_cells(material_in_dimension)).stretch
    return factor * float(critical_stretch(material_in_dimension, np.array([ratio * spacing]))[0])


def _in_dimension(material: Material, dimension: int) -> Material:
    return msgspec.structs.replace(material, plane="space") if dimension == 3 else material
