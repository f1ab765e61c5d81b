"""The chart of speed against accuracy: a panel for each kind of error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.charts import WIDTH, plain
from pdpost.figures.style import BLUE, VERMILION
from pdsolve.measures.tradeoff import TradeoffPoint, pareto_front

LEAST = 1e-6  # errors below are drawn there
CROWDED = 1.6  # decades of an axis that has names at 1, 10, 100 alone
SUBS = ((1.0, 2.0, 5.0), (1.0,))
COSTS = {"wall_time": "wall time, s", "bond_updates": "bond updates", "bytes": "size of the results, bytes"}


def tradeoff(points: Sequence[TradeoffPoint], by: str, kinds: Sequence[str], within: float | None = None) -> Figure:
    """Cost against each of the `kinds` of errors; `by` is the field of `RunCost` on the x-axes."""
    columns = min(len(kinds), 3)
    rows = -(-len(kinds) // columns)
    figure = Figure(figsize=(WIDTH * 1.25, 2.9 * rows), layout="constrained")
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    cost = np.array([getattr(point.cost, by) for point in points])
    for panel, kind in zip(panels, kinds, strict=False):
        error = np.array([getattr(point.errors, kind) for point in points], dtype=np.float64)  # NaN for None
        draw(panel, cost, error, [point.name for point in points])
        panel.set(xlabel=COSTS[by], title=f"error of {kind}" if kind != "worst" else "largest error")
        if within is not None:
            panel.axhline(within, color=VERMILION, lw=0.8, ls="--")
    for panel in panels[len(kinds) :]:
        panel.remove()
    return figure


def draw(axes: Axes, cost: NDArray[np.float64], error: NDArray[np.float64], names: Sequence[str]) -> None:
    """Draw the points (k,) of a panel; those on the Pareto front are filled, joined and named."""
    plain(axes)
    axes.set_xscale("log")
    axes.set_yscale("log")
    finite = np.isfinite(error)
    if not finite.any():
        axes.text(0.5, 0.5, "nothing to compare", ha="center", transform=axes.transAxes)
        return
    shown = np.maximum(np.where(finite, error, np.nan), LEAST)
    best = [at for at in pareto_front(cost, error) if finite[at]]
    others = [at for at in range(len(names)) if at not in best]
    axes.plot(cost[others], shown[others], "o", ms=4, mfc="white", mec="0.5", ls="none")
    axes.plot(cost[best], shown[best], "o-", ms=5, color=BLUE, lw=1, drawstyle="steps-post")
    for at in range(len(names)):
        if finite[at]:
            colour = BLUE if at in best else "0.45"
            where = (float(cost[at]), float(shown[at]))
            axes.annotate(names[at], where, (4, 3), textcoords="offset points", fontsize=6, color=colour)
    missing = np.flatnonzero(~finite).tolist()
    if missing:
        words = "did not happen in " + ", ".join(names[at] for at in missing)
        axes.text(0.02, 0.02, words, transform=axes.transAxes, fontsize=6, color=VERMILION, wrap=True)
    for axis, words in ((axes.xaxis, "{x:.3g}"), (axes.yaxis, "{x:.3%}")):
        axis.set_major_locator(LogLocator(subs=SUBS[bool(np.ptp(np.log10(axis.get_data_interval())) > CROWDED)]))
        axis.set_major_formatter(FuncFormatter(lambda x, _, words=words: _short(words.format(x=x))))
        axis.set_minor_formatter(NullFormatter())
    axes.margins(0.12)


def _short(text: str) -> str:
    """A number without trailing zeros."""
    number, percent = text.removesuffix("%"), text[-1:] if text.endswith("%") else ""
    return (number.rstrip("0").rstrip(".") if "." in number else number) + percent
