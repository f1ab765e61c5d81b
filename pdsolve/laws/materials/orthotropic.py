"""Orthotropic solid for large rotations: S = C : E, E = (F^T F - I) / 2, P = F S, as `svk` with other constants.

C turns with the body, as S and E do not see rotations. In plane stress E_zz is what makes S_zz zero. C is 13 numbers
(`pdmesh.model.orthotropic`).

Bonds fail by an equivalent stress, which is compared with the strength along the fibres, X (Z. Hashin, J. Appl. Mech.
47 (1980) 329-334, for tension):

    fibres   s11                                   breaks every bond
    matrix   X sqrt((p / Y)^2 + (t / S)^2)         breaks a bond where it reaches X / |sin phi|

with p the largest normal stress across the fibres, if it is tensile, Y and S the strengths across the fibres and in
shear, t^2 = s12^2 + s13^2, and phi the angle between the bond and the fibres: cracks in the matrix are along the
fibres, and what crosses them least breaks last. If all bonds broke at X, nodes would lose their fibres with the matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.orthotropic import ORTHOTROPIC, WIDTH, eigenvalues, engineering_constants, stiffness
from pdsolve.laws.law import INNER
from pdsolve.laws.materials.svk import green
from pdsolve.laws.materials.tensors import full, grown, with_zz
from pdsolve.laws.small_tensors import product
from pdsolve.model import Model, ModelError

NO_PLIES = np.zeros((0, WIDTH + 4))


def columns(model: Model, rows: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """C, cosine and sine of the angle, X / Y and X / S (n, 17) of the orthotropic nodes `rows`; zeros elsewhere.

    And the largest stress over strain (n,), Pa. Without such nodes both are empty. Raises ModelError for constants by
    node that store negative energy.
    """
    if not len(rows):
        return NO_PLIES, np.zeros(0)
    ply, largest = np.zeros((len(model.grid), WIDTH + 4)), np.zeros(len(model.grid))
    for places, material in model.materials_at(rows):
        own, angle = rows[places], material.angle + np.zeros(len(rows[places]))
        C = stiffness(engineering_constants(material), angle)
        values = eigenvalues(C, material.plane)
        if not values.min() > 0:
            node = model.grid.ids[own[int(values[:, 0].argmin())]]
            raise ModelError(
                f"{model.name}: $.fields: E and nu of node {node} store negative energy; use nu^2 < E / E2"
            )
        ply[own, :WIDTH], largest[own] = C, values[:, -1]
        ply[own, WIDTH], ply[own, WIDTH + 1] = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        if (
            material.strength is not None
            and material.strength_across is not None
            and material.shear_strength is not None
        ):
            ply[own, WIDTH + 2] = material.strength / material.strength_across
            ply[own, WIDTH + 3] = material.strength / material.shear_strength
    return ply, largest


def least_moduli(model: Model) -> NDArray[np.float64]:
    """The least Young's modulus of each node (n,), Pa, of those in the model's dimensions."""
    E = model.node_values("E")
    every = np.arange(len(E))
    for places, material in model.materials_at(every):
        if material.solid == ORTHOTROPIC:
            across = (material.E2, material.E3) if material.plane == "space" else (material.E2,)
            E[places] = np.min(np.broadcast_arrays(E[places], *across), axis=0)
    return E


@njit(**INNER)
def strain(C, h, plane_stress):  # type: ignore[no-untyped-def]
    """Green's strain, six components, of the displacement gradient h."""
    E = green(h)
    if plane_stress:
        return with_zz(E, -(C[2] * E[0] + C[5] * E[1] + 2 * C[8] * E[3]) / C[7])
    return E


@njit(**INNER)
def second_stress(C, E):  # type: ignore[no-untyped-def]
    """S, six components."""
    xy, xz, yz = 2 * E[3], 2 * E[4], 2 * E[5]
    return (
        C[0] * E[0] + C[1] * E[1] + C[2] * E[2] + C[3] * xy,
        C[1] * E[0] + C[4] * E[1] + C[5] * E[2] + C[6] * xy,
        C[2] * E[0] + C[5] * E[1] + C[7] * E[2] + C[8] * xy,
        C[3] * E[0] + C[6] * E[1] + C[8] * E[2] + C[12] * xy,
        C[11] * xz + C[10] * yz,
        C[10] * xz + C[9] * yz,
    )


@njit(**INNER)
def stress(C, h, E):  # type: ignore[no-untyped-def]
    """P, nine components, of a gradient and its strain."""
    return product(grown(h), full(second_stress(C, E)))


@njit(**INNER)
def equivalent(ply, d, m, at):  # type: ignore[no-untyped-def]
    """Equivalent stresses of the fibres and of the matrix of a node with the stress in m from `at` on."""
    c, s, none = ply[WIDTH], ply[WIDTH + 1], m[at] * 0
    xx, yy, zz, xy = m[at], m[at + 1], m[at + 2], m[at + 3]
    along, across = c * c * xx + s * s * yy + 2 * c * s * xy, s * s * xx + c * c * yy - 2 * c * s * xy
    t = c * s * (yy - xx) + (c * c - s * s) * xy
    shear = t * t
    if d == 3:
        out, through = c * m[at + 4] + s * m[at + 5], c * m[at + 5] - s * m[at + 4]
        shear += out * out
        across = (across + zz) / 2 + np.sqrt(((across - zz) / 2) ** 2 + through * through)
    opening = max(across, none) * ply[WIDTH + 2]
    return along, np.sqrt(opening * opening + shear * ply[WIDTH + 3] * ply[WIDTH + 3])


@njit(**INNER)
def crossing(ply, xi):  # type: ignore[no-untyped-def]
    """Sine of the angle between a bond and the fibres of a node."""
    squared, along = xi[0] * xi[0], xi[0] * ply[WIDTH] + xi[1] * ply[WIDTH + 1]
    for a in range(1, len(xi)):
        squared += xi[a] * xi[a]
    return np.sqrt(max(1 - along * along / squared, 0 * squared))
