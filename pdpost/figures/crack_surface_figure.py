"""The cracks of a body as a figure: their surface, coloured by when it opened, and its area and energy over time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure
from pdpost.figures.charts import WIDTH, look, plain
from pdpost.figures.colours import Opening, opening_colours, scaled, scaled_times
from pdsolve.measures.crack_3d import CrackSurfaceSummary
from pdsolve.measures.crack_fronts import line_length
from pdsolve.measures.frame_steps import moment_text
from pdsolve.results import Results

VIEW = (25.0, -60.0)  # degrees: height and turn of the eye
LIGHT = np.array([-0.35, -0.45, 0.82])  # from where the light comes
DARKEST = 0.45  # of a face along the light
AROUND = 0.4  # of the largest extent of the cracks: what is shown beside them
LONG = 0.4  # of the root of the area that opened: the shortest line of the front that is drawn
TALL, FLATTEST, CHARTS, ZOOM = 5.4, 0.55, 2.3, 0.95  # inches: of the body, least share of it, and of the charts
TICKS = 6  # along the longest side
TICK_PAD, LABEL_PAD = 11.5, 33.0  # points without zoom: from an axis to its numbers and to its name
TICK_ADDED, LABEL_ADDED = 8.0, 21.0  # points: of these, what matplotlib adds to what it is given
OLD, FRONT, BOX = "0.75", "black", "0.6"  # colours of pre-cracks, of the front and of the body's box
ENDS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
SIDES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def crack_surface(results: Results, summary: CrackSurfaceSummary) -> Figure:
    """The surface of the cracks in a body and, once something opened, area and energy per area over time."""
    opened = bool(summary.surface.face_opened_during_run.any())
    low, high = _seen_box(results, summary)
    tall = TALL * _share_of_height(low, high)
    figure = Figure(figsize=(WIDTH, tall + CHARTS * opened), layout="constrained")
    parts = figure.add_gridspec(1 + opened, 1, height_ratios=(tall, CHARTS)[: 1 + opened])
    body = figure.add_subfigure(parts[0])
    axes = body.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    colours = _surface(axes, results, summary)
    when = moment_text(summary.step * float(results.meta()["time_step"]), summary.counts_load_steps, micro="µs")
    figure.suptitle(f"Surface of the crack at {when}" if opened else f"No crack has grown at {when}", fontsize="medium")
    if opened:
        # on the left: labels of the axis z stand beyond the panel's right edge
        body.colorbar(colours.painted, ax=axes, label=colours.label, shrink=0.6, location="left", extend="max")
        panels = figure.add_subfigure(parts[1]).subplots(1, 1 + (summary.cycles is None), squeeze=False)[0]
        _charts(panels, summary)
    keys: list[Artist] = []
    if not summary.surface.face_opened_during_run.all():
        keys.append(Patch(color=OLD, label="pre-crack"))
    if _long_front_lines(summary):
        keys.append(Line2D([], [], color=FRONT, lw=1.0, label="crack front"))
    if keys:
        axes.legend(handles=keys, loc="upper left", frameon=False, fontsize="small")
    return figure


def _charts(panels: Iterable[Axes], summary: CrackSurfaceSummary) -> None:
    """Draw area and energy per area over time; of fatigue the area alone, over cycles, as bonds have no G0 there."""
    factor, label = scaled_times([summary.frame_time], summary.counts_load_steps)
    times = summary.frame_time * factor
    if summary.cycles is not None:
        times, label = summary.cycles, "cycles"
    area, *others = panels
    plain(area)
    area.plot(times, summary.grown_area * 1e6, lw=1.3, **look(0))
    area.set(xlabel=label, ylabel="area that opened, mm²")
    for release in others:
        plain(release)
        release.plot(times, summary.dissipated_energy_per_area / summary.G0, lw=1.3, **look(1))
        release.axhline(1.0, color="0.5", lw=0.8, ls=":")
        release.set(xlabel=label, ylabel="dissipated / area / G₀", ylim=(0, None))


def _seen_box(results: Results, summary: CrackSurfaceSummary) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner (3,), m, of the part of the body around the cracks."""
    surface, nodes = summary.surface, results.nodes(0)
    half = nodes.delta[:, None] / 2
    low, high = (nodes.position - half).min(axis=0), (nodes.position + half).max(axis=0)
    if len(surface.face_corners):
        ends = surface.corners.min(axis=0), surface.corners.max(axis=0)
        around = AROUND * float(np.max(ends[1] - ends[0]))
        low, high = np.maximum(low, ends[0] - around), np.minimum(high, ends[1] + around)
    return low, high


def _share_of_height(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """Height of the panel of a box over that of a cube's: flat boxes need less."""
    return float(np.clip((high - low)[2] / (high - low)[:2].max(), FLATTEST, 1.0))


def _long_front_lines(summary: CrackSurfaceSummary) -> list[NDArray[np.float64]]:
    """Lines (k, 3), m, of the front that are long beside the crack; others surround single faces that did not open."""
    surface = summary.surface
    side = float(np.sqrt(surface.face_area[surface.face_opened_during_run].sum()))
    return [line for line in summary.front_lines if line_length(line) >= LONG * side]


def _surface(axes: Axes3D, results: Results, summary: CrackSurfaceSummary) -> Opening:
    """Draw the faces, the front and the box of the body; returns the colours of what opened."""
    surface = summary.surface
    low, high = _seen_box(results, summary)
    metre, metres = scaled([low, high], "m")
    opening = opening_colours(surface, summary.counts_load_steps)
    colours = opening.painted.to_rgba(surface.opening_time * opening.factor)
    colours[~surface.face_opened_during_run] = to_rgba(OLD)
    if len(surface.face_corners):
        quads = surface.corners[surface.face_corners]
        normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
        brightness = DARKEST + (1 - DARKEST) * np.abs(normal @ LIGHT)  # lit alike on both sides
        colours[:, :3] *= brightness[:, None]
        axes.add_collection3d(
            Poly3DCollection(quads * metre, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=1)
        )
    if front := _long_front_lines(summary):
        lines = [line * metre for line in front]
        axes.add_collection3d(Line3DCollection(lines, colors=FRONT, linewidths=1.0, zorder=2))
    box = (low + ENDS * (high - low)) * metre
    axes.add_collection3d(Line3DCollection([box[list(side)] for side in SIDES], colors=BOX, linewidths=0.6, zorder=0))
    axes.computed_zorder = False
    zoom = ZOOM / _share_of_height(low, high)
    for name, lower, upper in zip("xyz", low * metre, high * metre, strict=True):
        axis = getattr(axes, f"{name}axis")
        getattr(axes, f"set_{name}lim")(lower, upper)
        # what stands between an axis, its numbers and its name grows with the zoom
        axis.set_tick_params(pad=TICK_PAD / zoom - TICK_ADDED)
        getattr(axes, f"set_{name}label")(f"{name}, {metres}", labelpad=LABEL_PAD / zoom - LABEL_ADDED)
        bins = round(TICKS * (upper - lower) / float(np.ptp([low, high], axis=0).max() * metre))
        if bins > 1:
            axes.locator_params(axis=name, nbins=bins)
        else:
            axis.set_ticks([lower, upper], [f"{lower:.3g}", f"{upper:.3g}"])
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.view_init(*VIEW)
    axes.grid(visible=False)
    return opening
