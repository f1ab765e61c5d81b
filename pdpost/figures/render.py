"""A body rendered without a window by PyVista (an extra): cut open with a field on it, or as an isosurface."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure, FigureError
from pdpost.figures.colours import Colours, mappable
from pdsolve.measures.slices import AXES
from pdsolve.results import Nodes

SIZE = (1600, 1200)  # pixels
WIDTH, ABOVE, BESIDE = 6.0, 0.5, 0.9  # inches: of the picture, what is written above it, and the colours beside it
EDGE = 20  # pixels of white around what is seen
STONE, LIGHT = "#9aa5ad", "white"
EYE = (-1.6, -2.6, 1.4)  # from where it is looked at, in sizes of the body
SMOOTH = 20  # rounds that an isosurface is smoothed
NEAR_LATTICE = 1e-6  # of a spacing
SHADE, LIFT, RAYS = 0.06, 2e-3, 128  # of what is seen: how far corners shade each other, and from where on; samples


def render(
    nodes: Nodes,
    values: NDArray[np.float64],
    shown: Colours,
    title: str,
    level: float | None = None,
    plane: tuple[str, float] | None = None,
) -> Figure:
    """A rendered picture of the `values` (n,) of a field.

    With a `level`, the isosurface of that value; otherwise the body in colours. The part in front of `plane` (axis, m)
    is cut away. Raises FigureError without PyVista, or if nothing is left to show.
    """
    pyvista = needed_pyvista()
    plotter = plotter_of(pyvista)
    add_body(pyvista, plotter, nodes, values, shown, level, plane)
    pixels = taken(plotter, nodes.position.mean(axis=0))
    return framed(pixels, title, mappable(shown) if level is None else None, shown.full_label, shown.beyond)


def framed(
    pixels: NDArray[np.uint8],
    title: str,
    painted: ScalarMappable | None = None,
    label: str = "",
    beyond: str = "neither",
) -> Figure:
    """Pixels (rows, columns, 3) as a figure with its title, and with the colours that were `painted`."""
    height = ABOVE + (WIDTH - BESIDE) * pixels.shape[0] / pixels.shape[1]
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(pixels, interpolation="antialiased")
    axes.set_axis_off()
    axes.set_title(title)
    if painted is not None:
        figure.colorbar(painted, ax=axes, label=label, extend=beyond, shrink=0.8)
    return figure


def add_body(
    pyvista: Any,
    plotter: Any,
    nodes: Nodes,
    values: NDArray[np.float64],
    shown: Colours,
    level: float | None,
    plane: tuple[str, float] | None,
) -> None:
    """Add a body in the colours of `values` (n,), or the isosurface at `level`, behind `plane`, to a plotter."""
    for spacing in np.unique(nodes.delta):
        spacing_mask = nodes.delta == spacing
        mesh = image(pyvista, nodes.position[spacing_mask], values[spacing_mask], float(spacing), level is not None)
        if mesh is None:
            continue
        part = mesh.contour([level], scalars="value") if level is not None else mesh.threshold(0.5, scalars="there")
        if level is not None and part.n_points:
            part = part.smooth_taubin(n_iter=SMOOTH)
        if plane is not None and part.n_points:
            axis, at = plane
            origin = [at if coordinate == axis else 0.0 for coordinate in AXES]
            part = part.clip(normal=axis, origin=origin, invert=False, crinkle=level is None)
        if part.n_points and level is not None:
            plotter.add_mesh(part, color=STONE, specular=0.3, smooth_shading=True, ambient=0.35)
        elif part.n_points:
            ends = (shown.low, shown.high if shown.high > shown.low else shown.low + 1.0)
            plotter.add_mesh(part, scalars="value", cmap=shown.cmap, clim=ends, show_scalar_bar=False, ambient=0.35)


def plotter_of(pyvista: Any) -> Any:
    """A PyVista plotter without a window."""
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background(LIGHT)
    return plotter


def taken(plotter: Any, middle: NDArray[np.float64], uncropped: bool = False) -> NDArray[np.uint8]:
    """The picture of a plotter, looking at `middle` (3,), m, with ambient occlusion; the white around it is cut off
    unless it is wanted `uncropped`. Raises FigureError."""
    plotter.camera_position = [tuple(middle + np.array(EYE)), tuple(middle), (0, 0, 1)]
    plotter.reset_camera()
    size = float(plotter.length)
    plotter.enable_ssao(radius=SHADE * size, bias=LIFT * size, kernel_size=RAYS)
    picture = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    if uncropped:
        return picture
    not_white = np.any(picture < 255, axis=2)
    if not np.any(not_white):
        raise FigureError("render: nothing is to be seen; use another level, plane or frame")
    rows, columns = (np.flatnonzero(np.any(not_white, axis=axis)) for axis in (1, 0))
    return picture[max(rows[0] - EDGE, 0) : rows[-1] + EDGE, max(columns[0] - EDGE, 0) : columns[-1] + EDGE]


def needed_pyvista() -> Any:
    """PyVista, quiet where there is no display. Raises FigureError without it."""
    try:
        import pyvista
        from vtkmodules.vtkCommonCore import vtkLogger
    except ImportError:
        raise FigureError("render needs PyVista; install it: pip install 'pdsuite[render]'") from None
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # where there is no display it says so, and does without
    return pyvista


def image(
    pyvista: Any, position: NDArray[np.float64], values: NDArray[np.float64], spacing: float, points: bool
) -> Any:
    """Lattice nodes as a PyVista image, with data on points or in cells; None if they are not on a lattice."""
    place = (position - position.min(axis=0)) / spacing
    indices = np.rint(place).astype(np.int64)
    if np.abs(place - indices).max() > NEAR_LATTICE * (1 + indices.max()):
        return None
    shape = indices.max(axis=0) + 1 + 2 * points
    flat = np.ravel_multi_index(tuple((indices + points).T), tuple(shape.tolist()), order="F")
    value, occupied = np.zeros(int(np.prod(shape))), np.zeros(int(np.prod(shape)))
    value[flat], occupied[flat] = values, 1.0
    low = position.min(axis=0) - spacing * (1.0 if points else 0.5)
    image = pyvista.ImageData(dimensions=shape if points else shape + 1, spacing=(spacing,) * 3, origin=low)
    data = image.point_data if points else image.cell_data
    data["value"], data["there"] = value, occupied
    return image
