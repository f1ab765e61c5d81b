"""The sheet that a plate is drawn on: its size, axes in convenient units, and nodes, deformed or not."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib import rc_context, rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Curve
from numpy.typing import NDArray

from pdmesh.model.neighbours import tree_of
from pdmesh.plain_figure import Figure
from pdpost.figures import raster
from pdpost.figures.colours import prefixed
from pdpost.figures.deformed_cells import deformed_corner_offsets
from pdpost.figures.raster import Box, around, outlines
from pdpost.figures.style import BLACK, EDGE, GROWN, THICK, THIN, TORN, UNKNOWN, narrow
from pdsolve.fracture.crack_particles import arms, until
from pdsolve.fracture.gradients import gradients_of
from pdsolve.measures import plate_geometry
from pdsolve.measures.frame_steps import vector
from pdsolve.measures.plate_geometry import PlateGeometry, VoronoiCells, clipped_voronoi_cells, read_plate_geometry
from pdsolve.measures.strain import families_without_broken_bonds
from pdsolve.results import Results

TALLEST, FLATTEST = 6.5, 1.2  # inches, of the plate
LEAST = 4.0  # inches of a whole sheet, for what is written above it; less where a figure is to be narrower
LEFT, RIGHT, BELOW, ABOVE = 0.65, 0.95, 0.5, 0.4  # inches around it
SHOWN = 0.05  # of the plate: how far displacements move nodes where the scale is chosen for them
MARGIN = 0.01  # of the plate, around it
TORN_APART = 2.0  # spacings between two places a spacing apart, where a crack lies between them
ROOM = 0.2  # of the plate, around it, for what is displaced
STRETCHED = 0.75  # spacings: half of what nodes are apart at most where no gap is seen between them
HATCHES = {TORN: "////", UNKNOWN: "xxxx"}  # of what is left out
INK, HATCHED = "0.35", 0.5  # colour and width, points, of these lines


class Shape(NamedTuple):
    """Nodes at the places where they are drawn, and their plate."""

    plate: PlateGeometry
    position: NDArray[np.float64]  # (n, 2) m
    reference: NDArray[np.float64]  # (n, 2) m, where they were
    delta: NDArray[np.float64]  # (n,) m
    cells: VoronoiCells | None  # None where there are too many to draw them one by one
    corners: NDArray[np.float64] | None  # (c, 2) m, offsets of the deformed cells' corners; None: as they were
    scale: float  # what their displacement is multiplied by
    epoch: int  # the first step with these nodes
    grown: NDArray[np.float64] = np.zeros((0, 2, 2))  # (k, 2, 2) m: arms of cracks that are particles, grown by now


class Sheet(NamedTuple):
    """Axes of a figure that show a plate."""

    figure: Figure
    axes: Axes
    box: Box  # m: what is seen
    factor: float  # from m to the axes' unit


def shape(results: Results, step: int, scale: float, still: Shape | None = None) -> Shape:
    """The nodes of a frame, displaced by `scale` times their displacement; 0 is the reference.

    `still` is the shape of another frame, if there is one: it lends its plate and, while no node is born or dies, its
    cells. Raises ResultsError if the frame has no displacements and `scale` is not 0.
    """
    nodes, epoch = results.nodes(step), results.epoch(step)
    if still is None or still.epoch != epoch:
        on = read_plate_geometry(results) if still is None else still.plate
        node_cells = clipped_voronoi_cells(nodes, on.plate_shape) if len(nodes.ids) <= plate_geometry.MANY else None
        still = Shape(on, nodes.position, nodes.position, nodes.delta, node_cells, None, 0.0, epoch)
    still = still._replace(grown=arms(until(results.particles(), step), after=0).reshape(-1, 2, 2))
    if not scale:
        return still._replace(position=nodes.position, corners=None, scale=0.0)
    displacements, corners = displacement(results, step), None
    position = nodes.position + scale * displacements
    if still.cells is not None:
        families = families_without_broken_bonds(results, results.families(step), step)
        gradients = np.eye(2) + scale * gradients_of(nodes.position, nodes.area, displacements, *families)
        unusable = ~np.isfinite(gradients).all(axis=(1, 2)) | (np.abs(gradients).max(axis=(1, 2)) > 2)
        gradients[unusable] = np.eye(2)
        corners = deformed_corner_offsets(still.cells, nodes.position, position, nodes.delta, gradients, families)
    return still._replace(position=position, corners=corners, scale=scale)


def hidden(nodes: Shape, names: Collection[str]) -> Shape:
    """The shape without lines of these `names`: cracks (drawn and grown), zone (the border of finer nodes)."""
    visible_plate = nodes.plate._replace(has_moving_zone=nodes.plate.has_moving_zone and "zone" not in names)
    if "cracks" not in names:
        return nodes._replace(plate=visible_plate)
    return nodes._replace(plate=visible_plate._replace(pre_cracks=np.zeros((0, 4))), grown=np.zeros((0, 2, 2)))


def displacement(results: Results, step: int) -> NDArray[np.float64]:
    """Displacements (n, 2), m, of a frame, with 0 in place of NaN. Raises ResultsError if it holds none."""
    displacements = vector(results, "displacement", step)
    return np.where(np.isfinite(displacements), displacements, 0.0)


def chosen_scale(results: Results, step: int) -> float:
    """1, 2 or 5 times a power of ten, at least 1: most displacements then move nodes by 5 % of the plate.

    Raises ResultsError if the frame does not hold displacements.
    """
    nodes = results.nodes(step)
    far = float(np.percentile(np.hypot(*displacement(results, step).T), 99))
    wanted = SHOWN * float(np.ptp(nodes.position, axis=0).max()) / far if far > 0 else 1.0
    power = 10.0 ** np.floor(np.log10(wanted)) if wanted > 1 else 1.0
    return float(max(power * max(n for n in (1, 2, 5) if n * power <= max(wanted, 1.0)), 1.0))


def box_of(shapes: list[Shape]) -> Box:
    """The box, m, that contains all the shapes, except for fragments thrown far off the plate.

    A fragment of less than a hundredth of the nodes may lie outside; a stretched body is seen whole.
    """
    bounds = np.reshape(shapes[0].plate.plate_shape.bounds, (2, 2))
    size = float(np.ptp(bounds, axis=0).max())
    low, high = bounds
    most = bounds.copy()  # of the nodes, in some shape
    for frame_shape in shapes:
        if frame_shape.scale:
            half = frame_shape.delta[:, None] / 2
            low = np.minimum(low, (frame_shape.position - half).min(axis=0))
            high = np.maximum(high, (frame_shape.position + half).max(axis=0))
            inner = np.percentile(frame_shape.position, (1, 99), axis=0)
            most = np.array([np.minimum(most[0], inner[0]), np.maximum(most[1], inner[1])])
    room = (ROOM if any(frame_shape.scale for frame_shape in shapes) else MARGIN) * size
    x0, y0 = np.maximum(low - MARGIN * size, most[0] - room).tolist()
    x1, y1 = np.minimum(high + MARGIN * size, most[1] + room).tolist()
    return x0, y0, x1, y1


def seen(places: NDArray[np.float64], box: Box) -> NDArray[np.bool_]:
    """Mask (n,) of the places (n, 2), m, inside a box."""
    return np.asarray(((places >= box[:2]) & (places <= box[2:])).all(axis=1), dtype=np.bool_)


def sheet(box: Box, bar: bool = True, room: float = 0.0) -> Sheet:
    """An empty sheet for `box`, m, with space for a colour bar beside it and `room` inches below it."""
    width, height = box[2] - box[0], box[3] - box[1]
    full_width = float(rcParams["figure.figsize"][0])
    across = min(full_width - LEFT - RIGHT, TALLEST * width / height)
    tall = max(across * height / width, FLATTEST)
    size = (max(LEFT + across + RIGHT * bar, min(LEAST, full_width)), room + BELOW + tall + ABOVE)
    figure = Figure(figsize=size)
    place = (LEFT / size[0], (room + BELOW) / size[1], across / size[0], tall / size[1])
    return on_axes(figure.add_axes(place), box)


def on_axes(axes: Axes, box: Box) -> Sheet:
    """A sheet for `box`, m, on existing axes."""
    factor, prefix = prefixed(max(box[2] - box[0], box[3] - box[1]))
    axes.set(xlabel=f"x, {prefix}m", ylabel=f"y, {prefix}m", aspect="equal")
    axes.set_xlim(box[0] * factor, box[2] * factor)
    axes.set_ylim(box[1] * factor, box[3] * factor)
    figure = axes.get_figure()
    assert isinstance(figure, Figure)
    return Sheet(figure, axes, box, factor)


def painted_cells(on: Sheet, nodes: Shape) -> list[Curve]:
    """The nodes' cells as curves on the sheet; none where they are not drawn one by one."""
    return [] if nodes.cells is None else outlines(nodes.cells, nodes.position, nodes.corners, on.factor)


def paint(
    on: Sheet,
    nodes: Shape,
    values: NDArray[np.float64],
    colours: ScalarMappable,
    torn: NDArray[np.bool_] | None = None,
    painted: list[Curve] | None = None,
) -> list[Artist]:
    """Draw each node's cell, coloured by its value (n,) through `colours`.

    Nodes without a value are dark grey, those marked in `torn` (n,) light grey, both hatched. `painted` are the cells'
    curves, if they are known.
    """
    torn = np.zeros(len(values), dtype=bool) if torn is None else torn
    values = np.where(torn, np.nan, values)
    left_out = {TORN: torn, UNKNOWN: ~torn & ~np.isfinite(values)}
    if nodes.cells is None:
        mean, covered = _filled(on, nodes, values)
        image = colours.to_rgba(np.ma.masked_invalid(mean), bytes=True)
        image[~covered] = 0
        artists = []
        for colour, mask in left_out.items():
            if mask.any():
                share, _ = _filled(on, nodes, mask.astype(float))
                hatched = (share > 0) & np.isnan(mean)
                image[hatched] = np.array(to_rgba(colour)) * 255
                artists.append(_hatch(on, hatched, HATCHES[colour]))
        return [show(on, image, nodes), *artists]
    painted = painted_cells(on, nodes) if painted is None else painted
    artists = [_cells(on, painted, array=np.ma.masked_invalid(values), cmap=colours.cmap, norm=colours.norm)]
    for colour, mask in left_out.items():
        if mask.any():
            shapes = [painted[row] for row in np.flatnonzero(mask)]
            artists.append(_cells(on, shapes, facecolors=colour))
            together = [Curve.make_compound_path(*shapes)]
            artists.append(_cells(on, together, facecolors="none", edgecolors=INK, linewidths=0, hatch=HATCHES[colour]))
    return artists


def tint(on: Sheet, nodes: Shape, colours: NDArray[np.float64], **lines: Any) -> None:
    """Draw each node's cell in its own colour (n, 3); `lines` are matplotlib's settings for the cells' edges."""
    if nodes.cells is not None:
        _cells(on, outlines(nodes.cells, nodes.position, nodes.corners, on.factor), facecolors=colours, **lines)
        return
    layers = [_filled(on, nodes, layer) for layer in colours.T]
    alpha = layers[0][1].astype(float)
    show(on, np.dstack([*(np.where(covered, mean, 1.0) for mean, covered in layers), alpha]), nodes)


def mark(on: Sheet, nodes: Shape) -> None:
    """Draw cracks and the edges of the plate and its holes; the undeformed ones dotted if nodes are displaced."""
    style = {"linestyle": ":"} if nodes.scale else {}
    if nodes.plate.outline_and_holes:
        rings = [ring[[*range(len(ring)), 0]] * on.factor for ring in nodes.plate.outline_and_holes]
        on.axes.add_collection(LineCollection(rings, colors=EDGE, linewidths=THIN, zorder=3, **style), autolim=False)
    ends = nodes.plate.pre_cracks.reshape(-1, 2, 2)
    inside = (ends.max(axis=1) >= on.box[:2]).all(axis=1) & (ends.min(axis=1) <= on.box[2:]).all(axis=1)
    lines = ends[inside] * on.factor
    if len(lines):
        for colour, width, label in (("white", 1.8 * THICK, None), ("black", THICK, "pre-crack")):
            cracks = LineCollection(list(lines), colors=colour, linewidths=width, zorder=4, label=label, **style)
            cracks.set_capstyle("round")
            on.axes.add_collection(cracks, autolim=False)
    grown(on, nodes)


def grown(on: Sheet, nodes: Shape) -> list[Artist]:
    """Draw the cracks of particles grown so far, in the reference configuration."""
    artists: list[Artist] = []
    for colour, width, label in (("white", 1.8 * THICK, None), (GROWN, THICK, "grown crack")):
        if len(nodes.grown):
            lines = LineCollection(
                list(nodes.grown * on.factor), colors=colour, linewidths=width, zorder=4, label=label
            )
            lines.set_capstyle("round")
            artists.append(on.axes.add_collection(lines, autolim=False))
    return artists


def border(on: Sheet, nodes: Shape) -> list[Artist]:
    """Draw the border of a moving fine zone, except across opened cracks; nothing if the zone does not move."""
    spacings = np.unique(nodes.delta)
    coarsest = float(
        spacings[-1] if nodes.plate.has_splitting_cells else spacings[:2][-1]
    )  # of a lattice with far cells, beside it
    finer = nodes.delta < (1 - 1e-6) * coarsest
    if not nodes.plate.has_moving_zone or not finer.any():
        return []
    reach = nodes.delta[finer]
    # boxes that cover the squares of fine nodes: one for those that meet in a row
    x, y = nodes.reference[finer].T
    order = np.lexsort((x, y, reach))
    x, y, reach = x[order], y[order], reach[order]
    apart = (np.diff(y) != 0) | (np.diff(reach) != 0) | (np.diff(x) > 2 * reach[1:])
    first = np.concatenate([[0], np.flatnonzero(apart) + 1])
    last = np.concatenate([first[1:] - 1, [len(x) - 1]])
    boxes = shapely.box((x - reach)[first], (y - reach)[first], (x + reach)[last], (y + reach)[last])
    fine_area = shapely.union_all(boxes)  # over coarse ones on its edge
    zone = fine_area.buffer(-float(reach.max()) / 2, join_style="mitre")
    zone = shapely.intersection(zone, nodes.plate.plate_shape).segmentize(coarsest)
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(zone))]
    if nodes.scale:
        displacements, nearest = nodes.position - nodes.reference, tree_of(nodes.reference)
        rings = [ring + displacements[nearest.query(ring)[1]] for ring in rings]
    sides = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    sides = sides[np.hypot(*(sides[:, 1] - sides[:, 0]).T) < TORN_APART * coarsest]
    artists: list[Artist] = []
    for colour, width, label in (("white", 2 * THIN, None), (BLACK, THIN, "zone of finer nodes")):
        lines = LineCollection(list(sides * on.factor), colors=colour, linewidths=width, zorder=2, label=label)
        artists.append(on.axes.add_collection(lines, autolim=False))
    return artists


def legend(on: Sheet, *patches: tuple[str, str], columns: int = 3) -> None:
    """Put a legend below the plate for its lines and for patches (colour, words)."""
    handles, _ = on.axes.get_legend_handles_labels()
    handles += [patch(colour, words) for colour, words in patches]
    if handles:
        place = on.axes.get_position()
        low = place.y0 - 0.42 / on.figure.get_figheight()
        middle = (place.x0 + place.x1) / 2
        on.figure.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(middle, low),
            ncols=1 if narrow() else columns,
            frameon=False,
            fontsize=8,
        )


def patch(colour: str, words: str) -> Patch:
    """A patch of a legend, hatched as what is left out is."""
    hatch = HATCHES.get(colour)
    return Patch(fc=colour, ec=INK if hatch else colour, lw=0, hatch=hatch and 2 * hatch, label=words)


def show(on: Sheet, painted: NDArray[np.generic], nodes: Shape) -> Artist:
    """Draw an image (rows, columns, 4) of the sheet's box, lowest row first, clipped to the plate."""
    x0, y0, x1, y1 = (edge * on.factor for edge in on.box)
    image = on.axes.imshow(
        painted, origin="lower", extent=(x0, x1, y0, y1), interpolation="nearest", aspect="equal", zorder=1
    )
    if not nodes.scale and nodes.plate.outline_and_holes:
        image.set_clip_path(PathPatch(around(nodes.plate.plate_shape, on.factor), transform=on.axes.transData))
    return image


def pixels(on: Sheet) -> int:
    """Width of the sheet's box in pixels when it is saved."""
    dpi = rcParams["savefig.dpi"]
    dots = on.figure.dpi if dpi == "figure" else float(dpi)
    return max(round(on.axes.get_position().width * on.figure.get_figwidth() * dots), 16)


def _cells(on: Sheet, painted: list[Curve], **more: Any) -> PathCollection:
    collection = PathCollection(painted, **{"edgecolors": "face", "linewidths": 0.4, **more})
    on.axes.add_collection(collection, autolim=False)
    return collection


def _hatch(on: Sheet, hatched: NDArray[np.bool_], hatch: str) -> Artist:
    """Hatch the pixels (rows, columns) of the sheet's box that are marked."""
    x0, y0, x1, y1 = (edge * on.factor for edge in on.box)
    rows, columns = hatched.shape
    x = x0 + (np.arange(columns) + 0.5) / columns * (x1 - x0)
    y = y0 + (np.arange(rows) + 0.5) / rows * (y1 - y0)
    with rc_context({"hatch.color": INK, "hatch.linewidth": HATCHED}):
        return on.axes.contourf(x, y, hatched.astype(float), [0.5, 1.5], colors="none", hatches=[hatch], zorder=1.5)


def _filled(on: Sheet, nodes: Shape, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """`raster.averages` of the sheet's box, with empty pixels of the plate filled from the nearest node.

    Of displaced nodes, those pixels are filled that are nearer than `STRETCHED` spacings.
    """
    mean, covered = raster.averages(nodes.position, nodes.delta, values, on.box, pixels(on))
    if covered.all() or not (nodes.scale or nodes.plate.outline_and_holes):
        return mean, covered
    rows, columns = np.nonzero(~covered)
    low, high = np.array(on.box[:2]), np.array(on.box[2:])
    middle = low + (np.column_stack([columns, rows]) + 0.5) / covered.shape[::-1] * (high - low)
    distance, nearest = tree_of(nodes.position).query(middle)
    if nodes.scale:
        bare = distance <= STRETCHED * nodes.delta[nearest]
    else:
        wide = float((high - low)[0]) / covered.shape[1]
        bare = shapely.dwithin(nodes.plate.plate_shape, shapely.points(middle), wide)
    nearest = nearest[bare]
    mean[rows[bare], columns[bare]] = values[nearest]
    covered[rows[bare], columns[bare]] = True
    return mean, covered
