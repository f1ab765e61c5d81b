"""Curves with units, in colours that colour-blind readers can tell apart; a figure is returned, never shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from pdmesh.model.amounts import way
from pdmesh.model.output_fields import FIELDS
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_legend
from pdpost.figures.colours import scaled, scaled_times, ten_to
from pdpost.figures.style import COLOURS
from pdsolve.measures import fields
from pdsolve.measures.balance import AMOUNTS, EnergyBalance, MassBalance
from pdsolve.measures.forces import STILL, ConditionForceHistory, ForceOpeningCurve
from pdsolve.measures.histories import NodeHistory
from pdsolve.measures.measured_curve import MeasuredCurve

if TYPE_CHECKING:
    from pdsolve.measures.lines import FieldAlongLine  # which would import SciPy

DASHES = ("-", "--", "-.", ":")
WIDTH = 7.0  # inches
WIDE_BAND, CURVE_MARGIN = 4.0, 0.5  # of the span of curves: the band that is cut off, and what the axis shows of it


def look(number: int) -> dict[str, Any]:
    """Colour and dashes of curve `number`; the dashes change after the last colour."""
    return {"color": COLOURS[number % len(COLOURS)], "ls": DASHES[number // len(COLOURS) % len(DASHES)]}


def plain(axes: Axes) -> None:
    """Style axes: no box, light grid lines."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", lw=0.5)
    axes.set_axisbelow(True)


def _limits_of_curves_in_wide_bands(curves: list[NodeHistory]) -> tuple[float, float] | None:
    """Limits of an axis by the values of curves alone, if their bands would flatten them; else None."""
    values, sides = (
        np.concatenate([np.zeros(0), *columns])
        for columns in zip(*((curve.value, np.append(curve.smallest, curve.largest)) for curve in curves), strict=True)
    )
    values, sides = values[np.isfinite(values)], sides[np.isfinite(sides)]
    span = float(np.ptp(values)) if len(values) else 0.0
    if not 0 < WIDE_BAND * span < np.ptp(sides):
        return None
    return float(values.min()) - CURVE_MARGIN * span, float(values.max()) + CURVE_MARGIN * span


def histories(curves: list[NodeHistory], quantity: str, counts_load_steps: bool = False) -> Figure:
    """Histories over time, of one or several components; the range of several nodes as a band.

    The axis shows the curves, and cuts off bands that are far wider.
    """
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.add_subplot()
    plain(axes)
    letter, unit = FIELDS[quantity].symbol, fields.FIELDS[quantity].unit
    parts = dict.fromkeys(curve.component for curve in curves)
    symbols = {part: f"|{letter}|" if part == "magnitude" else f"{letter}{part}" for part in parts}
    second, when = scaled_times((curve.time for curve in curves), counts_load_steps)
    limits = _limits_of_curves_in_wide_bands(curves)
    ends = (side for curve in curves for side in (curve.smallest, curve.largest))
    factor, shown = scaled(ends if limits is None else (curve.value for curve in curves), unit)
    for number, curve in enumerate(curves):
        style = look(number)
        if len(curve.node_ids) > 1:
            sides = (curve.smallest * factor, curve.largest * factor)
            axes.fill_between(curve.time * second, *sides, color=style["color"], alpha=0.2, lw=0)
        name = curve.label
        if curve.place is not None:
            millimetres = ", ".join(f"{x * 1e3:.4g}" for x in curve.place)
            name += f" at ({millimetres}) mm".replace("-", "\N{MINUS SIGN}")
        if len(symbols) > 1:
            name += f", {symbols[curve.component]}"
        axes.plot(curve.time * second, curve.value * factor, lw=1.2, label=name, **style)
    axes.set(xlabel=when, ylabel=f"{quantity} {' and '.join(symbols.values())}, {shown}")
    axes.margins(x=0.01)
    if limits is not None:
        axes.set_ylim(*(limit * factor for limit in limits))
        axes.set_title("band: range of single nodes, cut off by the axis", fontsize="small", loc="left")
    axes.legend(frameon=False)
    return figure


def balance(books: EnergyBalance, per: str = "/m", counts_load_steps: bool = False) -> Figure:
    """Energies over time, with the error of the energy balance below; `per` is the end of the unit."""
    figure = Figure(figsize=(WIDTH, 5.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    second, when = scaled_times([books.time], counts_load_steps)
    factor, unit = scaled([books.total, books.work], f"J{per}")
    damped = (name for name in ("damped", "friction") if np.any(getattr(books, name) > 0))
    for number, name in enumerate(("kinetic", "strain", "dissipated", "total", *damped)):
        above.plot(books.time * second, getattr(books, name) * factor, lw=1.4, label=name, **look(number))
    above.plot(books.time * second, books.work * factor, color="black", ls=(0, (4, 3)), lw=1.2, label="put in")
    above.set_ylabel(f"energy per thickness, {unit}" if per else f"energy, {unit}")
    above.legend(frameon=False)
    small, _ = scaled([books.error], "")
    below.plot(books.time * second, books.error * small, lw=1.2, color="black")
    below.axhline(0, color="0.6", lw=0.6)
    power = "error over put in" if small == 1 else f"error over put in,\n{ten_to(-round(np.log10(small)))}"
    below.set(xlabel=when, ylabel=power)
    for axes in (above, below):
        plain(axes)
        axes.margins(x=0.01)
    figure.align_ylabels()
    return figure


def masses(books: MassBalance, unit: str = "mol") -> Figure:
    """Amounts of a substance or heat in this unit over time and, where a solid dissolves, the share that is left.

    An amount is that of its way at the end, and negative while it goes the other way.
    """
    dissolves = bool(np.isfinite(books.solid_share_left).any())
    figure = Figure(figsize=(WIDTH, 5.0 if dissolves else 3.2), layout="constrained")
    panels = figure.subplots(1 + dissolves, 1, sharex=True, squeeze=False)[:, 0]
    second, seconds = scaled([books.time], "s")
    over_time = {"dissolved so far": books.dissolved}
    for name in reversed(AMOUNTS):
        amount = getattr(books, name)
        over_time = {way(name, amount[-1]): np.where(amount[-1] < 0, -amount, amount), **over_time}
    shown = {word: amount for word, amount in over_time.items() if np.any(amount != 0)}
    factor, unit = scaled(list(shown.values()), unit)
    for number, (word, amount) in enumerate(shown.items()):
        panels[-1].plot(books.time * second, amount * factor, lw=1.4, label=word, **look(number))
    panels[-1].set(xlabel=f"time, {seconds}", ylabel=f"amount, {unit}")
    if dissolves:
        panels[0].plot(books.time * second, books.solid_share_left, lw=1.4, label="solid", **look(0))
        panels[0].plot(
            books.time * second,
            books.solid_surface_area / books.solid_surface_area[0],
            lw=1.4,
            label="its surface",
            **look(1),
        )
        panels[0].set_ylabel("share that is left")
    for axes in panels:
        plain(axes)
        axes.margins(x=0.01)
        axes.legend(frameon=False)
    figure.align_ylabels()
    return figure


def reactions(
    chosen_reactions: list[ConditionForceHistory],
    axis: int | None = None,
    per: str = "/m",
    measured: MeasuredCurve | None = None,
    counts_load_steps: bool = False,
) -> Figure:
    """Forces over time, or load steps, and over the mean displacement of their nodes, with measured ones as points.

    Components are along `axis`, or along each condition's own axis; `per` is the end of the unit.
    """
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    over_time, over_way = figure.subplots(1, 2, sharey=True)
    axes_of = [curve.main_axis if axis is None else axis for curve in chosen_reactions]
    second, when = scaled_times((curve.time for curve in chosen_reactions), counts_load_steps)
    newton, newtons = scaled(
        (curve.force[:, at] for curve, at in zip(chosen_reactions, axes_of, strict=True)), f"N{per}"
    )
    metre, metres = scaled(
        (curve.displacement[:, at] for curve, at in zip(chosen_reactions, axes_of, strict=True)), "m"
    )
    most = (
        max(float(np.ptp(curve.displacement[:, at])) for curve, at in zip(chosen_reactions, axes_of, strict=True))
        * metre
    )
    for number, (curve, at) in enumerate(zip(chosen_reactions, axes_of, strict=True)):
        force = curve.force[:, at] * newton
        label = f"{for_legend(curve.name)} ({curve.kind}), {'xyz'[at]}"
        over_time.plot(curve.time * second, force, lw=1.2, label=label, **look(number))
        way = curve.displacement[:, at] * metre
        if np.ptp(way) >= STILL * most:
            over_way.plot(way, force, lw=1.2, **look(number))
    if measured is not None:
        over_way.plot(measured.displacement * metre, measured.force * newton, "o", color="black", ms=3)
        over_time.plot([], [], "o", color="black", ms=3, label=for_legend(measured.name))
    over_time.set(xlabel=when, ylabel=f"force on the {'plate' if per else 'body'}, {newtons}")
    over_way.set(xlabel=f"mean displacement, {metres}")
    for panel in (over_time, over_way):
        plain(panel)
    figure.legend(*over_time.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure


def load_displacement(curves: list[ConditionForceHistory], per: str = "/m") -> Figure:
    """Force against displacement of conditions, both along the axis of the force, with their peaks.

    `per` is the end of the unit of force.
    """
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    axes = figure.add_subplot()
    plain(axes)
    newton, newtons = scaled((curve.force_along_axis for curve in curves), f"N{per}")
    metre, metres = scaled((curve.displacement_along_axis for curve in curves), "m")
    for number, curve in enumerate(curves):
        style = look(number) | {"ls": ("-", (0, (4, 2)))[number % 2]}  # of curves that lie on each other both are seen
        x, y = curve.displacement_along_axis * metre, curve.force_along_axis * newton
        axes.plot(x, y, lw=1.4, label=f"{for_legend(curve.name)} ({curve.kind}), {'xyz'[curve.main_axis]}", **style)
        axes.plot(x[curve.peak_index], y[curve.peak_index], "o", ms=4, color=style["color"])
    thickness = " per thickness" if per else ""
    axes.set(xlabel=f"mean displacement, {metres}", ylabel=f"force{thickness}, {newtons}")
    axes.legend(frameon=False)
    return figure


def openings(opening_curves: list[ForceOpeningCurve], per: str = "/m", measured: MeasuredCurve | None = None) -> Figure:
    """Forces against the opening of a gap with their peaks, the areas below, and measured forces as points.

    `per` is the end of the unit.
    """
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.add_subplot()
    plain(axes)
    newton, newtons = scaled((curve.force for curve in opening_curves), f"N{per}")
    metre, metres = scaled((curve.opening for curve in opening_curves), "m")
    for number, curve in enumerate(opening_curves):
        style, (x, y) = look(number), (curve.opening * metre, curve.force * newton)
        axes.plot(
            x,
            y,
            lw=1.2,
            label=f"{for_legend(curve.condition_name)}, {'xyz'[curve.axis]}: {abs(curve.work_under_curve):.4g} J{per}",
            **style,
        )
        axes.fill_between(x, y, color=style["color"], alpha=0.08, lw=0)
        axes.plot(x[curve.peak_force_index], y[curve.peak_force_index], "o", ms=4, color=style["color"])
        said = f"{y[curve.peak_force_index]:.4g} {newtons} at {x[curve.peak_force_index]:.3g} {metres}"
        axes.annotate(
            said,
            (x[curve.peak_force_index], y[curve.peak_force_index]),
            (6, 4),
            textcoords="offset points",
            va="bottom",
            fontsize=8,
        )
    if measured is not None:
        places = (measured.displacement * metre, measured.force * newton)
        axes.plot(*places, "o", color="black", ms=3, label=for_legend(measured.name))
    axes.set(xlabel=f"opening, {metres}", ylabel=f"force on the {'plate' if per else 'body'}, {newtons}")
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def line(sampled_line: FieldAlongLine, name: str, parts: Sequence[str], title: str) -> Figure:
    """Components of the field `name` along a line, with gaps where there is no value."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.add_subplot(title=title)
    plain(axes)
    metre, metres = scaled([sampled_line.distance_from_start], "m")
    factor, shown = scaled((sampled_line.component_values[part] for part in parts), fields.FIELDS[name].unit)
    for number, part in enumerate(parts):
        axes.plot(
            sampled_line.distance_from_start * metre,
            sampled_line.component_values[part] * factor,
            lw=1.2,
            label=part,
            **look(number),
        )
    quantity = fields.FIELDS[name].title.lower()
    axes.set(xlabel=f"along the line, {metres}", ylabel=f"{quantity}, {shown}" if shown else quantity)
    axes.set_xlim(0, float(sampled_line.distance_from_start[-1]) * metre)
    if parts != [""]:
        axes.legend(frameon=False)
    return figure
