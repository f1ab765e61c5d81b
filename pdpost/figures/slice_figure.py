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
    _explain(figure, int((~np.isfinite(section.values)).sum()))
    return figure


class Sections:
    """Three planes through the middle of a body: front, side and top views."""

    def __init__(self, results: Results, name: str, part: str, range_of: Colours) -> None:
        self._results, self._name, self._part, self._range = results, name, part, range_of
        nodes, self._middle = results.nodes(0), default_slice_point(results)
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
        reach = nodes.delta.max() / 2 + GAP * float((high - low).max())
        self._low, self._high = low - reach, high + reach
        self._metre, self._metres = scaled([low, high], "m")
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
        self._colours = mappable(range_of)
        self.figure.colorbar(
            self._colours, ax=rest, location="top", fraction=0.2, label=range_of.full_label, extend=range_of.beyond
        )

    def draw(self, step: int, shown: NDArray[np.float64]) -> list[Artist]:
        """Draw a frame's values (n,) on the planes; returns the artists, which the caller may remove."""
        painted: list[Artist] = []
        for axis, axes in self._panels.items():
            section = slice_field_values_by_plane(
                self._results, shown, step, axis, float(self._middle[AXES.index(axis)])
            )
            painted += _paint(axes, section, self._range, self._colours, self._metre)
            _named(axes, section, self._metres)
            axes.set_title(_place(section, self._metre, self._metres), fontsize="small")
            rows = [AXES.index(letter) for letter in section.plane_axes]
            (x0, y0), (x1, y1) = self._low[rows] * self._metre, self._high[rows] * self._metre
            axes.set(xlim=(x0, x1), ylim=(y0, y1))
        self.figure.suptitle(f"{caption(self._name, self._part)} {at(self._results, step)}", fontsize="medium")
        return painted


def sections(
    results: Results, name: str, step: int, part: str, shown: NDArray[np.float64], largest: float | None = None
) -> Figure:
    """Values (n,) of the component `part` of a field on three planes through the middle of a body."""
    planes = Sections(results, name, part, colours(name, part, shown, largest))
    planes.draw(step, shown)
    _explain(planes.figure, int((~np.isfinite(shown)).sum()))
    return planes.figure


def film(
    results: Results,
    name: str,
    part: str,
    every: int,
    dpi: float,
    largest: float | None,
    progress: Callable[[list[int]], Iterable[int]],
) -> Iterator[Pixels]:
    """Pictures of `sections` for every `every`-th frame with one colour range, in the format of `animation.frames`."""
    steps = chosen(results, every)
    extremes = np.zeros(1) if largest is None else np.array([-largest, largest])
    if largest is None:
        largest, *ends = field_range(results, name, part, steps)
        extremes = np.array(ends)
    planes = Sections(results, name, part, colours(name, part, extremes, largest))
    last = reliable_field_values(results, name, steps[-1], part or None)  # where most is left out
    _explain(planes.figure, int((~np.isfinite(last)).sum()))
    canvas = FigureCanvasAgg(planes.figure)
    planes.figure.set_dpi(dpi)
    for step in progress(steps):
        painted = planes.draw(step, reliable_field_values(results, name, step, part or None))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
        for artist in painted:
            artist.remove()


def field_range(results: Results, name: str, part: str, steps: list[int]) -> tuple[float | None, float, float]:
    """End of the colour range of all frames, None if there is nothing to show, and the smallest and largest value."""
    frame_values = [
        array[np.isfinite(array)]
        for array in (reliable_field_values(results, name, step, part or None) for step in steps)
    ]
    ends = [(float(array.min(initial=0.0)), float(array.max(initial=0.0))) for array in frame_values]
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


def _explain(figure: Figure, left_out: int) -> None:
    """Put a legend on the figure for the number of squares left out, if there are some."""
    if left_out:
        key = patch(TORN, f"left out, most bonds gone or no value: {left_out} nodes")
        figure.legend(handles=[key], loc="outside lower center", frameon=False, fontsize="small")


def _named(axes: Axes, section: FieldSlice, metres: str) -> None:
    axes.set(xlabel=f"{section.plane_axes[0]}, {metres}", ylabel=f"{section.plane_axes[1]}, {metres}")


def _place(section: FieldSlice, metre: float, metres: str) -> str:
    (third,) = set(AXES) - set(section.plane_axes)
    return f"{third} = {section.plane_position * metre + 0.0:.4g} {metres}"
