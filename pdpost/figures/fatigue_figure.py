"""Growth of cracks by fatigue as a figure: length over cycles, growth a cycle over the range of intensity, and lives of
smooth bodies over the range of stretch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdpost.figures.charts import WIDTH, look, plain
from pdsolve.measures.fatigue import FIRST, FatigueLife, TipFatigueGrowth, effective_dK_between_frames

WIDER = 3.0  # times the range of the points that Wöhler's line is drawn over


def fatigue(runs: Sequence[FatigueLife]) -> Figure:
    """A panel of lengths and one of growth a cycle where cracks of plates grow, one of areas of bodies in space, and
    one of lives where smooth bodies break."""
    areas = [(run, run.area_growth) for run in runs if run.area_growth is not None]
    cracked = [run for run in runs if run.tip_growths]
    smooth = [
        run
        for run in runs
        if not (run.tip_growths or run.area_growth)
        or (run.fatigue_law.A1 is not None and run.first_break_cycles is not None)
    ]
    of_K = [run for run in cracked if not run.K_refusal]
    panels = bool(cracked) + bool(of_K) + bool(areas) + bool(smooth)
    scale = "log" if any(run.spans_orders_of_magnitude for run in runs) else "linear"
    figure = Figure(figsize=(WIDTH * max(panels, 1.2) / 2, 3.4), layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0].tolist()
    if cracked:
        for number, (run, growth) in enumerate(_tips(cracked)):
            label = f"{for_legend(run.name)}, {growth.name}" if len(runs) > 1 else growth.name
            axes[0].plot(growth.cycles, growth.grown_length * 1e3, marker=".", lw=1.2, label=label, **look(number))
        axes[0].set(xlabel="cycles", ylabel="growth of the crack, mm", xscale=scale)
        axes[0].legend(frameon=False, fontsize="small")
    if of_K:
        _growth(axes[1], of_K, len(runs) > 1)
    if areas:
        opened = axes[bool(cracked) + bool(of_K)]
        for number, (run, (cycles, area)) in enumerate(areas):
            opened.plot(cycles, area * 1e6, marker=".", lw=1.2, label=for_legend(run.name), **look(number))
        opened.set(xlabel="cycles", ylabel="area that opened, mm²", xscale=scale)
        opened.legend(frameon=False, fontsize="small")
    if smooth:
        _lives(axes[-1], smooth)
    for panel in axes:
        plain(panel)
    return figure


def _tips(runs: Sequence[FatigueLife]) -> list[tuple[FatigueLife, TipFatigueGrowth]]:
    return [(run, growth) for run in runs for growth in run.tip_growths]


def _growth(axes: Axes, runs: Sequence[FatigueLife], named: bool) -> None:
    """Points, hollow at the start of a crack, where they are off the line; the line through them, and that given."""
    for number, (run, growth) in enumerate(_tips(runs)):
        colour = look(number)["color"]
        dK = effective_dK_between_frames(growth, run.paris_line.m if run.paris_line is not None else FIRST)
        for point_mask, fill in ((growth.is_past_slow_start, colour), (~growth.is_past_slow_start, "white")):
            axes.plot(
                dK[point_mask] * 1e-6, growth.growth_per_cycle[point_mask], "o", ms=4, mfc=fill, mec=colour, ls="none"
            )
    for run, dashes in zip(runs, ("--", ":", "-."), strict=False):
        ranges = np.concatenate([growth.dK for growth in run.tip_growths])
        ends, of = np.array([ranges.min(), ranges.max()]), f"{for_legend(run.name)}: " if named else ""
        if run.paris_line is not None:
            words = f"{of}measured, m = {run.paris_line.m:.3g}"
            axes.plot(ends * 1e-6, run.paris_line.growth_per_cycle(ends), color="black", lw=0.9, ls=dashes, label=words)
        law_rate = run.growth_per_cycle_of_input_law(ends)
        if law_rate is not None:
            words = f"{of}given, m = {run.fatigue_law.m:.3g}"
            axes.plot(ends * 1e-6, law_rate, color="0.6", lw=2.5, alpha=0.6, ls=dashes, label=words, zorder=0)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(frameon=False, fontsize="small")
    axes.set(xscale="log", yscale="log", xlabel="ΔK, MPa√m", ylabel="growth a cycle, m")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _lives(axes: Axes, runs: Sequence[FatigueLife]) -> None:
    """Cycles until the first bonds break over the range of their stretch, beside the lines that runs were given."""
    broke = [
        (run.first_break_strain_range, run.first_break_cycles)
        for run in runs
        if run.first_break_strain_range is not None and run.first_break_cycles is not None
    ]
    points = np.array(broke).reshape(-1, 2)
    plotted_laws = set()
    for run in runs:
        if (
            run.fatigue_law.A1 is None
            or not len(points)
            or (run.fatigue_law.A1, run.fatigue_law.m1, run.fatigue_law.endurance) in plotted_laws
        ):
            continue
        plotted_laws.add((run.fatigue_law.A1, run.fatigue_law.m1, run.fatigue_law.endurance))
        low = max(points[:, 0].min() / WIDER, run.fatigue_law.endurance)
        eps = np.geomspace(low * (1 + 1e-9), points[:, 0].max() * WIDER, 50)
        axes.plot(
            run.woehler_cycles_to_break(eps),
            eps,
            color="black",
            lw=0.9,
            label=f"given, m = {run.fatigue_law.m1:.3g}",
        )
        if run.fatigue_law.endurance > 0:
            axes.axhline(run.fatigue_law.endurance, color="0.6", lw=0.9, ls=":", label="endurance")
    for number, run in enumerate(runs):
        if run.first_break_cycles is not None and run.first_break_strain_range is not None:
            axes.plot(
                run.first_break_cycles,
                run.first_break_strain_range,
                "o",
                ms=5,
                color=look(number)["color"],
                label=for_legend(run.name),
            )
    axes.set(xscale="log", yscale="log", xlabel="cycles until the first bonds break", ylabel="range of stretch")
    if axes.get_legend_handles_labels()[1]:
        axes.legend(frameon=False, fontsize="small")
