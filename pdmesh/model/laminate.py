"""Laminates as one orthotropic material: the membrane stiffness of plies on top of each other.

With A the sum of the plies' stiffness in plane stress, each turned by its angle and times its thickness t, the
constants are those of (A / t)^-1. Bending, and its coupling to the membrane, is left out, and plies do not part.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from pdmesh.model.material import Material
from pdmesh.model.orthotropic import ORTHOTROPIC, engineering_constants, stiffness

SAME = 1e-6  # of the stiffness: less is round-off of angles


def laminate(ply: Material, angles: Sequence[float], thicknesses: Sequence[float] | None = None) -> Material:
    """The material of a laminate in plane stress: its mean stiffness over the thickness, without strengths.

    Parameters
    ----------
    ply
        An orthotropic material in plane stress; its own angle is not used.
    angles
        Of the plies' fibres, from x to y, degrees: [0, 45, -45, 90].
    thicknesses
        Of the plies, m, or in any unit; by default all are the same.

    Returns
    -------
    Material
        Orthotropic in x and y, of E, E2, nu and G12 of the laminate.

    Raises
    ------
    ValueError
        If the ply is not orthotropic in plane stress, without plies, for numbers of angles and thicknesses that differ,
        or if the laminate is not orthotropic in x and y, as each angle needs its opposite.
    """
    weights = np.ones(len(angles)) if thicknesses is None else np.array(thicknesses, dtype=float)
    if ply.solid != ORTHOTROPIC or ply.plane != "stress":
        raise ValueError(f"ply has solid '{ply.solid}' and plane '{ply.plane}'; use orthotropic and stress")
    if not len(angles) or len(weights) != len(angles) or not (weights > 0).all():
        raise ValueError(f"{len(angles)} angles and {len(weights)} thicknesses; give as many, each above 0")
    flat = engineering_constants(ply)._replace(nu13=0.0, nu23=0.0)
    C = np.average(stiffness(flat, np.array(angles, dtype=float)), axis=0, weights=weights)
    Q = C[[[0, 1, 3], [1, 4, 6], [3, 6, 12]]]
    if np.abs(Q[:2, 2]).max() > SAME * np.abs(Q).max():
        listed = ", ".join(f"{angle:g}" for angle in angles)
        raise ValueError(f"plies at {listed} degrees shear when they are pulled; give each angle its opposite, too")
    S = np.linalg.inv(Q)
    constants = {"E": 1 / S[0, 0], "E2": 1 / S[1, 1], "nu": -S[0, 1] / S[0, 0], "G12": 1 / S[2, 2]}
    return msgspec.structs.replace(
        ply, **{name: float(value) for name, value in constants.items()}, angle=0.0, failure="none", strength=None,
        strength_across=None, shear_strength=None, E3=None, nu13=None, nu23=None, G13=None, G23=None,
    )  # fmt: skip
