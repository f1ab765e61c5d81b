"""Fracture parameters along the fronts of cracks in bodies, as `pdpost sif` delivers them."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdpost.commands import number_options
from pdpost.commands.shared import YIELDS, counted

if TYPE_CHECKING:
    from pdpost.measures.intensities_in_space import AlongFront
    from pdsolve.results import Results

UNITS = {"J": "J/m^2", "K1": "Pa m^0.5", "K2": "Pa m^0.5", "K3": "Pa m^0.5", "angle": "degrees"}


def deliver_fronts(args: argparse.Namespace, results: Results, steps: list[int], path: Path | None) -> int:
    """Draw, print and table the fracture parameters along the fronts of a body; returns the exit code."""
    from pdpost.measures.intensities_in_space import follow_fronts

    found = follow_fronts(results, steps, args.tip, args.ring, counted(args, "summing"))
    last = [one for one in found if one.step == found[-1].step]
    if path is not None:
        from pdpost.figures import front_figure, style

        style.save(front_figure.along_fronts(found), path)
    for one in last:
        if left_out := Counter(_reason(why) for why in one.refused if why):
            reasons = ", ".join(f"{count} at {why}" for why, count in left_out.most_common())
            said = f"{sum(left_out.values())} of {len(one.along)} points left out: {reasons}"
            commandline.warn(f"{args.results}: {one.name}: {said}")
    lines = [_words(one) for one in last if len(one.known)]
    result = {"steps": steps, "units": UNITS, "fronts": [_told(one) for one in found]}
    names = [f"{name}{end}, {unit}" for name, unit in UNITS.items() for end in ("", " at least", " at most")]
    header = ("front", "step", "time, s", "along, m", "x, m", "y, m", "z, m", *names)
    rows = (row for one in found for row in _rows(one))
    return number_options.deliver(args, result, lines, header, rows, path)


def _reason(why: str) -> str:
    """What is in the way, without where."""
    return why.split(" from the front")[0].rsplit(" ", 3)[0]


def _told(one: AlongFront) -> dict[str, Any]:
    return {
        "name": one.name,
        "step": one.step,
        "time": one.time,
        "along": one.along,
        "place": one.place,
        "growth": one.growth,
        "normal": one.normal,
        **one.value,
        "of_K": one.of_K,
        "at_least": one.low,
        "at_most": one.high,
        "left_out": one.refused,
    }


def _rows(one: AlongFront) -> Any:
    columns = [side[name] for name in UNITS for side in (one.value, one.low, one.high)]
    for row in zip(one.along, *one.place.T, *columns, strict=True):
        yield (one.name, one.step, one.time, *row)


def _words(one: AlongFront) -> str:
    """The largest and the mean of a front's values."""
    import numpy as np

    from pdpost.reading.time_text import time_text

    known = one.known
    at = int(known[one.value["J"][known].argmax()])
    place = ", ".join(f"{x * 1e3 + 0.0:.4g}" for x in one.place[at])
    said, intensities = [], ("K1", "K2", "K3") if np.isfinite(one.value["K1"][at]) else ()
    for name, factor, unit in (("J", 1.0, "J/m^2"), *((each, 1e-6, "MPa m^0.5") for each in intensities)):
        middle, low, high = (factor * side[name][at] for side in (one.value, one.low, one.high))
        said.append(f"{name} {middle:.4g} {unit} ({low:.4g} to {high:.4g})")
    means = ", ".join(f"{name} {one.value[name][known].mean() * 1e-6:.4g}" for name in intensities)
    points = f"{len(known)} of {len(one.along)} points known"
    return f"{one.name}, {time_text(one.time)}, {points}: largest J at ({place}) mm: {', '.join(said)};" + (
        f" in the mean {means} MPa m^0.5" if means else f" {YIELDS}"
    )
