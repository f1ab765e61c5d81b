"""Everything there is to say about the crack of a run, as numbers and as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from pdpost.cracks import CRACKED, DIRECTIONS, Direction, Growth, directions, growth
from pdpost.fragments import Fragments, fragments
from pdpost.paths import Branch, Fork, branches, forks, heading
from pdpost.speed import mean_speed, speeds
from pdpost.waves import rayleigh_of
from pdsolve.results import Results

LISTED = 6  # branches and forks in sentences


@dataclass(frozen=True)
class Summary:
    """What became of the cracks of a run until a step."""

    step: int
    time_step: float  # s
    along: str  # the direction that places of `growth` are measured in
    growth: Growth
    directions: list[Direction]
    branches: list[Branch]
    forks: list[Fork]
    fragments: Fragments
    rayleigh_speed: float  # m/s


def summary(results: Results, step: int, threshold: float = CRACKED, along: str | None = None) -> Summary:
    """Follow the cracks of a run; along the direction that most of their length goes by, if none is given."""
    found = branches(results, step, threshold)
    along = along or heading([branch.points for branch in found])
    return Summary(
        step,
        float(results.meta()["time_step"]),
        along,
        growth(results, DIRECTIONS[along], threshold),
        directions(results, step, threshold),
        found,
        forks(found, float(results.nodes().delta.min())),
        fragments(results, step, threshold),
        rayleigh_of(results),
    )


def numbers(found: Summary) -> dict[str, object]:
    """The summary as plain numbers, for JSON."""
    dt = found.time_step
    return {
        **asdict(found.growth),
        "along": found.along,
        "step": found.step,
        "directions": [asdict(way) for way in found.directions],
        "rayleigh_speed": found.rayleigh_speed,
        "branches": [
            {
                "points": branch.points,
                "time": times(branch, dt),
                "along": branch.along,
                "speed": speeds(branch, dt),
                "length": branch.length,
                "mean_speed": mean_speed(branch, dt),
            }
            for branch in found.branches
        ],
        "forks": [asdict(fork) | {"time": fork.step * dt} for fork in found.forks],
        "fragments": found.fragments._asdict() | {"pieces": [piece._asdict() for piece in found.fragments.pieces]},
    }


def table(found: Summary) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Header and rows: every point of the path with its time and speed."""
    rows: list[tuple[object, ...]] = []
    for number, branch in enumerate(found.branches):
        columns = times(branch, found.time_step), *branch.points.T, branch.along, speeds(branch, found.time_step)
        rows += [(number, *row) for row in zip(*columns, strict=True)]
    return ("branch", "time, s", "x, m", "y, m", "along, m", "speed, m/s"), rows


def times(branch: Branch, time_step: float) -> list[float | None]:
    """When the crack came past each point of a branch, s; None at the tip of a pre-crack."""
    return [None if since < 0 else since * time_step for since in branch.since.tolist()]


def sentences(found: Summary) -> list[str]:
    """The summary for a reader, a line each."""
    axis, sign = ("x", DIRECTIONS[found.along][0]) if DIRECTIONS[found.along][0] else ("y", DIRECTIONS[found.along][1])
    events = {name: getattr(found.growth, name) for name in ("first_break", "start", "branching", "split")}
    lines = [
        f"{name.replace('_', ' ')}: step {event.step}, {event.time * 1e6:.4g} us"
        + ("" if event.along is None else f", {axis} = {sign * event.along * 1e3:.4g} mm")
        for name, event in events.items()
        if event is not None
    ]
    for number, branch in enumerate(found.branches[:LISTED]):
        mean = mean_speed(branch, found.time_step)
        fast = "" if mean is None else f", {mean:.4g} m/s ({mean / found.rayleigh_speed:.2f} of the Rayleigh speed)"
        lines.append(f"branch {number}: {branch.length * 1e3:.3g} mm long, to {_place(branch.points[-1])}{fast}")
    if len(found.branches) > LISTED:
        lines.append(f"and {len(found.branches) - LISTED} shorter branches")
    for fork in found.forks[:LISTED]:
        where = f"{_place(fork.place)}, {fork.step * found.time_step * 1e6:.4g} us"
        lines.append(f"fork at {where}: {fork.angle:.1f} degrees between {len(fork.arms)} arms")
    for way in found.directions:
        lines.append(f"from {_place(way.tip)}: {way.angle:+.1f} degrees from the notch")
    if len(found.fragments.pieces) > 1:
        areas = ", ".join(f"{piece.area * 1e6:.4g}" for piece in found.fragments.pieces)
        lines.append(f"{len(found.fragments.pieces)} pieces of {areas} mm^2, cracked nodes left out")
    return lines or ["nothing broke"]


def _place(point: Sequence[float] | NDArray[np.float64]) -> str:
    """A place in mm, its zeros without round-off."""
    x, y = (round(float(value) * 1e3, 6) + 0.0 for value in point)
    return f"({x:.4g}, {y:.4g}) mm"
