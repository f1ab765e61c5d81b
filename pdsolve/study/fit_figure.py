"""The picture of a fit: the measured curve, those of the first guess and of the fitted run, and the residual below."""

from __future__ import annotations

import numpy as np

from pdmesh.plain_figure import Figure
from pdsolve.study.fit import Fit

WIDTH, HEIGHT, DPI = 7.0, 5.0, 200  # inches, dots per inch
FIRST, FITTED = "#E69F00", "#0072B2"  # M. Okabe, K. Ito, Color Universal Design (2008)


def draw(fit: Fit, abscissa: str, per: str) -> Figure:
    """A figure of the curves of a fit; `per` is the end of the unit of force, "/m" of a 2D model."""
    curves = fit.comparison
    order = np.argsort(curves.displacement, kind="stable")
    way = curves.displacement[order] * 1e3
    factor, unit = (1e-3, f"kN{per}") if np.abs(curves.measured).max() >= 1e3 else (1.0, f"N{per}")
    peak = float(np.abs(curves.measured).max())
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    for forces, colour, dashes, name in (
        (curves.first, FIRST, "--", "first guess"),
        (curves.fitted, FITTED, "-", "fitted"),
    ):
        above.plot(way, forces[order] * factor, color=colour, ls=dashes, lw=1.4, label=name)
        below.plot(way, (forces - curves.measured)[order] / peak * 100, color=colour, ls=dashes, lw=1.2)
    above.plot(way, curves.measured[order] * factor, "o", color="black", ms=3, label="measured")
    below.axhline(0, color="0.6", lw=0.6)
    above.set_ylabel(f"force per thickness, {unit}" if per else f"force, {unit}")
    above.legend(frameon=False)
    below.set(xlabel=f"{abscissa}, mm", ylabel="residual over\nlargest force, %")
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.9", lw=0.5)
        axes.set_axisbelow(True)
        axes.margins(x=0.01)
    figure.align_ylabels()
    return figure
