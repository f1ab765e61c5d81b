"""Growth of cracks by fatigue as a figure: length over cycles, and growth a cycle over the range of intensity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pdpost.figures.charts import WIDTH, look, plain
from pdpost.measures.fatigue import FIRST, Growth, Line, between


class Run(NamedTuple):
    """The growth of a run's cracks."""

    name: str  # "": of the only one
    found: Sequence[Growth]
    line: Line | None


def fatigue(runs: Sequence[Run]) -> Figure:
    """Both panels; points at the start of a crack, which are off the line, are hollow."""
    figure = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    lengths, rates = figure.subplots(1, 2)
    every = [(run, one) for run in runs for one in run.found]
    for number, (run, one) in enumerate(every):
        style = look(number)
        label = f"{run.name}, {one.name}" if run.name else one.name
        lengths.plot(one.cycles, one.length * 1e3, marker=".", lw=1.2, label=label, **style)
        dK = between(one, run.line.m if run.line is not None else FIRST)
        for some, fill in ((one.settled, style["color"]), (~one.settled, "white")):
            x, y = dK[some] * 1e-6, one.rate[some]
            rates.plot(x, y, "o", ms=4, mfc=fill, mec=style["color"], ls="none")
    for run, dashes in zip(runs, ("--", ":"), strict=False):
        if run.line is None:
            continue
        ranges = np.concatenate([one.dK for one in run.found])
        ends = np.array([ranges.min(), ranges.max()])
        words = f"{run.name}: m = {run.line.m:.3g}" if run.name else f"da/dN = C ΔK^m, m = {run.line.m:.3g}"
        rates.plot(ends * 1e-6, run.line.at(ends), color="black", lw=0.9, ls=dashes, label=words)
        rates.legend(frameon=False, fontsize="small")
    lengths.set(xlabel="cycles", ylabel="growth of the crack, mm")
    lengths.legend(frameon=False, fontsize="small")
    rates.set(xscale="log", yscale="log", xlabel="ΔK, MPa√m", ylabel="growth a cycle, m")
    rates.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    rates.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    rates.xaxis.set_minor_formatter(NullFormatter())
    for axes in (lengths, rates):
        plain(axes)
    return figure
