"""How wide round bodies touch, in spacings of their nodes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected, tree_of

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

ASIDE = 2.5  # spacings: pairs that press and are nearer than that are of one place
CELL = 1 / 12  # second moment of a cell, in squares of its width
OVER_MOMENT = {2: 4.0, 3: 5.0}  # square of the half-width over the second moment of Hertz's pressure along it


class Pressed(NamedTuple):
    """Pairs that press, p of them."""

    place: Array  # (p, d) between the nodes, m
    force: Array  # (p,) N/m, in space N
    spacing: Array  # (p,) of the coarser node, m
    first: Rows  # (p,) the smaller number of their bodies
    second: Rows  # (p,) the larger one
    round: NDArray[np.bool_]  # (p,) whether a drawn surface is curved there

    def part(self, selection: NDArray[Any]) -> Pressed:
        """The pairs of a mask (p,), or of row numbers."""
        place, force, spacing = self.place[selection], self.force[selection], self.spacing[selection]
        return Pressed(place, force, spacing, self.first[selection], self.second[selection], self.round[selection])


class Width(NamedTuple):
    """How two round bodies touch."""

    half: float  # spacings, the smallest half-width of all places where they do
    force: float  # N/m, in space N, in all


def round_widths(pairs: Pressed) -> dict[tuple[int, int], Width]:
    """The widths of contact of each two bodies that touch where one of them is round."""
    between_bodies = pairs.first != pairs.second
    pairs = pairs.part(between_bodies)
    if not len(pairs.force):
        return {}
    near = tree_of(pairs.place).query_pairs(ASIDE * float(pairs.spacing.max()), output_type="ndarray").T
    first, second = near[
        :, (pairs.first[near[0]] == pairs.first[near[1]]) & (pairs.second[near[0]] == pairs.second[near[1]])
    ]
    widths: dict[tuple[int, int], Width] = {}
    of_place = connected(len(pairs.force), first, second)
    for number in np.unique(of_place[pairs.round]):
        mine = np.flatnonzero(of_place == number)
        bodies = int(pairs.first[mine[0]]), int(pairs.second[mine[0]])
        contact = pairs.part(mine)
        middle = np.average(contact.place, axis=0, weights=contact.force)
        apart = (contact.place - middle) / contact.spacing[:, None]
        moment = np.average(apart[:, :, None] * apart[:, None, :], axis=0, weights=contact.force)
        along = np.linalg.eigvalsh(moment)[1]  # the first is across the face
        # The smaller half-width, in spacings, of the ellipse, or in the plane of the strip, that Hertz has for them
        half = float(np.sqrt(OVER_MOMENT[apart.shape[1]] * (along + CELL)))
        force = float(pairs.force[mine].sum())
        before = widths.get(bodies, Width(np.inf, 0.0))
        widths[bodies] = Width(min(half, before.half), force + before.force)
    return widths
