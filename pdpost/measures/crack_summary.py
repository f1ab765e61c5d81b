"""A summary of the cracks of a run, as numbers and as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracks import DIRECTIONS, PIECE, CrackEvents, crack_events
from pdpost.measures.directions import CrackDirection, measure_directions
from pdpost.measures.fragments import Fragments, find_fragments
from pdpost.measures.paths import main_direction
from pdpost.measures.predicted_directions import LEANS, PredictedDirection
from pdpost.measures.release import EnergyRelease, energy_release
from pdpost.measures.speed import TipSpeeds
from pdpost.measures.tips import Branch, Fork, crack_branches, find_forks
from pdpost.measures.waves import plate_rayleigh_speed
from pdpost.reading.embedded_model import at_rest, moment
from pdpost.reading.frame_steps import last_step
from pdpost.reading.table_columns import TableColumns, columns_of
from pdpost.reading.time_text import time_text
from pdsolve.results import Results

LISTED = 6  # branches and forks in sentences
MUCH_IN_CRUMBS = 0.5  # of the plate: then the number of pieces says little
LEANING = ": cracks of broken bonds lean to rows and diagonals of the grid, those of --cracks particles do not"
NOTHING = 0.005  # of all that was spent: less before cracks grew is not mentioned


@dataclass(frozen=True)
class Summary:
    """What the cracks of a run did until a step."""

    step: int
    time_step: float  # s
    along: str  # the direction that places of `growth` are measured in
    growth: CrackEvents
    directions: list[CrackDirection]
    branches: list[Branch]
    forks: list[Fork]
    fragments: Fragments
    rayleigh_speed: float  # m/s
    release: EnergyRelease  # energy over crack advance
    at_rest: bool = False  # cracks went from load step to load step, and have no speed


def crack(results: Results, step: int | None = None, threshold: float = CRACKED, along: str | None = None) -> Summary:
    """Follow the cracks of a run until `step` (default: the last); a node is cracked above the damage `threshold`.

    `along` is "right", "left", "up" or "down"; by default the direction of most of the cracks' length. Raises
    ResultsError if there is no frame yet.
    """
    step = last_step(results) if step is None else step
    limit, rest = plate_rayleigh_speed(results), at_rest(results)
    branches = []
    for branch in crack_branches(results, step, threshold):
        too_fast = branch.speed.low > (0.0 if rest else limit)  # surely: there a whole stretch broke at once
        speed = TipSpeeds(*(np.where(too_fast, np.nan, column) for column in branch.speed))
        branches.append(replace(branch, speed=speed))
    along = along or main_direction([branch.place for branch in branches])
    return Summary(
        step,
        float(results.meta()["time_step"]),
        along,
        crack_events(results, DIRECTIONS[along], threshold, step, branches),
        measure_directions(results, branches),
        branches,
        find_forks(branches),
        find_fragments(results, step, threshold),
        limit,
        energy_release(results, branches),
        rest,
    )


def _mean_speed(branch: Branch, summary: Summary) -> float | None:
    mean = branch.mean_speed
    return None if mean is None or mean > summary.rayleigh_speed or summary.at_rest else mean


def numbers(summary: Summary) -> dict[str, object]:
    """The summary as plain numbers, for JSON."""
    return {
        **asdict(summary.growth),
        "along": summary.along,
        "step": summary.step,
        "directions": [asdict(way) for way in summary.directions],
        "rayleigh_speed": summary.rayleigh_speed,
        "release": summary.release._asdict(),
        "branches": [
            {
                "points": branch.place,
                "time": branch.time,
                "along": branch.along,
                "direction": branch.direction,
                "line": branch.is_line,
                "speed": branch.speed.value,
                "speed_low": branch.speed.low,
                "speed_high": branch.speed.high,
                "length": branch.length,
                "mean_speed": _mean_speed(branch, summary),
                "mean_speed_points": len(branch.time)
                if branch.points_before_edge is None
                else branch.points_before_edge,
            }
            for branch in summary.branches
        ],
        "forks": [asdict(fork) | {"step": round(fork.time / summary.time_step)} for fork in summary.forks],
        "fragments": summary.fragments._asdict() | {"pieces": [piece._asdict() for piece in summary.fragments.pieces]},
    }


def table(summary: Summary) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Header and rows: every point of the path with its time and speed."""
    rows: list[tuple[object, ...]] = []
    for number, branch in enumerate(summary.branches):
        spent = summary.release.release_at(branch.time)
        columns = branch.time, *branch.place.T, branch.along, *branch.speed, *branch.direction.T, branch.is_line, spent
        rows += [(number, *row) for row in zip(*columns, strict=True)]
    speeds = ("speed, m/s", "speed at least, m/s", "speed at most, m/s")
    ways = ("direction x", "direction y", "line")
    return ("branch", "time, s", "x, m", "y, m", "along, m", *speeds, *ways, "dD/da, J/m^2"), rows


def crack_table(results: Results) -> TableColumns:
    """Every point of a run's crack paths as columns: time, place, length, speed. Raises ResultsError."""
    return columns_of(*table(crack(results)))


def sentences(summary: Summary) -> list[str]:
    """The summary for a reader, a line each."""
    axis, sign = (
        ("x", DIRECTIONS[summary.along][0]) if DIRECTIONS[summary.along][0] else ("y", DIRECTIONS[summary.along][1])
    )
    events = {name: getattr(summary.growth, name) for name in ("first_break", "start", "branching", "split")}
    step, far = ("load step", "as far as ") if summary.at_rest else ("step", "")  # within which breaks have no order
    lines = [
        f"{name.replace('_', ' ')}: {step} {event.step}, {time_text(event.time)}"
        + ("" if event.along is None else f", {far}{axis} = {sign * event.along * 1e3:.4g} mm")
        for name, event in events.items()
        if event is not None
    ]
    for number, branch in enumerate(summary.branches[:LISTED]):
        lines.append(f"branch {number}: {_branch_text(branch, summary)}")
    if len(summary.branches) > LISTED:
        lines.append(f"and {len(summary.branches) - LISTED} shorter branches")
    for fork in summary.forks[:LISTED]:
        where = f"{_place_text(fork.place)}, {time_text(fork.time)}"
        lines.append(f"fork at {where}: {fork.angle:.1f} degrees between {len(fork.arms)} arms")
    lines += _energy_sentences(summary.release)
    for way in summary.directions:
        band = f" ({way.low:+.1f} to {way.high:+.1f})" if way.low < way.high else ""
        angle, overall_angle = (f"{round(number, 1) + 0.0:+.1f}" for number in (way.angle, way.whole))
        over = f"over its first {way.length * 1e3:.3g} mm, {overall_angle} as a whole"
        lines.append(f"from {_place_text(way.tip)}: {angle} degrees{band} from the notch {over}")
    if len(summary.fragments.pieces) > 1:
        areas = ", ".join(f"{piece.area * 1e6:.4g}" for piece in summary.fragments.pieces)
        lines.append(f"{len(summary.fragments.pieces)} pieces of {areas} mm^2, cracked nodes left out")
    lines += _crumbs_sentences(summary.fragments)
    return lines or ["nothing broke"]


def _branch_text(branch: Branch, summary: Summary) -> str:
    """Where and when a tip started and ended, and its speed, in words."""
    ways = [f"{_place_text(branch.place[at])} at {time_text(branch.time[at])}" for at in (0, -1)]
    mean, rayleigh = _mean_speed(branch, summary), summary.rayleigh_speed
    if summary.at_rest:
        fast = ""
    elif not branch.is_line[: branch.points_before_edge].all():
        fast = ", wider than a crack: no speed"
    elif mean is None:
        fast = ", faster than a crack runs: it broke at once"
    else:
        fast = f", {mean:.4g} m/s ({mean / rayleigh:.2f} of the Rayleigh speed)"
        if branch.points_before_edge is not None:
            fast += f" until it is a horizon from the edge, at {time_text(branch.time[branch.points_before_edge - 1])}"
    return f"{branch.length * 1e3:.3g} mm long, from {ways[0]} to {ways[1]}{fast}"


def _crumbs_sentences(fragments: Fragments) -> list[str]:
    """Words for what is in no piece, where that is much: crumbs and cracked nodes."""
    total_area = sum(piece.area for piece in fragments.pieces) + fragments.crumbs_area + fragments.cracked_area
    share = (fragments.crumbs_area + fragments.cracked_area) / total_area
    if share <= MUCH_IN_CRUMBS:
        return []
    return [
        f"{share:.0%} of the plate is in no piece: {fragments.cracked_area * 1e6:.4g} mm^2 of cracked nodes, and"
        f" {fragments.crumbs_area * 1e6:.4g} mm^2 in {fragments.crumbs} crumbs of at most {PIECE:.0%} of the nodes each"
    ]


def _energy_sentences(release: EnergyRelease) -> list[str]:
    """Words for the energy that the cracks spent, relative to G0."""
    finite_values = release.value[np.isfinite(release.value)]
    if not len(finite_values):
        return []
    low, middle, high = np.percentile(finite_values, (0, 50, 100)) / release.G0
    total_text = f"{release.whole / release.G0:.3g} on the whole"
    if release.before > NOTHING * release.whole * release.length[-1]:
        total_text += f", with {release.before:.3g} J/m before they grew"
    return [f"spent over advance, of G0: {middle:.3g} in the median, {low:.3g} to {high:.3g}; {total_text}"]


def prediction_sentences(expected: Sequence[PredictedDirection], results: Results) -> list[str]:
    """What stress intensities predicted, and how far the paths lie from it, a line each."""
    lines = []
    for prediction in expected:
        line = (
            f"from {_place_text(prediction.tip)}: sif at {moment(results, prediction.step)}, before bonds broke,"
            f" predicts {round(prediction.angle, 1) + 0.0:+.1f} degrees; the path lies {abs(prediction.off):.1f}"
            " degrees from it"
        )
        lines.append(f"{line}{LEANING}" if abs(prediction.off) > LEANS else line)
    return lines


def _place_text(point: Sequence[float] | NDArray[np.float64]) -> str:
    """A place in mm, without round-off in zeros."""
    x, y = (round(float(value) * 1e3, 6) + 0.0 for value in point)
    return f"({x:.4g}, {y:.4g}) mm"
