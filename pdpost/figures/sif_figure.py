"""Fracture parameters as a figure: the rings on the plate, stress intensities and J over time with their bands."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Annulus
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import scaled
from pdpost.figures.crack_figure import on_grey_plate
from pdpost.figures.raster import Box
from pdpost.figures.sheets import box_of, shape
from pdpost.measures.cracked_nodes import damage_without_pre_cracks_at
from pdpost.measures.release import EnergyRelease
from pdpost.measures.stress_intensities import TipIntensityHistory
from pdpost.reading.frame_steps import time_text
from pdsolve.results import Results

SHOWN = 6  # tips with curves
BETWEEN = 8  # parts of a curve between two frames


def sif(
    results: Results, tip_series: list[TipIntensityHistory], spent: EnergyRelease, window: Box | None = None
) -> Figure:
    """The tips with their rings at the last frame that has any, K1 and K2, and J with dD/da; `window` is in view, m."""
    shown = [series for series in tip_series if series.last_integrals is not None][:SHOWN]
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
    when = time_text(float(tip_series[0].time[-1]), micro="µs")
    plate.set_title(f"Damage at {when} and the rings of the tips, the last they had", fontsize="medium")
    _curves(intensity, shown, ("K1", "K2"), "Pa√m", "stress intensity")
    _curves(energy, shown, ("J",), "J/m²", "J")
    if np.isfinite(spent.release_rate).any():  # dD/da and G0 beside J
        second, _ = scaled((series.time for series in shown), "s")
        factor, _ = scaled((side["J"] for series in shown for side in (series.low, series.high)), "J/m²")
        energy.plot(spent.time * second, spent.release_rate * factor, color="black", lw=1.0, ls="-.", label="dD/da")
        energy.axhline(spent.G0 * factor, color="0.4", lw=0.8, ls=":", label="G₀")
    energy.legend(frameon=False)
    figure.legend(*intensity.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _curves(axes: Axes, shown: list[TipIntensityHistory], names: tuple[str, ...], unit: str, label: str) -> None:
    """Draw values with their bands over time; points for a single frame."""
    second, seconds = scaled((series.time for series in shown), "s")
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
    axes.set(xlabel=f"time, {seconds}", ylabel=f"{label}, {scale}")
    plain(axes)


def _squares(
    time: NDArray[np.float64], curves: list[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Curves with `BETWEEN` parts between two times, whose roots are linear: J under loads that grow in proportion."""
    if len(time) < 2 or min(float(np.nanmin(curve, initial=0.0)) for curve in curves) < 0:
        return time, curves
    at = np.interp(np.arange((len(time) - 1) * BETWEEN + 1) / BETWEEN, np.arange(len(time)), time)
    return at, [np.interp(at, time, np.sqrt(curve)) ** 2 for curve in curves]
