"""A linear ordinary state-based solid of any Poisson's ratio, whose bonds do not break.

S. A. Silling, M. Epton, O. Weckner, J. Xu, E. Askari, J. Elast. 88 (2007) 151-184, eq. 104, with an influence of 1.
In d dimensions, per unit thickness in the plane, the energy density of node i is

    W = K theta^2 / 2 + alpha / 2 sum V_j (e - theta |xi| / d)^2        e = |xi + eta| - |xi|
    theta = d / m sum V_j |xi| e,  m = sum V_j |xi|^2,                  alpha = d (d + 2) mu / m

with V_j the neighbour's cell as far as it is within the horizon, K the bulk modulus (in the plane E / 2 (1 - nu) for
plane stress and lambda + mu for plane strain) and mu the shear modulus. The force density is the sum over bonds of
(t_i + t_j) V_j along the deformed bond, t = d K theta |xi| / m + alpha (e - theta |xi| / d).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdsolve.bonds import Bonds
from pdsolve.laws.law import INNER
from pdsolve.model import Model, ModelError

ROWS = 1  # theta


class Law(NamedTuple):
    """Columns of n nodes and b bonds."""

    bulk: NDArray[np.floating]  # (n,) d K / m
    shear: NDArray[np.floating]  # (n,) alpha
    weighted: NDArray[np.floating]  # (n,) d / m, 0 without a bond
    cell: NDArray[np.floating]  # (b,) V_j, m^2 in the plane


def columns(model: Model, bonds: Bonds) -> Law:
    """The law of these bonds (b,) and their nodes. Raises ModelError where a material has none such."""
    moduli = np.array([_moduli(material, model.place_of(k)) for k, material in enumerate(model.materials)])
    moduli = moduli[model.material_of]
    return of_moduli(moduli[:, 0], moduli[:, 1], bonds)


def of_moduli(bulk: NDArray[np.float64], shear: NDArray[np.float64], bonds: Bonds) -> Law:
    """The law of these bonds (b,) with nodes of the moduli K and mu (n,), Pa."""
    dimension, squared = bonds.xi.shape[1], (bonds.xi.astype(np.float64) ** 2).sum(axis=1)
    m = np.bincount(_sources(bonds), bonds.weight * squared, minlength=len(bonds.start) - 1)
    inverse = np.divide(1.0, m, out=np.zeros_like(m), where=m > 0)
    kind = bonds.xi.dtype
    return Law(
        bulk=(dimension * bulk * inverse).astype(kind),
        shear=(dimension * (dimension + 2) * shear * inverse).astype(kind),
        weighted=(dimension * inverse).astype(kind),
        cell=bonds.weight,
    )


def _moduli(material: Material, place: str) -> tuple[float, float]:
    """K and mu of a material, Pa."""
    most = 1.0 if material.plane == "stress" else 0.5
    if material.nu is None or material.nu >= most:
        found = "none" if material.nu is None else f"{material.nu:g}"
        raise ModelError(f"{place}.nu: found {found}, expected Poisson's ratio below {most:g} for the ordinary law")
    shear = material.E / (2 * (1 + material.nu))
    if material.plane == "stress":
        return material.E / (2 * (1 - material.nu)), shear
    return material.E / (2 * (1 + material.nu) * (1 - 2 * material.nu)), shear


def springs(law: Law, bonds: Bonds) -> NDArray[np.floating]:
    """Force densities (b,) for a unit stretch of linear bonds that are nowhere softer than these, N/m^3.

    By Cauchy's inequality theta^2 <= d^2 / m sum V_j e^2, so that W is at most max(d^2 K / m, alpha) / 2 sum V_j e^2.
    """
    stiffest = np.maximum(bonds.xi.shape[1] * law.bulk, law.shear)
    length = np.sqrt((bonds.xi**2).sum(axis=1))
    return np.asarray((stiffest[_sources(bonds)] + stiffest[bonds.neighbour]) * length * law.cell)


def _sources(bonds: Bonds) -> NDArray[np.int64]:
    return np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))


def gather(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    m[i, 0] += law.cell[k] * bond.length * (bond.length * bond.stretch)


def close(law, i, m):  # type: ignore[no-untyped-def]
    m[i, 0] *= law.weighted[i]


def pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    force = law.cell[k] * (_scalar(law, bond, m, i) + _scalar(law, bond, m, j))
    for a in range(len(bond.xi)):
        f[a] += force * ((bond.xi[a] + bond.eta[a]) / (bond.length * bond.q))


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    stretched = bond.length * bond.stretch
    rest = stretched - m[i, 0] * bond.length / len(bond.xi)
    # K theta^2 / 2 is the sum over bonds of d K / m theta V_j |xi| e / 2
    return law.cell[k] / 2 * (law.bulk[i] * m[i, 0] * bond.length * stretched + law.shear[i] * rest * rest), 0.0


@njit(**INNER)
def _scalar(law, bond, m, i):  # type: ignore[no-untyped-def]
    """t of node i, N/m^5 in the plane."""
    rest = bond.length * bond.stretch - m[i, 0] * bond.length / len(bond.xi)
    return law.bulk[i] * m[i, 0] * bond.length + law.shear[i] * rest
