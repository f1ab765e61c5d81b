"""The nodes of a body that are on no lattice, as its file has them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.triangulated_surface import distances
from pdmesh.scene.body import Body
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import NodeSet, Shell

AT_ONCE = 10**6  # pairs of a node and a triangle


class Scattered(NamedTuple):
    """The n nodes of a body."""

    position: NDArray[np.float64]  # (n, 3) m
    delta: NDArray[np.float64]  # (n,) m
    volume: NDArray[np.float64]  # (n,) m^3
    border: NDArray[np.bool_]  # (n,) within a spacing of the surface

    @classmethod
    def of(cls, body: Body) -> Scattered:
        """The nodes that a body has. Raises SceneError for an adaptive method, whose nodes are on a lattice."""
        assert body.nodes is not None
        if body.run.adapt != "none":
            raise SceneError(f"run.adapt is {body.run.adapt}; use none for points on no lattice")
        position, delta = body.nodes.position, body.nodes.delta
        near = distances(position, body.shell.triangles, float(delta.max()))
        return cls(position, delta, body.nodes.volume, near < delta)

    def within(self, shell: Shell, place: str) -> NDArray[np.bool_]:
        """Mask (n,) of the nodes in a solid, or of rows of them; `place` is for other kinds of nodes."""
        if isinstance(shell, NodeSet):
            return np.isin(np.arange(len(self.position)), shell.rows)
        inside = np.zeros(len(self.position), dtype=bool)
        low, high = shell.bounds
        candidates = np.flatnonzero(((self.position >= low) & (self.position <= high)).all(axis=1))
        for rows in np.array_split(candidates, len(candidates) * len(shell.triangles) // AT_ONCE + 1):
            # the angle (k,) that the surface fills around each point (Van Oosterom and Strackee)
            a, b, c = (shell.triangles[None, :, corner] - self.position[rows][:, None] for corner in range(3))
            x, y, z = (np.linalg.norm(side, axis=2) for side in (a, b, c))
            over = np.einsum("ktd,ktd->kt", a, np.cross(b, c))
            under = x * y * z + x * np.einsum("ktd,ktd->kt", b, c)
            under += y * np.einsum("ktd,ktd->kt", a, c) + z * np.einsum("ktd,ktd->kt", a, b)
            inside[rows] = (
                np.abs(2 * np.arctan2(over, under).sum(axis=1)) > np.pi
            )  # 4 pi inside, 0 outside, on a face 2 pi
        return inside
