"""What pressure on the faces of a crack adds to the integrals around its tip: - sum F_i u_i,1 q.

F is the force on a piece of a face, u_i,1 the derivative of the displacement along growth and q the weight of the
integral there. The divergence theorem leaves this of faces whose stress is not 0. Derivatives are changes over pieces,
which add up exactly, also where auxiliary stresses are infinite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class LoadedFaces(NamedTuple):
    """Pieces of faces: f segments of a plate or triangles of a body."""

    corners: Array  # (f, d, d) m
    displacement: Array  # (f, d, d) m, of the corners
    force: Array  # (f, d) N/m or N, on the material
    outward: Array  # (f, d) normals out of the material, of any length
    at_rim: NDArray[np.bool_]  # (f, d) corners where faces end: at the front, or at an edge of the part

    @property
    def middle(self) -> Array:
        """The middles (f, d) of the pieces, m."""
        return np.asarray(self.corners.mean(axis=1))

    def part(self, rows: NDArray[np.int64]) -> LoadedFaces:
        """Some of the pieces."""
        return LoadedFaces(
            self.corners[rows], self.displacement[rows], self.force[rows], self.outward[rows], self.at_rim[rows]
        )


def changes_along(corners: Array, way: Array, values: Array) -> Array:
    """Derivatives (f, c) along unit vectors `way` (f, d) of values (f, d, c) that are linear between corners
    (f, d, d)."""
    sides = corners[:, 1:] - corners[:, :1]
    shares = np.einsum("fdk,fd->fk", np.linalg.pinv(sides), way)
    return np.asarray(np.einsum("fk,fkc->fc", shares, values[:, 1:] - values[:, :1]))


def at_front(faces: LoadedFaces, distance: Array) -> NDArray[np.bool_]:
    """Which corners (f, d) are on a front at a `distance` (f, d), m: those of a rim that is near to it.

    A crack that has grown beyond the faces is open there.
    """
    longest = np.linalg.norm(faces.corners[:, 1:] - faces.corners[:, :1], axis=2).max()
    return np.asarray(faces.at_rim & (distance < 2 * longest))


def closed(displacement: Array, together: NDArray[np.bool_]) -> Array:
    """Displacements (f, d, c) of corners whose mean those `together` (f, d) have, where both faces meet.

    Nodes beside a front, which carry its corners, are apart already.
    """
    if not together.any():
        return displacement
    return np.where(together[:, :, None], displacement[together].mean(axis=0), displacement)
