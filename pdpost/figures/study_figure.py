"""Results of a study: measures against a parameter, one dot a run; and the crack paths of all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pdmesh.files import FilePath
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_figure, for_legend
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import scaled, spelled
from pdpost.figures.crack_figure import on_grey_plate
from pdpost.figures.raster import Box
from pdpost.figures.sheets import box_of, shape
from pdpost.reading.scatter import StudyRunGroup, choose_measures_and_parameter, group_runs_by_parameter
from pdpost.reading.studies import Read, read, short, value_of
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.frame_steps import last_step
from pdsolve.measures.paths import Polyline
from pdsolve.results import Results

WIDE = 0.15  # of the room between two values: how far the dots of several series are set apart
ASIDE = 0.12  # of the length of an axis: left beside its first and last value
GREY = "0.35"  # of marks in the legend
FEW = 6  # values that are all written at the axis
LOGARITHMIC = 20.0  # largest over smallest value of an axis that counts in powers


def study(path: FilePath, measures: Sequence[str] = (), over: str | None = None) -> Figure:
    """Measures of the study at `path` against the parameter `over`: a dot for each run, the median and the range.

    By default the most informative measures, against the parameter with the most values. Raises StudyError.
    """
    study = read(Path(path))
    names, against = choose_measures_and_parameter(study, measures, over)
    return panels_of(study, {name: group_runs_by_parameter(study, name, against) for name in names}, against)


def panels_of(study: Read, measured: Mapping[str, Sequence[StudyRunGroup]], over: str | None) -> Figure:
    """A figure with one panel for each measure: its spread against the parameter `over`."""
    columns = min(len(measured), 2)
    rows = -(-len(measured) // columns)
    figure = Figure(figsize=(WIDTH * (0.7 if columns == 1 else 1), 2.7 * rows + 0.3), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, (name, measure_spreads) in zip(panels, measured.items(), strict=False):
        _panel(panel, study, name, measure_spreads, over)
    for panel in panels[len(measured) :]:
        panel.remove()
    handles, _ = panels[0].get_legend_handles_labels()
    spreads = [spread for listed in measured.values() for spread in listed]
    handles += _marks([len(spread.known_values) for spread in spreads])
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _marks(runs: Sequence[int]) -> list[Artist]:
    """Legend entries for the marks of a panel, of which each stands for this number of runs."""
    dot: dict[str, Any] = {"color": GREY, "ls": "", "marker": "o", "ms": 3.5, "alpha": 0.6, "mew": 0}
    if max(runs, default=0) < 2:
        return [Line2D([], [], label="a run", **dot)]
    bar: dict[str, Any] = {"color": GREY, "ls": "", "marker": "_", "ms": 9, "mew": 1.6}
    spread: dict[str, Any] = {"color": GREY, "ls": "", "marker": "|", "ms": 9, "mew": 1.0}
    words = ((dot, "a run"), (bar, "median of the runs"), (spread, "smallest to largest"))
    return [Line2D([], [], label=label, **style) for style, label in words]


def _panel(axes: Axes, study: Read, name: str, measure_spreads: Sequence[StudyRunGroup], over: str | None) -> None:
    plain(axes)
    series = list(dict.fromkeys(spread.series for spread in measure_spreads))
    places = _places(axes, study, measure_spreads, over)
    factor, unit = scaled([spread.known_values for spread in measure_spreads], spelled(study.columns[name].unit))
    if study.columns[name].unit in ("", "degrees"):
        factor, unit = 1.0, study.columns[name].unit
    for number, which in enumerate(series):
        mine = [spread for spread in measure_spreads if spread.series == which]
        at = np.array([places[spread.parameter_value] for spread in mine])
        if axes.get_xscale() == "linear":
            values = np.sort(list(places.values()))
            room = float(np.diff(values).min()) if len(values) > 1 else 1.0
            at += WIDE * room * ((number + 0.5) / len(series) - 0.5)  # dots of several series beside each other
        colour = look(number)["color"]
        for x, spread in zip(at, mine, strict=True):
            axes.plot(
                np.full(len(spread.known_values), x),
                spread.known_values * factor,
                "o",
                ms=3.5,
                color=colour,
                alpha=0.45,
                mew=0,
            )
        low, high = (
            factor * np.array(side)
            for side in zip(*(spread.smallest_and_largest_value for spread in mine), strict=True)
        )
        axes.vlines(at, low, high, color=colour, lw=1.0)
        middle = factor * np.array([spread.median_value for spread in mine])
        axes.plot(at, middle, marker="_", ms=9, mew=1.6, lw=0.9, color=colour, label=for_legend(which) or None)
    missing = sum(len(spread.measured_values) - len(spread.known_values) for spread in measure_spreads)
    least, most = min(places.values()), max(places.values())  # also of values at which no run has one
    if axes.get_xscale() == "log":
        margin = (most / least) ** ASIDE
        axes.set_xlim(least / margin, most * margin)
    elif most > least:
        axes.set_xlim(least - ASIDE * (most - least), most + ASIDE * (most - least))
    axes.set_ylabel(", ".join(filter(None, [name.replace("_", " "), unit])))
    if missing:
        which = f"did not happen in {missing}" if missing < len(study.rows) else "in none"
        axes.set_title(f"{which} of {len(study.rows)} runs", fontsize="small")


def _places(axes: Axes, study: Read, measure_spreads: Sequence[StudyRunGroup], over: str | None) -> dict[object, float]:
    """Position of each parameter value on the axis: numbers in their unit, words side by side."""
    values = list(dict.fromkeys(spread.parameter_value for spread in measure_spreads))
    column = None if over is None else study.columns[over]
    if column is not None and all(isinstance(value, int | float) for value in values):
        numbers = np.array(values, dtype=float)
        factor, unit = scaled([numbers], spelled(column.unit)) if column.unit else (1.0, "")
        axes.set_xlabel(f"{over}, {unit}" if unit else str(over))
        if (numbers > 0).all() and numbers.max() > LOGARITHMIC * numbers.min():
            axes.set_xscale("log")
        elif len(numbers) <= FEW:
            axes.set_xticks(numbers * factor, [f"{number * factor:g}" for number in numbers], parse_math=False)
        return {value: float(value) * factor for value in values}
    words = [for_figure(value_of(value)) if over else "" for value in values]
    axes.set_xticks(range(len(values)), words, parse_math=False)
    axes.set_xlim(-0.6, len(values) - 0.4)
    axes.set_xlabel("" if over is None else short(over))
    return {value: float(number) for number, value in enumerate(values)}


def overlay(
    results: Results, lines: Sequence[tuple[str, list[Polyline]]], title: str, window: Box | None = None
) -> Figure:
    """Crack paths of many runs, named by series, over the plate of `results`, grey by its damage; `window` in m."""
    step = last_step(results)
    where = shape(results, step, 0.0)
    box = window or box_of([where])
    height = float(np.clip(0.9 * WIDTH * (box[3] - box[1]) / (box[2] - box[0]), 2.0, 9.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    plate = figure.add_subplot(title=title)
    on = on_grey_plate(plate, box, where, 0.0 * damage_without_pre_cracks_at(results, step))
    names = list(dict.fromkeys(name for name, paths in lines if paths))
    for name, paths in ((name, paths) for name, paths in lines if paths):
        style = look(names.index(name)) | {"lw": 1.0, "alpha": 0.6}
        for line in paths:
            plate.plot(*line.T * on.factor, zorder=5, **style)
    for number, name in enumerate(names):
        if name:
            plate.plot([], [], label=for_legend(name), lw=1.4, **look(number))
    if any(names):
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure
