"""Growth of cracks by fatigue as a figure: length over cycles, and growth a cycle over the range of intensity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pdpost.figures.charts import WIDTH, look, plain
from pdpost.measures.fatigue import FIRST, Growth, Line, between


def fatigue(found: Sequence[Growth], line: Line | None) -> Figure:
    """Both panels; points at the start of a crack, which are off the line, are hollow."""
    figure = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    lengths, rates = figure.subplots(1, 2)
    for number, one in enumerate(found):
        style = look(number)
        lengths.plot(one.cycles, one.length * 1e3, marker=".", lw=1.2, label=one.name, **style)
        dK = between(one, line.m if line is not None else FIRST)
        for some, fill in ((one.settled, style["color"]), (~one.settled, "white")):
            x, y = dK[some] * 1e-6, one.rate[some]
            rates.plot(x, y, "o", ms=4, mfc=fill, mec=style["color"], ls="none")
    if line is not None:
        ranges = np.concatenate([one.dK for one in found])
        ends = np.array([ranges.min(), ranges.max()])
        words = f"da/dN = C ΔK^m, m = {line.m:.3g}"
        rates.plot(ends * 1e-6, line.at(ends), color="black", lw=0.9, ls="--", label=words)
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
