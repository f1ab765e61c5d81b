"""Fracture parameters of bodies as a figure: stress intensities and J along fronts, of several frames over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import scaled
from pdpost.measures.intensities_3d import FrontIntensities
from pdpost.reading.frame_steps import time_text

INTENSITIES = ("K1", "K2", "K3")
SHOWN = 4  # fronts with curves


def along_fronts(front_states: list[FrontIntensities]) -> Figure:
    """K1, K2 and K3, J and (K1^2 + K2^2)/E' + K3^2/2G along the fronts of the last frame, with their bands.

    Of several frames also the mean of each front's intensities over time.
    """
    last = [front for front in front_states if front.step == front_states[-1].step][:SHOWN]
    several = len({front.step for front in front_states}) > 1
    figure = Figure(figsize=(WIDTH, 6.4 if several else 3.6), layout="constrained")
    grid = figure.add_gridspec(2 if several else 1, 2)
    intensity, energy = (figure.add_subplot(grid[0, column]) for column in (0, 1))
    figure.suptitle(f"Along the fronts at {time_text(last[0].time, micro='µs')}", fontsize="medium")
    _curves(intensity, last, INTENSITIES, "Pa√m", "stress intensity")
    factor = _curves(energy, last, ("J",), "J/m²", "J")
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
        fronts = list(dict.fromkeys(state.name for state in front_states))[:SHOWN]
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


def _curves(axes: Axes, last: list[FrontIntensities], names: tuple[str, ...], unit: str, label: str) -> float:
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
