"""Elastic constants of orthotropic solids: a ply with fibres along axis 1, turned about z by an angle.

With the compliance S (S11 = 1 / E1, S12 = -nu12 / E1, S66 = 1 / G12, likewise the others), C = S^-1, and both must be
positive definite. In plane stress only E1, E2, nu12 and G12 matter; the others say how the thickness changes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pdmesh.model.material import Material

    Array = NDArray[np.float64]

ORTHOTROPIC = "orthotropic"  # `Material.solid`
WIDTH = 13  # components of C that a turn about z leaves: 11 12 13 16 22 23 26 33 36 44 45 55 66, 6 = xy, 5 = xz, 4 = yz
NEAR = 0.01  # shear moduli this near are one
BY_PLANE = {"stress": (), "strain": ("E3", "nu13", "nu23"), "space": ("E3", "nu13", "nu23", "G13", "G23")}


class EngineeringConstants(NamedTuple):
    """Constants of a ply, Pa; numbers, or arrays (n,)."""

    E1: Any
    E2: Any
    E3: Any
    nu12: Any
    nu13: Any
    nu23: Any
    G12: Any
    G13: Any
    G23: Any


def engineering_constants(material: Material) -> EngineeringConstants:
    """The constants of an orthotropic material; where its plane does not need them, the thickness does not change."""
    E2, G12 = material.E2, material.G12
    given = material.E3, material.nu13, material.nu23, material.G13, material.G23
    usual = E2, 0.0, 0.0, G12, G12
    E3, nu13, nu23, G13, G23 = (other if one is None else one for one, other in zip(given, usual, strict=True))
    return EngineeringConstants(material.E, E2, E3, material.nu, nu13, nu23, G12, G13, G23)


def inadmissible(material: Material) -> Iterator[tuple[str, str]]:
    """Constants that are missing in the material's plane, or that would store negative energy, and what to use."""
    needed = [name for name in ("nu", "E2", "G12", *BY_PLANE[material.plane]) if getattr(material, name) is None]
    yield from ((name, f"a number with solid '{ORTHOTROPIC}' in plane {material.plane}") for name in needed)
    if needed:
        return
    E1, E2, E3, nu12, nu13, nu23, *_ = engineering_constants(material)
    for name, nu, first, second in (("nu", nu12, E1, E2), ("nu13", nu13, E1, E3), ("nu23", nu23, E2, E3)):
        if not nu * nu < first / second:
            pair = {"nu": "E / E2", "nu13": "E / E3", "nu23": "E2 / E3"}[name]
            yield name, f"less than {(first / second) ** 0.5:.4g}, the root of {pair}: else energy is negative"
            return
    twice = 2 * nu12 * nu23 * nu13 * E3 / E1
    if not 1 - nu12**2 * E2 / E1 - nu23**2 * E3 / E2 - nu13**2 * E3 / E1 - twice > 0:
        yield "nu23", "Poisson's ratios with 1 - nu12 nu21 - nu23 nu32 - nu13 nu31 - 2 nu21 nu32 nu13 above 0"


def not_of_springs(material: Material) -> Iterator[tuple[str, str]]:
    """What a model of springs says to an orthotropic solid of it: springs have C12 = C66, and no law of plies."""
    E2, nu12 = material.E2, material.nu
    if E2 is None or nu12 is None or material.G12 is None or not nu12**2 < material.E / E2:
        yield "solid", "none with model 'bond'"
        return
    G12 = nu12 * E2 / (1 - nu12**2 * E2 / material.E)
    if abs(G12 - material.G12) <= NEAR * G12:
        yield "model", "'correspondence', as bonds have no stiffness by direction"
        return
    root = (1 + 4 * material.G12**2 / (material.E * E2)) ** 0.5  # of nu12 by G12 nu21 nu12 + E2 nu12 - G12 = 0
    nu12 = 2 * material.G12 / (E2 * (1 + root))
    yield "G12", f"model 'correspondence': springs have G12 = {G12:.4g} Pa here, or nu = {nu12:.4g} with this G12"


def stiffness(constants: EngineeringConstants, angle: Array | float) -> Array:
    """C (n, 13), Pa, in the axes of the model, of plies at `angle` (n,), degrees."""
    import numpy as np

    angle = np.atleast_1d(np.asarray(angle, dtype=float))
    E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = np.broadcast_arrays(*constants, angle)[:9]
    S12, S13, S23 = -nu12 / E1, -nu13 / E1, -nu23 / E2
    rows = [[1 / E1, S12, S13], [S12, 1 / E2, S23], [S13, S23, 1 / E3]]
    (C11, C12, C13), (_, C22, C23), (_, _, C33) = np.moveaxis(np.linalg.inv(np.moveaxis(np.array(rows), 2, 0)), 0, 2)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    cc, ss, cs = c * c, s * s, c * s
    both, fourth = C12 + 2 * G12, cc * cc + ss * ss
    along, across = C11 - both, C22 - both
    columns = (
        cc * cc * C11 + 2 * cc * ss * both + ss * ss * C22,
        cc * ss * (C11 + C22 - 4 * G12) + fourth * C12,
        cc * C13 + ss * C23,
        cs * (cc * along - ss * across),
        ss * ss * C11 + 2 * cc * ss * both + cc * cc * C22,
        ss * C13 + cc * C23,
        cs * (ss * along - cc * across),
        C33,
        cs * (C13 - C23),
        cc * G23 + ss * G13,
        cs * (G13 - G23),
        ss * G23 + cc * G13,
        cc * ss * (C11 + C22 - 2 * both + 2 * G12) + fourth * G12,
    )
    return np.column_stack(columns)


def eigenvalues(C: Array, plane: str) -> Array:
    """Eigenvalues of C (n, 13), rising, Pa: (n, 3) within the plane, (n, 6) in space."""
    import numpy as np

    C11, C12, C13, C16, C22, C23, C26, C33, C36, C44, C45, C55, C66 = C.T
    root, none = np.sqrt(2.0), 0 * C11
    rows = [
        [C11, C12, root * C16, C13, none, none],
        [C12, C22, root * C26, C23, none, none],
        [root * C16, root * C26, 2 * C66, root * C36, none, none],
        [C13, C23, root * C36, C33, none, none],
        [none, none, none, none, 2 * C55, 2 * C45],
        [none, none, none, none, 2 * C45, 2 * C44],
    ]
    M = np.moveaxis(np.array(rows), 2, 0)
    if plane != "space":
        out = M[:, :3, 3]
        M = M[:, :3, :3]
        if plane == "stress":  # with no stress across the plane
            M = M - out[:, :, None] * out[:, None, :] / C33[:, None, None]
    return np.asarray(np.linalg.eigvalsh(M))
