"""A summary of the cracks of a run, as numbers and as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pdsolve.measures.cracks import DIRECTIONS, PIECE, CrackEvents, find_crack_events
from pdsolve.measures.directions import (
    LEANS,
    InitialCrackDirection,
    PredictedCrackDirection,
    measure_initial_directions,
)
from pdsolve.measures.embedded_model import at_rest, counts_load_steps, moment, own_G0
from pdsolve.measures.fatigue import cycles_at_times
from pdsolve.measures.fragments import PlateFragments, find_plate_fragments
from pdsolve.measures.frame_steps import last_step, moment_text, time_text
from pdsolve.measures.json_keys import fields_by_json_key
from pdsolve.measures.paths import main_growth_direction_name
from pdsolve.measures.release import EnergyRelease, measure_energy_release
from pdsolve.measures.speed import RAYLEIGH, TipSpeeds, limiting_speed
from pdsolve.measures.tips import CrackBranch, CrackFork, crack_branches, find_forks
from pdsolve.results import Results

LISTED = 6  # branches and forks in sentences
MUCH_IN_CRUMBS = 0.5  # of the plate: then the number of pieces says little
LEANING = ": cracks of broken bonds lean to rows and diagonals of the grid, those of --cracks particles do not"
NOTHING = 0.005  # of all that was spent: less before cracks grew is not mentioned


@dataclass(frozen=True)
class CrackPathSummary:
    """What the cracks of a run did until a step."""

    step: int
    time_step: float  # s
    main_direction: str  # the direction that places of `events` are measured in
    events: CrackEvents
    initial_directions: list[InitialCrackDirection]
    branches: list[CrackBranch]
    forks: list[CrackFork]
    fragments: PlateFragments
    limiting_speed: float  # m/s: of waves, that cracks stay below
    energy_release: EnergyRelease  # energy over crack advance
    is_quasi_static: bool = False  # cracks went from load step to load step, and have no speed
    G0_remark: str = ""  # on ratios to G0
    limiting_speed_name: str = RAYLEIGH
    counts_load_steps: bool = False  # times are the numbers of load steps
    cycles: tuple[NDArray[np.float64], ...] | None = None  # of fatigue, at the points of each branch


def crack(
    results: Results, step: int | None = None, threshold: float | None = None, along: str | None = None
) -> CrackPathSummary:
    """Follow the cracks of a run until `step` (default: the last); a node is cracked above the damage `threshold`.

    `along` is "right", "left", "up" or "down"; by default the direction of most of the cracks' length. Raises
    ResultsError if there is no frame yet.
    """
    step = last_step(results) if step is None else step
    (limit, limit_name), rest = limiting_speed(results), at_rest(results)
    branches = []
    for branch in crack_branches(results, step, threshold):
        too_fast = branch.speed.low > (0.0 if rest else limit)  # surely: there a whole stretch broke at once
        speed = TipSpeeds(*(np.where(too_fast, np.nan, column) for column in branch.speed))
        branches.append(replace(branch, speed=speed))
    cycles = [cycles_at_times(results, branch.passing_time) for branch in branches]
    along = along or main_growth_direction_name([branch.points for branch in branches])
    return CrackPathSummary(
        step,
        float(results.meta()["time_step"]),
        along,
        find_crack_events(results, DIRECTIONS[along], threshold, step, branches),
        measure_initial_directions(results, branches),
        branches,
        find_forks(branches),
        find_plate_fragments(results, step, threshold),
        limit,
        measure_energy_release(results, branches),
        rest,
        own_G0(results),
        limit_name,
        counts_load_steps(results),
        tuple(each for each in cycles if each is not None) or None,
    )


def _mean_speed_below_limit(branch: CrackBranch, summary: CrackPathSummary) -> float | None:
    mean = branch.mean_speed
    return None if mean is None or mean > summary.limiting_speed or summary.is_quasi_static else mean


def summary_for_json(summary: CrackPathSummary) -> dict[str, object]:
    """The summary as plain numbers, for JSON."""
    pieces = [fields_by_json_key(piece) for piece in summary.fragments.pieces]
    return {
        **asdict(summary.events),
        "along": summary.main_direction,
        "step": summary.step,
        "directions": [fields_by_json_key(way) for way in summary.initial_directions],
        summary.limiting_speed_name.lower().replace(" ", "_"): summary.limiting_speed,
        "release": fields_by_json_key(summary.energy_release),
        "branches": [
            {
                "points": branch.points,
                "time": branch.passing_time,
                "along": branch.length_along_crack,
                "direction": branch.direction,
                "line": branch.is_narrow,
                "speed": branch.speed.value,
                "speed_low": branch.speed.low,
                "speed_high": branch.speed.high,
                "length": branch.length,
                "mean_speed": _mean_speed_below_limit(branch, summary),
                "mean_speed_points": len(branch.passing_time)
                if branch.point_count_before_edge is None
                else branch.point_count_before_edge,
            }
            for branch in summary.branches
        ],
        "forks": [fields_by_json_key(fork) | {"step": round(fork.time / summary.time_step)} for fork in summary.forks],
        "fragments": fields_by_json_key(summary.fragments) | {"pieces": pieces},
    }


def path_point_table(summary: CrackPathSummary) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Header and rows: every point of the path with its time and speed."""
    rows: list[tuple[object, ...]] = []
    for number, branch in enumerate(summary.branches):
        spent = summary.energy_release.release_rate_at(branch.passing_time)
        columns = (
            branch.passing_time,
            *branch.points.T,
            branch.length_along_crack,
            *branch.speed,
            *branch.direction.T,
            branch.is_narrow,
            spent,
            *([] if summary.cycles is None else [summary.cycles[number]]),
        )
        rows += [(number, *row) for row in zip(*columns, strict=True)]
    speeds = ("speed, m/s", "speed at least, m/s", "speed at most, m/s")
    ways = ("direction x", "direction y", "line")
    when, cycles = "load step" if summary.counts_load_steps else "time, s", [] if summary.cycles is None else ["cycles"]
    return ("branch", when, "x, m", "y, m", "along, m", *speeds, *ways, "dD/da, J/m^2", *cycles), rows


def summary_sentences(summary: CrackPathSummary) -> list[str]:
    """The summary for a reader, a line each."""
    axis, sign = (
        ("x", DIRECTIONS[summary.main_direction][0])
        if DIRECTIONS[summary.main_direction][0]
        else ("y", DIRECTIONS[summary.main_direction][1])
    )
    events = {name: getattr(summary.events, name) for name in ("first_break", "start", "branching", "split")}
    # within a load step breaks have no order
    step, far = ("load step", "as far as ") if summary.is_quasi_static else ("step", "")
    lines = [
        f"{name.replace('_', ' ')}: {step} {event.step}"
        + ("" if summary.counts_load_steps else f", {time_text(event.time)}")
        + ("" if event.along is None else f", {far}{axis} = {sign * event.along * 1e3:.4g} mm")
        for name, event in events.items()
        if event is not None
    ]
    for number, branch in enumerate(summary.branches[:LISTED]):
        lines.append(f"branch {number}: {_describe_branch(branch, summary)}")
    if len(summary.branches) > LISTED:
        lines.append(f"and {len(summary.branches) - LISTED} shorter branches")
    for fork in summary.forks[:LISTED]:
        where = f"{_format_place_in_mm(fork.place)}, {moment_text(fork.time, summary.counts_load_steps)}"
        lines.append(
            f"fork at {where}: {fork.angle_between_outer_arms:.1f} degrees between {len(fork.arm_angles)} arms"
        )
    if summary.cycles is None:  # bonds that lost their life dissipate less than G0
        lines += _energy_release_sentences(summary.energy_release, summary.G0_remark)
    for way in summary.initial_directions:
        band = (
            f" ({way.angle_lower_bound:+.1f} to {way.angle_upper_bound:+.1f})"
            if way.angle_lower_bound < way.angle_upper_bound
            else ""
        )
        angle, overall_angle = (
            f"{round(number, 1) + 0.0:+.1f}" for number in (way.angle_from_pre_crack, way.overall_angle)
        )
        over = f"over its first {way.fitted_length * 1e3:.3g} mm, {overall_angle} as a whole"
        lines.append(f"from {_format_place_in_mm(way.pre_crack_tip)}: {angle} degrees{band} from the notch {over}")
    if len(summary.fragments.pieces) > 1:
        areas = ", ".join(f"{piece.area * 1e6:.4g}" for piece in summary.fragments.pieces)
        of_bodies = f" of all {summary.fragments.body_count} bodies" if summary.fragments.body_count > 1 else ""
        lines.append(f"{len(summary.fragments.pieces)} pieces{of_bodies} of {areas} mm^2, cracked nodes left out")
    lines += _small_piece_sentences(summary.fragments)
    return lines or ["nothing broke"]


def _describe_branch(branch: CrackBranch, summary: CrackPathSummary) -> str:
    """Where and when a tip started and ended, and its speed, in words."""
    when = [moment_text(branch.passing_time[at], summary.counts_load_steps) for at in (0, -1)]
    ways = [f"{_format_place_in_mm(branch.points[at])} at {when[at]}" for at in (0, -1)]
    mean, limit = _mean_speed_below_limit(branch, summary), summary.limiting_speed
    if summary.is_quasi_static:
        fast = ""
    elif not branch.is_narrow[: branch.point_count_before_edge].all():
        fast = ", wider than a crack: no speed"
    elif mean is None:
        fast = ", faster than a crack runs: it broke at once"
    else:
        fast = f", {mean:.4g} m/s ({mean / limit:.2f} of the {summary.limiting_speed_name})"
        if branch.point_count_before_edge is not None:
            time = branch.passing_time[branch.point_count_before_edge - 1]
            fast += f" until it is a horizon from the edge, at {time_text(time)}"
    return f"{branch.length * 1e3:.3g} mm long, from {ways[0]} to {ways[1]}{fast}"


def _small_piece_sentences(fragments: PlateFragments) -> list[str]:
    """Words for what is in no piece, where that is much: crumbs and cracked nodes."""
    total_area = sum(piece.area for piece in fragments.pieces) + fragments.small_pieces_area + fragments.cracked_area
    share = (fragments.small_pieces_area + fragments.cracked_area) / total_area
    if share <= MUCH_IN_CRUMBS:
        return []
    where = "the plate" if fragments.body_count == 1 else "all bodies"
    return [
        f"{share:.0%} of {where} is in no piece: {fragments.cracked_area * 1e6:.4g} mm^2 of cracked nodes, and"
        f" {fragments.small_pieces_area * 1e6:.4g} mm^2 in {fragments.small_piece_count} crumbs"
        f" of at most {PIECE:.0%} of the nodes each"
    ]


def _energy_release_sentences(release: EnergyRelease, G0_remark: str) -> list[str]:
    """Words for the energy dissipated per area of the cracks, over G0."""
    finite_values = release.release_rate[np.isfinite(release.release_rate)]
    if not len(finite_values):
        return []
    low, middle, high = np.percentile(finite_values, (0, 50, 100)) / release.G0
    total_text = f"{release.overall_release_rate / release.G0:.3g} on the whole"
    if release.dissipated_before_growth > NOTHING * release.overall_release_rate * release.crack_length[-1]:
        total_text += f", with {release.dissipated_before_growth:.3g} J/m before they grew"
    ratios = f"median {middle:.3g}, {low:.3g} to {high:.3g}; {total_text}{G0_remark}"
    return [f"energy dissipated per crack area / G0: {ratios}"]


def prediction_sentences(predictions: Sequence[PredictedCrackDirection], results: Results) -> list[str]:
    """What stress intensities predicted, and how far the paths lie from it, a line each."""
    lines = []
    for prediction in predictions:
        angle = f"{round(prediction.angle_from_pre_crack, 1) + 0.0:+.1f}"
        line = (
            f"from {_format_place_in_mm(prediction.pre_crack_tip)}: sif at {moment(results, prediction.frame_step)},"
            f" before bonds broke, predicts {angle} degrees; the path lies {abs(prediction.path_deviation):.1f}"
            " degrees from it"
        )
        lines.append(f"{line}{LEANING}" if abs(prediction.path_deviation) > LEANS else line)
    return lines


def _format_place_in_mm(point: Sequence[float] | NDArray[np.float64]) -> str:
    """A place in mm, without round-off in zeros."""
    x, y = (round(float(value) * 1e3, 6) + 0.0 for value in point)
    return f"({x:.4g}, {y:.4g}) mm"
