"""Cohesive bonds with shear, with a rotation at each node: softening at any Poisson's ratio up to that of springs.

For small motions, bond k from i to j with the direction n and the normal t has the strains and the energy

    s = n . eta / |xi|        gamma = t . eta / |xi| - (theta_i + theta_j) / 2        c |xi| (s^2 + r gamma^2) / 2

with c and r of `pdmesh.model.lattice_calibration.sheared`. A node's rotation theta has no stiffness of its own and is
free, so that uniform strains make none. The bond softens as one of `pdsolve.laws.pair_laws.cohesive`, by the drive

    sqrt(s^2 + r gamma^2) under tension, sqrt(r) |gamma| under compression

in the place of its stretch. In this norm it spends the same energy in any mixture of opening and shear, and the tangent
is symmetric. The secant omega reduces both strains, but a bond under compression has its whole normal stiffness. The
third unknown is the rotation times the node's horizon, as in `pdsolve.laws.micropolar`. Surfaces are corrected as
those of springs are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import sheared
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.calls import dissipated_at_break, dissipated_energy, secant
from pdsolve.laws.law import INLINE, Law, Passes
from pdsolve.laws.micropolar import fields, unknowns
from pdsolve.laws.pair_laws import cohesive
from pdsolve.model import Model


class CohesiveMicropolarColumns(NamedTuple):
    """Columns of n nodes and b bonds; each curve has a subclass of its own."""

    stiffness: NDArray[np.floating]  # (b,) force density on i for a unit stretch, N/m^3
    ratio: NDArray[np.floating]  # (b,) r
    turn: NDArray[np.floating]  # (n,) rotation over the third unknown, 1/m
    peak: NDArray[np.floating]  # (b,) drive above which the bond softens
    limit: NDArray[np.floating]  # (b,) drive above which it is gone; both infinite where it must not break
    worst: NDArray[np.floating]  # (b,) the largest drive above the peak, 0 if never there
    broken: NDArray[np.int32]  # (b,) step in which the bond broke, 0 while intact


class LinearColumns(CohesiveMicropolarColumns):
    """Columns of bonds that soften along a line."""


class BilinearColumns(CohesiveMicropolarColumns):
    """Columns of bonds that soften along two lines."""


class ExponentialColumns(CohesiveMicropolarColumns):
    """Columns of bonds that soften exponentially."""


def shear_of(model: Model, bonds: Bonds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness (b,) of bonds, N/m^3, and r (b,), from those of springs; at an interface the mean of both ends."""
    source, ratio = bonds.source, model.settings.horizon.ratio
    constants = np.array([sheared(material, ratio) for material in model.materials])[model.material_of]
    every_E, (c, r), (c_j, r_j) = model.node_values("E"), constants[source].T, constants[bonds.neighbour].T
    E, E_j = every_E[source], every_E[bonds.neighbour]
    share = (E * c + E_j * c_j) / (E + E_j)
    return bonds.stiffness * share, (E * c * r + E_j * c_j * r_j) / (E * c + E_j * c_j)


def columns_of(kind: type[Any]) -> Callable[[Model, Bonds], Any]:
    """The function that makes columns of a type."""

    def columns(model: Model, bonds: Bonds) -> Any:
        """Columns of these bonds (b,), in the plane."""
        numbers = *shear_of(model, bonds), 1 / np.broadcast_to(model.horizons, len(bonds.start) - 1)
        stiffness, ratio, turn = (np.asarray(column, dtype=bonds.limit.dtype) for column in numbers)
        count = len(bonds.limit)
        memory = np.zeros(count, bonds.limit.dtype), np.zeros(count, np.int32)
        return kind(stiffness, ratio, turn, bonds.peak, bonds.limit, *memory)

    return columns


def scale(law: CohesiveMicropolarColumns, bonds: Bonds) -> NDArray[np.float64]:
    """Relative stiffness of nodes (n,), N/m^4."""
    length = np.sqrt((bonds.xi.astype(float) ** 2).sum(axis=1))
    return np.bincount(bonds.source, law.stiffness * (1 + law.ratio) / length, minlength=len(law.turn)).astype(float)


@njit(**INLINE)
def _strains(law, bond, now, i, j):  # type: ignore[no-untyped-def]
    """Direction, s and gamma."""
    x, y = bond.xi[0] / bond.length, bond.xi[1] / bond.length
    turned = (law.turn[i] * now.value[i, 2] + law.turn[j] * now.value[j, 2]) / 2
    s = (x * bond.eta[0] + y * bond.eta[1]) / bond.length
    return x, y, s, (x * bond.eta[1] - y * bond.eta[0]) / bond.length - turned


def update_bond(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0
    _, _, s, gamma = _strains(law, bond, now, i, j)
    drive = np.sqrt(max(s, 0.0) ** 2 + law.ratio[k] * gamma * gamma)
    if drive > law.limit[k]:
        law.broken[k] = now.step
        return dissipated_at_break(law, law.stiffness[k] * bond.length / 4, drive, drive, law.peak[k], law.limit[k])
    if drive > law.peak[k] and drive > law.worst[k]:
        law.worst[k] = drive
    return 0.0


def accumulate_bond_force(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    if law.broken[k] == 0:
        x, y, s, gamma = _strains(law, bond, now, i, j)
        n, q = law.stiffness[k] * s, law.stiffness[k] * law.ratio[k] * gamma
        if law.worst[k] > 0:
            omega = secant(law, law.worst[k], law.worst[k], law.peak[k], law.limit[k])
            q *= omega
            if s.real > 0:
                n *= omega
        f[0] += n * x - q * y
        f[1] += n * y + q * x
        f[2] += law.turn[i] * (q * bond.length / 2)


def energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    if law.broken[k] != 0:
        return 0.0, 0.0
    _, _, s, gamma = _strains(law, bond, now, i, j)
    c, dissipated = law.stiffness[k] * bond.length / 4, 0.0
    along, across = c * s * s, c * law.ratio[k] * gamma * gamma
    if law.worst[k] > 0:
        omega = secant(law, law.worst[k], law.worst[k], law.peak[k], law.limit[k])
        dissipated = dissipated_energy(law, c, law.worst[k], law.peak[k], law.limit[k])
        across *= omega
        if s > 0:
            along *= omega
    return along + across, dissipated


def _law(kind: type[Any], shape: str) -> Law:
    return Law(
        columns_type=kind,
        columns=columns_of(kind),
        passes=Passes(accumulate_bond_force),
        energy=energy,
        scale=scale,
        fields=fields,
        unknowns=unknowns,
        update_bond=update_bond,
        bond_history=("worst",),
        curve=cohesive.LAWS[shape].pair,
    )


LAWS: dict[str, Law] = {  # by `Material.shape`
    "linear": _law(LinearColumns, "linear"),
    "bilinear": _law(BilinearColumns, "bilinear"),
    "exponential": _law(ExponentialColumns, "exponential"),
}
