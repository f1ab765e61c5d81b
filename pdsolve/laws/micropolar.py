"""Micropolar bonds in the plane: beams that resist stretching, shearing and bending, with a rotation at each node.

W. Gerstle, N. Sau, S. Silling, Nucl. Eng. Des. 237 (2007) 1250-1258. For small motions, bond k from i to j with the
direction n, the normal t, the elongation e, and the transverse displacement w = t . eta has

    energy    c e^2 / 2 |xi| + 6 d (w - |xi| (phi_i + phi_j) / 2)^2 / |xi|^3 + d (phi_j - phi_i)^2 / 2 |xi|

    plane stress    c = 6 E / pi horizon^3 (1 - nu)                  d = E (1 - 3 nu) / 6 pi horizon (1 - nu^2)
    plane strain    c = 6 E / pi horizon^3 (1 + nu) (1 - 2 nu)       d = E (1 - 4 nu) / 6 pi horizon (1 + nu) (1 - 2 nu)

so that Poisson's ratio is free up to that of bonds, above which d would be negative. The third unknown is the rotation
times the node's horizon, a length with the inertia of the others. A bond is a beam along its initial direction: only
small rotations are possible. It fails if its stretch exceeds the limit. Surfaces are not corrected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import Elasticity, elasticity, hu_beta, offsets
from pdmesh.model.material import Material
from pdmesh.model.material_constants import Number
from pdmesh.model.neighbours import lengths
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.law import INLINE, Failure, Law, Passes
from pdsolve.model import Model
from pdsolve.state import Unknown


class MicropolarColumns(NamedTuple):
    """Columns of n nodes and b bonds."""

    along: NDArray[np.floating]  # (b,) c w / |xi|, N/m^4, w the neighbour's cell as far as it counts
    across: NDArray[np.floating]  # (b,) 12 d w / |xi|^3
    bending: NDArray[np.floating]  # (b,) d w / |xi|
    turn: NDArray[np.floating]  # (n,) rotation over the third unknown, 1/m
    limit: NDArray[np.floating]  # (b,) stretch at which the bond fails
    broken: NDArray[np.int32]  # (b,) step in which it did, 0 while intact
    breaks: bool


def columns(model: Model, bonds: Bonds) -> MicropolarColumns:
    """Columns of these bonds (b,), in the plane."""
    source = bonds.source
    horizon = np.broadcast_to(model.horizons, len(bonds.start) - 1)
    reach, length = (horizon[source] + horizon[bonds.neighbour]) / 2, np.hypot(*bonds.xi.T.astype(float))
    c, d = (
        (values[source] + values[bonds.neighbour]) / 2
        for values in stiffnesses(model.node_values("E"), model.node_values("nu"), model.materials[0].plane)
    )
    numbers = (
        bonds.weight * c / reach**3 / length,
        12 * bonds.weight * d / reach / length**3,
        bonds.weight * d / reach / length,
        1 / horizon,
    )
    kind = bonds.xi.dtype
    broken, breaks = np.zeros(len(bonds.limit), np.int32), model.materials[0].failure == "stretch"
    along, across, bending, turn = (np.asarray(column, dtype=kind) for column in numbers)
    return MicropolarColumns(along, across, bending, turn, bonds.limit, broken, breaks)


def stiffnesses(E: Number, nu: Number, plane: str) -> tuple[Number, Number]:
    """c horizon^3 and d horizon, Pa."""
    if plane == "stress":
        return 6 * E / (np.pi * (1 - nu)), E * (1 - 3 * nu) / (6 * np.pi * (1 - nu**2))
    return 6 * E / (np.pi * (1 + nu) * (1 - 2 * nu)), E * (1 - 4 * nu) / (6 * np.pi * (1 + nu) * (1 - 2 * nu))


def along_axes(material: Material, ratio: float) -> Elasticity:
    """Young's modulus over E, and Poisson's ratio, of a bar of beams along an axis of a lattice, which is as published.

    The influence is constant, with horizons of `ratio` spacings.
    """
    xi = offsets(ratio + 0.5)
    length, ones = lengths(xi), np.ones(len(xi))
    (c, d), weight = stiffnesses(1.0, material.nu or 0.0, material.plane), hu_beta(length, ratio * ones, ones)
    n_x, n_y = (xi / length[:, None]).T
    along, across = weight * c * length / ratio**3, 12 * weight * d / (ratio * length)
    c11 = float((along * n_x**4 + across * (n_x * n_y) ** 2).sum() / 2)
    c12 = float(((along - across) * (n_x * n_y) ** 2).sum() / 2)
    return elasticity(c11, c12, material.plane)


def unknowns(dimension: int) -> tuple[Unknown, ...]:
    """The unknowns: displacement, and rotation times horizon."""
    return Unknown("u", 2, 2), Unknown("rotation", 1, 2)


def scale(law: MicropolarColumns, bonds: Bonds) -> NDArray[np.float64]:
    """Relative stiffness of nodes (n,), N/m^4."""
    return np.bincount(bonds.source, law.along + law.across, minlength=len(law.turn)).astype(float)


def rows(law: MicropolarColumns, dimension: int) -> int:
    """Width of `m`: 1, unused, as nothing is gathered."""
    return 1


def fields(
    law: MicropolarColumns, value: NDArray[np.floating], m: NDArray[np.floating]
) -> dict[str, NDArray[np.float64]]:
    """The rotation (n,) of nodes, rad, as a field of results."""
    return {"rotation": (law.turn * value[:, 2]).astype(float)}


@njit(**INLINE)
def _beam(law, bond, now, i, j):  # type: ignore[no-untyped-def]
    """Direction, e, w minus the effect of the ends' rotations, and the mean and the difference of rotations."""
    x, y = bond.xi[0] / bond.length, bond.xi[1] / bond.length
    rotation_i, rotation_j = law.turn[i] * now.value[i, 2], law.turn[j] * now.value[j, 2]
    e = x * bond.eta[0] + y * bond.eta[1]
    w = x * bond.eta[1] - y * bond.eta[0] - bond.length * (rotation_i + rotation_j) / 2
    return x, y, e, w, rotation_j - rotation_i


def may_fail(law, now, i, m):  # type: ignore[no-untyped-def]
    return law.breaks


def fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return law.broken[k] == 0 and bond.stretch > law.limit[k]


def accumulate_bond_force(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        x, y, e, w, bent = _beam(law, bond, now, i, j)
        n, q = law.along[k] * e, law.across[k] * w
        f[0] += n * x - q * y
        f[1] += n * y + q * x
        f[2] += law.turn[i] * (q * bond.length / 2 + law.bending[k] * bent)


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    _, _, e, w, bent = _beam(law, bond, now, i, j)
    return (law.along[k] * e * e + law.across[k] * w * w + law.bending[k] * bent * bent) / 4, 0.0


LAW = Law(
    columns_type=MicropolarColumns,
    columns=columns,
    passes=Passes(accumulate_bond_force),
    energy=energy,
    width=rows,
    scale=scale,
    failure=Failure(may_fail, fails),
    fields=fields,
    unknowns=unknowns,
)
