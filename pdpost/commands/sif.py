"""Fracture parameters at crack tips: J, stress intensities, T-stress, direction of growth."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdpost.commands import number_options
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
    from pdpost.measures.stress_intensities import TipIntensityHistory
    from pdsolve.fracture.domain_integrals import Ring
    from pdsolve.results import Results

UNITS = {"J": "J/m^2", "K1": "Pa m^0.5", "K2": "Pa m^0.5", "T": "Pa", "angle": "degrees"}


def add(commands: Commands) -> None:
    """Put `sif` on the command line."""
    sif = number_options.add_command(
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
    from pdpost.commands import sif_in_space
    from pdpost.measures import stress_intensities
    from pdpost.measures.release import measure_energy_release
    from pdpost.measures.tips import crack_branches
    from pdpost.reading.embedded_model import expect_mechanics
    from pdpost.reading.frame_steps import chosen
    from pdsolve.fracture.domain_integrals import Ring
    from pdsolve.results import Results

    path = picture_path(args, ".sif.png")
    ring = None if args.ring is None else Ring(*args.ring)
    with number_options.styled(path, dict(args.assignments)), Results.open(args.results) as results:
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
        if results.dimension == 3:
            return sif_in_space.deliver_fronts(args, results, steps, path)
        if args.tip is not None and len(args.tip) != 2:
            raise commandline.UsageError(f"--tip has {len(args.tip)} numbers; use 2, a place in m")
        _expect_on_plate(results, args.tip)
        tip_series = stress_intensities.follow_tip_intensities(results, steps, args.tip, ring, counted(args, "summing"))
        spent = measure_energy_release(results, crack_branches(results, max(steps)))
        release_rates = spent.release_rate_at(tip_series[0].time)
        if path is not None:
            from pdpost.figures import sif_figure, style

            style.save(sif_figure.sif(results, tip_series, spent, args.window), path)
    left_out = [series for series in tip_series if series.last_integrals is None and series.no_room_reason]
    for series in left_out:
        commandline.warn(f"{args.results}: {series.tip_history.name} left out: {series.no_room_reason}")
    lines = [_words(series) for series in tip_series if series not in left_out]
    result = {
        "steps": steps,
        "units": UNITS,
        "G0": spent.G0,
        "tips": [_told(series, release_rates) for series in tip_series],
    }
    names = [f"{name}{end}, {unit}" for name, unit in UNITS.items() for end in ("", " at least", " at most")]
    header = ("tip", "step", "time, s", "x, m", "y, m", *names, "dD/da, J/m^2")
    rows = []
    for series in tip_series:
        columns = [side[name] for name in UNITS for side in (series.value, series.low, series.high)]
        points = zip(series.step, series.time, *series.tip_place.T, *columns, release_rates, strict=True)
        rows += [(series.tip_history.name, *point) for point in points]
    return number_options.deliver(args, result, lines, header, rows, path)


def _expect_on_plate(results: Results, place: tuple[float, float] | None) -> None:
    """Raise UsageError for a place that is farther from the plate than a spacing."""
    from shapely import Point

    from pdpost.measures.plate_geometry import read_plate_geometry

    if place is None:
        return
    shape = read_plate_geometry(results).plate_shape
    if shape.distance(Point(place)) > results.nodes(0).delta.max():
        x0, y0, x1, y1 = shape.bounds
        raise commandline.UsageError(
            f"--tip {place[0]:g},{place[1]:g} is outside of the plate; use a place in it, from {x0:g},{y0:g} to"
            f" {x1:g},{y1:g} (m)"
        )


def _told(series: TipIntensityHistory, release_rates: Any) -> dict[str, Any]:
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


def _words(series: TipIntensityHistory) -> str:
    import numpy as np

    from pdpost.reading.time_text import time_text

    finite = np.flatnonzero(np.isfinite(series.value["J"]))
    if not len(finite):
        return f"{series.tip_history.name}: at none of these frames"
    at = int(finite[-1])
    values = {name: (series.value[name][at], series.low[name][at], series.high[name][at]) for name in UNITS}
    said, elastic = [], bool(np.isfinite(values["K1"][0]))
    for name, factor, unit in (("J", 1.0, "J/m^2"), ("K1", 1e-6, "MPa m^0.5"), ("K2", 1e-6, "MPa m^0.5")):
        if elastic or name == "J":
            middle, low, high = (factor * value for value in values[name])
            said.append(f"{name} {middle:.4g} {unit} ({low:.4g} to {high:.4g})")
    said += [f"T {values['T'][0] * 1e-6:.3g} MPa" if elastic else YIELDS]
    if np.isfinite(values["angle"][0]):
        said += [f"turns by {values['angle'][0]:+.1f} degrees"]
    if series.K_differs_from_J[at]:
        said += [f"(K1^2 + K2^2)/E' {series.J_from_K[at]:.4g} J/m^2 is outside the band of J: trust J"]
    (x, y), when = series.tip_place[at] * 1e3 + 0.0, time_text(float(series.time[at]))
    gaps = len(series.step) - len(finite)
    gap_note = f"; not known at {gaps} of {len(series.step)} frames" + (
        f": {series.no_room_reason}" if series.no_room_reason else ""
    )
    return f"{series.tip_history.name} at ({x:.4g}, {y:.4g}) mm, {when}: {', '.join(said)}{gap_note * bool(gaps)}"
