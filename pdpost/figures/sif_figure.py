"""Fracture parameters as a figure: rings on a plate, J and intensities of tips over time, in bodies along fronts."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Annulus
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import scaled, scaled_times
from pdpost.figures.crack_figure import on_grey_plate
from pdpost.figures.raster import Box
from pdpost.figures.sheets import box_of, shape
from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.embedded_model import counts_load_steps
from pdsolve.measures.frame_steps import moment_text, time_text
from pdsolve.measures.intensities_3d import FrontIntensities
from pdsolve.measures.release import EnergyRelease
from pdsolve.measures.stress_intensities import TipIntensityHistory
from pdsolve.results import Results

MOST_TIPS = 6  # tips with curves
BETWEEN = 8  # parts of a curve between two frames
INTENSITIES = ("K1", "K2", "K3")
MOST_FRONTS = 4  # fronts with curves


def sif(
    results: Results, tip_series: list[TipIntensityHistory], spent: EnergyRelease, window: Box | None = None
) -> Figure:
    """The tips with their rings at the last frame that has any, K1 and K2, and J with dD/da; `window` is in view, m."""
    shown = [series for series in tip_series if series.last_integrals is not None][:MOST_TIPS]
    step = int(tip_series[0].step[-1])
    where = shape(results, step, 0.0)
    box = window or box_of([where])
    tall = float(np.clip(WIDTH * (box[3] - box[1]) / (box[2] - box[0]), 1.6, 5.0))
    figure = Figure(figsize=(WIDTH, tall + 3.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(tall + 0.4, 3.0))
    plate, intensity, energy = (figure.add_subplot(place) for place in (grid[0, :], grid[1, 0], grid[1, 1]))
    on = on_grey_plate(plate, box, where, damage_without_pre_cracks_at(results, step))
    for series in shown:
        colour = str(look(series.tip_history.branch_number)["color"])
        assert series.last_integrals is not None
        place = series.last_integrals.tip.place * on.factor
        ring = series.last_integrals.rings[1]
        outer, wide = ring.outer * on.factor, (ring.outer - ring.inner) * on.factor
        on.axes.add_patch(Annulus(tuple(place), outer, wide, fc=colour, alpha=0.25, lw=0, zorder=4))
        for tip_ring in series.last_integrals.rings:
            for radius in tip_ring:
                circle = radius * on.factor * np.exp(1j * np.linspace(0, 2 * np.pi, 181))
                on.axes.plot(place[0] + circle.real, place[1] + circle.imag, color=colour, lw=0.5, zorder=5)
        on.axes.plot(*place, "+", color=colour, ms=7, zorder=6)
    by_steps = counts_load_steps(results)
    when = moment_text(float(tip_series[0].time[-1]), by_steps, micro="µs")
    plate.set_title(f"Damage at {when} and the rings of the tips, the last they had", fontsize="medium")
    _curves_of_tips(intensity, shown, ("K1", "K2"), "Pa√m", "stress intensity", by_steps)
    _curves_of_tips(energy, shown, ("J",), "J/m²", "J", by_steps)
    if np.isfinite(spent.release_rate).any():  # dD/da and G0 beside J
        second, _ = scaled_times((series.time for series in shown), by_steps)
        factor, _ = scaled((side["J"] for series in shown for side in (series.low, series.high)), "J/m²")
        energy.plot(spent.time * second, spent.release_rate * factor, color="black", lw=1.0, ls="-.", label="dD/da")
        energy.axhline(spent.G0 * factor, color="0.4", lw=0.8, ls=":", label="G₀")
    energy.legend(frameon=False)
    figure.legend(*intensity.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _curves_of_tips(
    axes: Axes, shown: list[TipIntensityHistory], names: tuple[str, ...], unit: str, label: str, by_steps: bool
) -> None:
    """Draw values with their bands over time; points for a single frame."""
    second, when = scaled_times((series.time for series in shown), by_steps)
    factor, scale = scaled(
        (side[name] for series in shown for name in names for side in (series.low, series.high)), unit
    )
    for series in shown:
        for name in names:
            style = look(series.tip_history.branch_number) | {"ls": "--" if name == "K2" else "-"}
            few = np.isfinite(series.value[name]).sum() < 3
            words = f"{name}, {series.tip_history.name}"
            sides = [series.low[name], series.high[name], series.value[name]]
            time = series.time
            if name == "J":
                time, sides = _squares(series.time, sides)
            low, high, value = (side * factor for side in sides)
            axes.fill_between(time * second, low, high, color=style["color"], alpha=0.2, lw=0)
            marker_step = BETWEEN if len(time) > len(series.time) else 1  # points a frame
            marked: dict[str, Any] = {"marker": "." if few else "", "markevery": marker_step}
            axes.plot(time * second, value, lw=1.3, label=words, **marked, **style)
    axes.set(xlabel=when, ylabel=f"{label}, {scale}")
    plain(axes)


def _squares(
    time: NDArray[np.float64], curves: list[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Curves with `BETWEEN` parts between two times, whose roots are linear: J under loads that grow in proportion."""
    if len(time) < 2 or min(float(np.nanmin(curve, initial=0.0)) for curve in curves) < 0:
        return time, curves
    at = np.interp(np.arange((len(time) - 1) * BETWEEN + 1) / BETWEEN, np.arange(len(time)), time)
    return at, [np.interp(at, time, np.sqrt(curve)) ** 2 for curve in curves]


def along_fronts(front_states: list[FrontIntensities]) -> Figure:
    """K1, K2 and K3, J and (K1^2 + K2^2)/E' + K3^2/2G along the fronts of the last frame, with their bands.

    Of several frames also the mean of each front's intensities over time.
    """
    last = [front for front in front_states if front.step == front_states[-1].step][:MOST_FRONTS]
    several = len({front.step for front in front_states}) > 1
    figure = Figure(figsize=(WIDTH, 6.4 if several else 3.6), layout="constrained")
    grid = figure.add_gridspec(2 if several else 1, 2)
    intensity, energy = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    figure.suptitle(f"Along the fronts at {time_text(last[0].time, micro='µs')}", fontsize="medium")
    _curves_along_fronts(intensity, last, INTENSITIES, "Pa√m", "stress intensity")
    factor = _curves_along_fronts(energy, last, ("J",), "J/m²", "J")
    metre, _ = scaled([front.length_along_front for front in last], "m")
    for number, front in enumerate(last):
        style = look(number) | {"ls": ":"}
        energy.plot(
            front.length_along_front * metre, front.J_from_K * factor, lw=1.2, label=f"of K, {front.name}", **style
        )
    energy.legend(frameon=False, fontsize="small")
    intensity.legend(frameon=False, fontsize="small")
    if several:
        # the means of the intensities of each front over time
        axes = figure.add_subplot(grid[1, :])
        second, seconds = scaled([np.array([state.time for state in front_states])], "s")
        factor, unit = scaled((_means(front_states, name) for name in INTENSITIES), "Pa√m")
        fronts = list(dict.fromkeys(state.name for state in front_states))[:MOST_FRONTS]
        for number, front_name in enumerate(fronts):
            of_front = [state for state in front_states if state.name == front_name]
            times = np.array([state.time for state in of_front]) * second
            for order, name in enumerate(INTENSITIES):
                style = look(len(INTENSITIES) * number + order)
                axes.plot(times, _means(of_front, name) * factor, lw=1.3, label=f"{name}, {front_name}", **style)
        axes.set(xlabel=f"time, {seconds}", ylabel=f"in the mean, {unit}")
        axes.legend(frameon=False, fontsize="small")
        plain(axes)
    return figure


def _curves_along_fronts(
    axes: Axes, last: list[FrontIntensities], names: tuple[str, ...], unit: str, label: str
) -> float:
    """Draw values with their bands along the fronts; returns the factor from SI to the unit of the axis."""
    metre, metres = scaled([front.length_along_front for front in last], "m")
    factor, shown = scaled((side[name] for front in last for name in names for side in (front.low, front.high)), unit)
    for number, front in enumerate(last):
        for order, name in enumerate(names):
            style = look(len(names) * number + order)
            sides = front.low[name] * factor, front.high[name] * factor
            axes.fill_between(front.length_along_front * metre, *sides, color=style["color"], alpha=0.2, lw=0)
            marker = "." if len(front.points_with_values) < 3 else ""
            words = f"{name}, {front.name}"
            axes.plot(
                front.length_along_front * metre,
                front.value[name] * factor,
                lw=1.3,
                marker=marker,
                label=words,
                **style,
            )
    axes.set(xlabel=f"along the front, {metres}", ylabel=f"{label}, {shown}")
    plain(axes)
    return factor


def _means(front_states: list[FrontIntensities], name: str) -> NDArray[np.float64]:
    """The mean (f,) along each front; NaN where nothing is known."""
    return np.array(
        [
            front.value[name][front.points_with_values].mean() if len(front.points_with_values) else np.nan
            for front in front_states
        ]
    )
