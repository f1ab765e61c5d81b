"""Fracture parameters at crack tips, in bodies along fronts: J, stress intensities, T-stress, direction of growth."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import (
    YIELDS,
    add_every,
    add_frame,
    add_window,
    check_window,
    chosen_frame,
    chosen_stride,
    counted,
    lengths,
    picture_path,
    place,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdsolve.fracture.domain_integrals import Ring
    from pdsolve.measures.intensities_3d import FrontIntensities
    from pdsolve.measures.stress_intensities import TipIntensityHistory
    from pdsolve.results import Results

TIP_UNITS = {"J": "J/m^2", "K1": "Pa m^0.5", "K2": "Pa m^0.5", "T": "Pa", "angle": "degrees"}
FRONT_UNITS = {"J": "J/m^2", "K1": "Pa m^0.5", "K2": "Pa m^0.5", "K3": "Pa m^0.5", "angle": "degrees"}


def add(commands: Commands) -> None:
    """Put `sif` on the command line."""
    sif = shared.add_command(
        commands, "sif", "draw J, stress intensities and angle of growth of the tips or along the fronts of cracks"
    )
    sif.add_argument(
        "--tip",
        type=place,
        metavar="X,Y[,Z]",
        help="the tip (in a body the front) nearest to a point, m (default: all)",
    )
    sif.add_argument(
        "--ring",
        type=_ring,
        metavar="R0,R1",
        help="inner and outer radius of the ring around a tip or the tube around a front, m (default: all the room)",
    )
    add_frame(sif, default=None)
    add_every(sif)
    add_window(sif)
    sif.set_defaults(run=_sif)


def _ring(text: str) -> tuple[float, float]:
    inner, outer = lengths(text, 2)
    if not 0 <= inner < outer:
        raise argparse.ArgumentTypeError(f"cannot use '{text}'; use two radii, the larger one last")
    return inner, outer


def _sif(args: argparse.Namespace) -> int:
    from pdsolve.measures.embedded_model import expect_mechanics
    from pdsolve.measures.frame_steps import chosen
    from pdsolve.results import Results

    path = picture_path(args, ".sif.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        expect_mechanics(results)
        check_window(results, args)
        if args.frame is None and args.step is None and args.time is None:
            steps = chosen(results, chosen_stride(results, args))
        elif args.every is not None or args.stride is not None:
            raise commandline.UsageError(
                "--every and --stride cannot be combined with --frame, --step or --time, which are one frame;"
                " use one of them"
            )
        else:
            steps = [chosen_frame(results, args)[0]]
        return (_fronts if results.dimension == 3 else _tips)(args, results, steps, path)


def _band_names(units: dict[str, str]) -> list[str]:
    """Headings of the columns of each quantity: its value, and the ends of its band."""
    return [f"{name}{end}, {unit}" for name, unit in units.items() for end in ("", " at least", " at most")]


def _band_columns(series: TipIntensityHistory | FrontIntensities, units: dict[str, str]) -> list[Any]:
    return [side[name] for name in units for side in (series.value, series.low, series.high)]


def _band_words(series: TipIntensityHistory | FrontIntensities, at: int, intensities: Sequence[str]) -> list[str]:
    """J and stress intensities at a place, each with its band."""
    words = []
    for name, factor, unit in (("J", 1.0, "J/m^2"), *((name, 1e-6, "MPa m^0.5") for name in intensities)):
        middle, low, high = (factor * side[name][at] for side in (series.value, series.low, series.high))
        words.append(f"{name} {middle:.4g} {unit} ({low:.4g} to {high:.4g})")
    return words


def _tips(args: argparse.Namespace, results: Results, steps: list[int], path: Path | None) -> int:
    """Draw, print and table the fracture parameters of tips of a plate; returns the exit code."""
    from shapely import Point

    from pdsolve.fracture.domain_integrals import Ring
    from pdsolve.measures import stress_intensities
    from pdsolve.measures.embedded_model import counts_load_steps
    from pdsolve.measures.plate_geometry import read_plate_geometry
    from pdsolve.measures.release import measure_energy_release
    from pdsolve.measures.tips import crack_branches

    if args.tip is not None:
        if len(args.tip) != 2:
            raise commandline.UsageError(f"--tip has {len(args.tip)} numbers; use 2, a place in m")
        shape = read_plate_geometry(results).plate_shape
        if shape.distance(Point(args.tip)) > results.nodes(0).delta.max():
            x0, y0, x1, y1 = shape.bounds
            raise commandline.UsageError(
                f"--tip {args.tip[0]:g},{args.tip[1]:g} is outside of the plate; use a place in it, from {x0:g},{y0:g}"
                f" to {x1:g},{y1:g} (m)"
            )
    ring = None if args.ring is None else Ring(*args.ring)
    tip_series = stress_intensities.follow_tip_intensities(results, steps, args.tip, ring, counted(args, "summing"))
    spent = measure_energy_release(results, crack_branches(results, max(steps)))
    release_rates = spent.release_rate_at(tip_series[0].time)
    if path is not None:
        from pdpost.figures import sif_figure, style

        style.save(sif_figure.sif(results, tip_series, spent, args.window), path)
    left_out = [series for series in tip_series if series.last_integrals is None and series.no_room_reason]
    for series in left_out:
        commandline.warn(f"{args.results}: {series.tip_history.name} left out: {series.no_room_reason}")
    lines = [_tip_words(series) for series in tip_series if series not in left_out]
    result = {
        "steps": steps,
        "units": TIP_UNITS,
        "G0": spent.G0,
        "tips": [_tip_for_json(series, release_rates) for series in tip_series],
    }
    when = "load step" if counts_load_steps(results) else "time, s"
    header = ("tip", "step", when, "x, m", "y, m", *_band_names(TIP_UNITS), "dD/da, J/m^2")
    rows = []
    for series in tip_series:
        columns = _band_columns(series, TIP_UNITS)
        points = zip(series.step, series.time, *series.tip_place.T, *columns, release_rates, strict=True)
        rows += [(series.tip_history.name, *point) for point in points]
    return shared.deliver(args, result, lines, header, rows, path)


def _tip_for_json(series: TipIntensityHistory, release_rates: Any) -> dict[str, Any]:
    rings: list[Ring] = [] if series.last_integrals is None else list(series.last_integrals.rings)
    return {
        "name": series.tip_history.name,
        "time": series.time,
        "place": series.tip_place,
        **series.value,
        "of_K": series.J_from_K,
        "at_least": series.low,
        "at_most": series.high,
        "dD_da": release_rates,
        "rings": [ring._asdict() for ring in rings],
        "left_out": series.no_room_reason,
    }


def _tip_words(series: TipIntensityHistory) -> str:
    import numpy as np

    from pdsolve.measures.frame_steps import time_text

    finite = np.flatnonzero(np.isfinite(series.value["J"]))
    if not len(finite):
        return f"{series.tip_history.name}: at none of these frames"
    at = int(finite[-1])
    elastic = bool(np.isfinite(series.value["K1"][at]))
    said = _band_words(series, at, ("K1", "K2") if elastic else ())
    said += [f"T {series.value['T'][at] * 1e-6:.3g} MPa" if elastic else YIELDS]
    if np.isfinite(series.value["angle"][at]):
        said += [f"turns by {series.value['angle'][at]:+.1f} degrees"]
    if series.K_differs_from_J[at]:
        said += [f"(K1^2 + K2^2)/E' {series.J_from_K[at]:.4g} J/m^2 is outside the band of J: trust J"]
    (x, y), when = series.tip_place[at] * 1e3 + 0.0, time_text(float(series.time[at]))
    gaps = len(series.step) - len(finite)
    gap_note = f"; not known at {gaps} of {len(series.step)} frames" + (
        f": {series.no_room_reason}" if series.no_room_reason else ""
    )
    return f"{series.tip_history.name} at ({x:.4g}, {y:.4g}) mm, {when}: {', '.join(said)}{gap_note * bool(gaps)}"


def _fronts(args: argparse.Namespace, results: Results, steps: list[int], path: Path | None) -> int:
    """Draw, print and table the fracture parameters along the fronts of a body; returns the exit code."""
    from pdsolve.measures.embedded_model import counts_load_steps
    from pdsolve.measures.intensities_3d import follow_front_intensities

    front_states = follow_front_intensities(results, steps, args.tip, args.ring, counted(args, "summing"))
    last = [front for front in front_states if front.step == front_states[-1].step]
    if path is not None:
        from pdpost.figures import sif_figure, style

        style.save(sif_figure.along_fronts(front_states), path)
    for front in last:
        if left_out := Counter(  # what is in the way, without where
            why.split(" from the front")[0].rsplit(" ", 3)[0] for why in front.no_room_reasons if why
        ):
            reasons = ", ".join(f"{count} at {why}" for why, count in left_out.most_common())
            said = f"{sum(left_out.values())} of {len(front.length_along_front)} points left out: {reasons}"
            commandline.warn(f"{args.results}: {front.name}: {said}")
    lines = [_front_words(front) for front in last if len(front.points_with_values)]
    result = {
        "steps": steps,
        "units": FRONT_UNITS,
        "fronts": [
            {
                "name": front.name,
                "step": front.step,
                "time": front.time,
                "along": front.length_along_front,
                "place": front.points,
                "growth": front.growth_direction,
                "normal": front.crack_normal,
                **front.value,
                "of_K": front.J_from_K,
                "at_least": front.low,
                "at_most": front.high,
                "left_out": front.no_room_reasons,
            }
            for front in front_states
        ],
    }
    when = "load step" if counts_load_steps(results) else "time, s"
    header = ("front", "step", when, "along, m", "x, m", "y, m", "z, m", *_band_names(FRONT_UNITS))
    rows = []
    for front in front_states:
        columns = _band_columns(front, FRONT_UNITS)
        points = zip(front.length_along_front, *front.points.T, *columns, strict=True)
        rows += [(front.name, front.step, front.time, *point) for point in points]
    return shared.deliver(args, result, lines, header, rows, path)


def _front_words(front: FrontIntensities) -> str:
    """The largest and the mean of a front's values."""
    import numpy as np

    from pdsolve.measures.frame_steps import time_text

    known_points = front.points_with_values
    at = int(known_points[front.value["J"][known_points].argmax()])
    place = ", ".join(f"{x * 1e3 + 0.0:.4g}" for x in front.points[at])
    intensities = ("K1", "K2", "K3") if np.isfinite(front.value["K1"][at]) else ()
    said = _band_words(front, at, intensities)
    means = ", ".join(f"{name} {front.value[name][known_points].mean() * 1e-6:.4g}" for name in intensities)
    points = f"{len(known_points)} of {len(front.length_along_front)} points known"
    return f"{front.name}, {time_text(front.time)}, {points}: largest J at ({place}) mm: {', '.join(said)};" + (
        f" in the mean {means} MPa m^0.5" if means else f" {YIELDS}"
    )
