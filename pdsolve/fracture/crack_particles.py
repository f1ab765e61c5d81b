"""Cracks as particles: each has a place, a normal, and arms to its parent and to its children.

Bonds that cross an arm are cut. Arms join at their particles at any angle, so that no bond passes between two of them.
T. Rabczuk, T. Belytschko, Int. J. Numer. Methods Eng. 61 (2004) 2316-2343, use one straight segment a particle, which
leaves gaps where a crack bends, and cuts beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Particles(NamedTuple):
    """p particles, in the order of their creation."""

    place: NDArray[np.float64]  # (p, 2) m
    normal: NDArray[np.float64]  # (p, 2) unit vector, to the left of the way it was grown
    parent: NDArray[np.int64]  # (p,) number of the one it grew from, -1 of one that grew from none
    step: NDArray[np.int64]  # (p,) the first in which it was there


def nobody() -> Particles:
    """An empty set of particles."""
    return Particles(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0, np.int64))


def grown(particles: Particles, place: NDArray[np.float64], parent: int, step: int) -> Particles:
    """The particles with one more at a place (2,), m, grown from the particle `parent`, or from none (-1)."""
    way = place - particles.place[parent] if parent >= 0 else np.zeros(2)
    length = float(np.hypot(*way))
    normal = np.array([-way[1], way[0]]) / length if length > 0 else np.zeros(2)
    new = Particles(place[None], normal[None], np.array([parent]), np.array([step]))
    extended = Particles(*(np.concatenate(both) for both in zip(particles, new, strict=True)))
    if parent >= 0 and not particles.normal[parent].any():
        extended.normal[parent] = normal
    return extended


def of_segments(segments: NDArray[np.float64], slack: float) -> Particles:
    """Particles of pre-cracks (k, 4), m, at step 0: each segment is an arm; ends within `slack` m are one particle."""
    particles = nobody()
    for start, end in segments.reshape(-1, 2, 2):
        near = np.flatnonzero(np.hypot(*(particles.place - start).T) <= slack)
        if not len(near):
            particles = grown(particles, start, -1, 0)
        particles = grown(particles, end, int(near[0]) if len(near) else len(particles.place) - 1, 0)
    return particles


def until(particles: Particles, step: int) -> Particles:
    """The particles that exist at a step."""
    place, normal, parent, since = particles
    exists = since <= step
    return Particles(place[exists], normal[exists], parent[exists], since[exists])


def arms(particles: Particles, after: int = -1) -> NDArray[np.float64]:
    """Segments (k, 4), m, of all arms, or of those created after a step."""
    has_arm = (particles.parent >= 0) & (particles.step > after)
    return np.hstack([particles.place[particles.parent[has_arm]], particles.place[has_arm]])


def links(particles: Particles, slack: float) -> list[list[int]]:
    """Particles at the other ends of each particle's arms; of particles within `slack` m, the first has all arms."""
    number = np.arange(len(particles.place))
    for at, place in enumerate(particles.place):
        number[at] = number[np.flatnonzero(np.hypot(*(particles.place[: at + 1] - place).T) <= slack)[0]]
    neighbours: list[list[int]] = [[] for _ in number]
    for particle, parent in zip(number.tolist(), particles.parent.tolist(), strict=True):
        if parent >= 0:
            neighbours[particle].append(int(number[parent]))
            neighbours[number[parent]].append(particle)
    return neighbours


def polylines(particles: Particles, slack: float = 0.0) -> list[NDArray[np.float64]]:
    """All arms as polylines (m, 2), m, between ends and forks."""
    around = links(particles, slack)
    unused_arms = {(particle, neighbour) for particle, others in enumerate(around) for neighbour in others}
    lines = []
    ends = [particle for particle, others in enumerate(around) if others and len(others) != 2]
    for first in [*ends, *range(len(around))]:  # what is left after the ends are closed lines
        for second in around[first]:
            if (first, second) not in unused_arms:
                continue
            line = [first, second]
            unused_arms -= {(first, second), (second, first)}
            while len(around[line[-1]]) == 2:
                on = [neighbour for neighbour in around[line[-1]] if (line[-1], neighbour) in unused_arms]
                if not on:
                    break
                unused_arms -= {(line[-1], on[0]), (on[0], line[-1])}
                line.append(on[0])
            lines.append(particles.place[line])
    return lines
