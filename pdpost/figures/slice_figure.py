"""Sections of a body in space: one plane, or three through its middle. Each node that a plane cuts is a square."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.text import Text
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.colours import SHARES, Colours, at, caption, colours, mappable, scaled, share_end, usual
from pdpost.figures.sheets import HATCHES, INK, patch
from pdpost.figures.style import TORN
from pdsolve.measures.frame_steps import chosen
from pdsolve.measures.slices import (
    AXES,
    FieldSlice,
    default_slice_point,
    reliable_field_values,
    slice_field_values_by_plane,
)
from pdsolve.results import Results

CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
WIDTH, TALLEST, LEAST = 6.0, 7.0, 3.2  # inches
AROUND = 1.3  # inches, for axes and what is written
FLATTEST = 0.3  # of the larger of two panels side by side or below each other: room for what is written
GAP = 0.02  # of the body, around it

Pixels = NDArray[np.uint8]  # (rows, columns, 3)


def plane(
    results: Results, section: FieldSlice, name: str, part: str, step: int, largest: float | None = None
) -> Figure:
    """The field `name` on a plane; the colour range ends at `largest` (SI) or at the usual largest value."""
    range_of = colours(name, part, section.values, largest)
    size = np.ptp(section.plane_coordinates, axis=0) + section.spacing.max()
    figure = Figure(figsize=(WIDTH, min(TALLEST, 1.0 + (WIDTH - 1.5) * size[1] / size[0])), layout="constrained")
    axes = figure.add_subplot(aspect="equal")
    painted = mappable(range_of)
    metre, metres = scaled([section.plane_coordinates], "m")
    _paint(axes, section, range_of, painted, metre)
    axes.autoscale_view()
    axes.margins(0.01)
    figure.colorbar(painted, ax=axes, label=range_of.full_label, extend=range_of.beyond)
    _named(axes, section, metres)
    axes.set_title(f"{caption(name, part)} at {_place(section, metre, metres)} {at(results, step)}")
    if left_out := int((~np.isfinite(section.values)).sum()):
        _explain(figure, left_out)
    return figure


class Sections:
    """One plane, or three through the middle of a body: front, side and top views."""

    def __init__(
        self, results: Results, name: str, part: str, range_of: Colours, cut: tuple[str, float] | None = None
    ) -> None:
        self._results, self._name, self._part, self._range = results, name, part, range_of
        nodes = results.nodes(0)
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        reach = nodes.delta.max() / 2 + GAP * float((high - low).max())
        self._low, self._high = low - reach, high + reach
        self._metre, self._metres = scaled([low, high], "m")
        self._colours = mappable(range_of)
        self._legend: Text | None = None
        self._places = (
            dict(zip(AXES, default_slice_point(results).tolist(), strict=True)) if cut is None else dict([cut])
        )
        if cut is None:
            bar = self._lay_out_three()
        else:
            across, up = (self._high - self._low)[[at for at, axis in enumerate(AXES) if axis != cut[0]]]
            tall = max(min(TALLEST, 1.0 + (WIDTH - 1.5) * up / across), LEAST)
            self.figure = Figure(figsize=(WIDTH, tall), layout="constrained")
            self._panels = {cut[0]: self.figure.add_subplot(aspect="equal")}
            bar = {"ax": self._panels[cut[0]]}
        self.figure.colorbar(self._colours, label=range_of.full_label, extend=range_of.beyond, **bar)

    def _lay_out_three(self) -> dict[str, Any]:
        """Make the figure with three panels; returns where its colour bar stands."""
        x, y, z = self._high - self._low
        wide, tall = (max(y, FLATTEST * x), max(y, FLATTEST * z))
        scale = min((WIDTH + 1.0) / (x + wide), TALLEST / (z + tall))
        size = scale * (x + wide) + AROUND, max(scale * (z + tall) + AROUND, LEAST)
        self.figure = Figure(figsize=size, layout="constrained")
        grid = self.figure.add_gridspec(2, 2, width_ratios=(x, wide), height_ratios=(z, tall))
        places = ("y", grid[0, 0]), ("x", grid[0, 1]), ("z", grid[1, 0])
        self._panels = {axis: self.figure.add_subplot(place, aspect="equal") for axis, place in places}
        rest = self.figure.add_subplot(grid[1, 1])
        rest.set_axis_off()
        return {"ax": rest, "location": "top", "fraction": 0.2}

    def draw(self, step: int, shown: NDArray[np.float64]) -> list[Artist]:
        """Draw a frame's values (n,) on the planes; returns the artists, which the caller may remove."""
        painted: list[Artist] = []
        left_out: set[int] = set()
        for axis, axes in self._panels.items():
            section = slice_field_values_by_plane(self._results, shown, step, axis, self._places[axis])
            painted += _paint(axes, section, self._range, self._colours, self._metre)
            left_out.update(section.node_rows[~np.isfinite(section.values)].tolist())
            _named(axes, section, self._metres)
            place = _place(section, self._metre, self._metres)
            if len(self._panels) == 1:
                axes.set_title(f"{caption(self._name, self._part)} at {place} {at(self._results, step)}")
            else:
                axes.set_title(place, fontsize="small")
            rows = [AXES.index(letter) for letter in section.plane_axes]
            (x0, y0), (x1, y1) = self._low[rows] * self._metre, self._high[rows] * self._metre
            axes.set(xlim=(x0, x1), ylim=(y0, y1))
        if len(self._panels) > 1:
            self.figure.suptitle(f"{caption(self._name, self._part)} {at(self._results, step)}", fontsize="medium")
        if left_out and self._legend is None:
            self._legend = _explain(self.figure, len(left_out))
        elif self._legend is not None:
            self._legend.set_text(_left_out(len(left_out)))
        return painted


def sections(
    results: Results, name: str, step: int, part: str, shown: NDArray[np.float64], largest: float | None = None
) -> Figure:
    """Values (n,) of the component `part` of a field on three planes through the middle of a body."""
    planes = Sections(results, name, part, colours(name, part, shown, largest))
    planes.draw(step, shown)
    return planes.figure


def film(
    results: Results,
    name: str,
    part: str,
    every: int,
    dpi: float,
    largest: float | None,
    progress: Callable[[list[int]], Iterable[int]],
    cut: tuple[str, float] | None = None,
) -> Iterator[Pixels]:
    """Pictures of every `every`-th frame with one colour range, in the format of `animation.frames`.

    They are those of `sections`, or of the plane `cut` (axis, m) alone.
    """
    steps = chosen(results, every)
    extremes = np.zeros(1) if largest is None else np.array([-largest, largest])
    if largest is None:
        largest, *ends = field_range(results, name, part, steps)
        extremes = np.array(ends)
    planes = Sections(results, name, part, colours(name, part, extremes, largest), cut)
    canvas = FigureCanvasAgg(planes.figure)
    planes.figure.set_dpi(dpi)
    painted: list[Artist] = planes.draw(steps[-1], reliable_field_values(results, name, steps[-1], part or None))
    for step in progress(steps):  # after the last one, where most is left out, so that the legend has its room
        for artist in painted:
            artist.remove()
        painted = planes.draw(step, reliable_field_values(results, name, step, part or None))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def field_range(results: Results, name: str, part: str, steps: list[int]) -> tuple[float | None, float, float]:
    """End of the colour range of all frames, None if there is nothing to show, and the smallest and largest value."""
    frame_values = [
        array[np.isfinite(array)]
        for array in (reliable_field_values(results, name, step, part or None) for step in steps)
    ]
    ends = [(float(array.min()), float(array.max())) if len(array) else (0.0, 0.0) for array in frame_values]
    shares = np.array([high for _, high in ends])
    largest = share_end(shares) if name in SHARES else max(map(usual, frame_values)) or None
    return largest, min(low for low, _ in ends), max(high for _, high in ends)


def _paint(
    axes: Axes, section: FieldSlice, range_of: Colours, painted: ScalarMappable, metre: float
) -> list[PolyCollection]:
    """Draw the squares of a plane; those without a value are hatched."""
    squares = (section.plane_coordinates[:, None, :] + section.spacing[:, None, None] * CORNERS) * metre
    paint = painted.to_rgba(np.ma.masked_invalid(section.values * range_of.factor))
    left_out = ~np.isfinite(section.values)
    paint[left_out] = to_rgba(TORN)
    collections = [PolyCollection(squares, facecolors=paint, edgecolors=paint, linewidths=0.5)]
    if left_out.any():
        how: dict[str, Any] = {"facecolors": "none", "edgecolors": INK, "linewidths": 0, "hatch": HATCHES[TORN]}
        collections.append(PolyCollection(squares[left_out], **how))
    for collection in collections:
        axes.add_collection(collection)
    return collections


def _explain(figure: Figure, left_out: int) -> Text:
    """Put a legend on the figure for the number of squares left out; returns its text."""
    key = patch(TORN, _left_out(left_out))
    legend = figure.legend(handles=[key], loc="outside lower center", frameon=False, fontsize="small")
    return legend.get_texts()[0]


def _left_out(count: int) -> str:
    return f"left out, most bonds gone or no value: {count} nodes"


def _named(axes: Axes, section: FieldSlice, metres: str) -> None:
    axes.set(xlabel=f"{section.plane_axes[0]}, {metres}", ylabel=f"{section.plane_axes[1]}, {metres}")


def _place(section: FieldSlice, metre: float, metres: str) -> str:
    (third,) = set(AXES) - set(section.plane_axes)
    return f"{third} = {section.plane_position * metre + 0.0:.4g} {metres}"
