"""Fracture parameters along the fronts of cracks in bodies, as `pdpost sif` delivers them."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands import number_options
from pdpost.commands.shared import YIELDS, counted

if TYPE_CHECKING:
    from pdpost.measures.intensities_3d import FrontIntensities
    from pdsolve.results import Results

UNITS = {"J": "J/m^2", "K1": "Pa m^0.5", "K2": "Pa m^0.5", "K3": "Pa m^0.5", "angle": "degrees"}


def deliver_fronts(args: argparse.Namespace, results: Results, steps: list[int], path: Path | None) -> int:
    """Draw, print and table the fracture parameters along the fronts of a body; returns the exit code."""
    from pdpost.measures.intensities_3d import follow_front_intensities

    front_states = follow_front_intensities(results, steps, args.tip, args.ring, counted(args, "summing"))
    last = [front for front in front_states if front.step == front_states[-1].step]
    if path is not None:
        from pdpost.figures import front_figure, style

        style.save(front_figure.along_fronts(front_states), path)
    for front in last:
        if left_out := Counter(  # what is in the way, without where
            why.split(" from the front")[0].rsplit(" ", 3)[0] for why in front.no_room_reasons if why
        ):
            reasons = ", ".join(f"{count} at {why}" for why, count in left_out.most_common())
            said = f"{sum(left_out.values())} of {len(front.length_along_front)} points left out: {reasons}"
            commandline.warn(f"{args.results}: {front.name}: {said}")
    lines = [_words(front) for front in last if len(front.points_with_values)]
    result = {
        "steps": steps,
        "units": UNITS,
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
    names = [f"{name}{end}, {unit}" for name, unit in UNITS.items() for end in ("", " at least", " at most")]
    header = ("front", "step", "time, s", "along, m", "x, m", "y, m", "z, m", *names)
    rows = []
    for front in front_states:
        columns = [side[name] for name in UNITS for side in (front.value, front.low, front.high)]
        points = zip(front.length_along_front, *front.points.T, *columns, strict=True)
        rows += [(front.name, front.step, front.time, *point) for point in points]
    return number_options.deliver(args, result, lines, header, rows, path)


def _words(front: FrontIntensities) -> str:
    """The largest and the mean of a front's values."""
    import numpy as np

    from pdpost.reading.time_text import time_text

    known_points = front.points_with_values
    at = int(known_points[front.value["J"][known_points].argmax()])
    place = ", ".join(f"{x * 1e3 + 0.0:.4g}" for x in front.points[at])
    said, intensities = [], ("K1", "K2", "K3") if np.isfinite(front.value["K1"][at]) else ()
    for name, factor, unit in (("J", 1.0, "J/m^2"), *((intensity, 1e-6, "MPa m^0.5") for intensity in intensities)):
        middle, low, high = (factor * side[name][at] for side in (front.value, front.low, front.high))
        said.append(f"{name} {middle:.4g} {unit} ({low:.4g} to {high:.4g})")
    means = ", ".join(f"{name} {front.value[name][known_points].mean() * 1e-6:.4g}" for name in intensities)
    points = f"{len(known_points)} of {len(front.length_along_front)} points known"
    return f"{front.name}, {time_text(front.time)}, {points}: largest J at ({place}) mm: {', '.join(said)};" + (
        f" in the mean {means} MPa m^0.5" if means else f" {YIELDS}"
    )
