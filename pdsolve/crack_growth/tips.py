"""Ends of cracks of particles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.crack_growth.obstacles import CrackedPlate, distance
from pdsolve.fracture.crack_particles import Particles, arms, links


class Tip(NamedTuple):
    """The end of a crack."""

    particle: int
    back: NDArray[np.float64]  # (m, 2) m: places from the tip back to the next fork or end
    length: float  # m, of that way
    forked: bool  # whether it is a fork that it comes from

    @property
    def place(self) -> NDArray[np.float64]:
        """The place (2,) of the tip, m."""
        return np.asarray(self.back[0])

    def way(self, far: float) -> NDArray[np.float64]:
        """Unit vector of the tip's direction, from a point `far` m back along the crack."""
        steps = np.hypot(*np.diff(self.back, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        begin = [np.interp(min(far, along[-1]), along, column) for column in self.back.T]
        way = self.place - np.array(begin)
        return np.asarray(way / np.hypot(*way))


def tips_of(particles: Particles, ground: CrackedPlate) -> list[Tip]:
    """Ends of cracks inside the plate that lie on no other crack."""
    around, every = links(particles, ground.slack), arms(particles)
    tips = []
    for number, others in enumerate(around):
        if len(others) != 1:
            continue
        line = [number, around[number][0]]
        while len(around[line[-1]]) == 2:
            line.append(next(neighbour for neighbour in around[line[-1]] if neighbour != line[-2]))
        back = particles.place[line]
        tip = Tip(number, back, float(np.hypot(*np.diff(back, axis=0).T).sum()), len(around[line[-1]]) > 2)
        if not ground.inside(tip.place, tip.way(0.5 * tip.length)):
            continue
        on = distance(tip.place, every) <= ground.slack
        if on.sum() == 1:
            tips.append(tip)
    return tips
