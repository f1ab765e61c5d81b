"""A body as it looks, drawn without a window by PyVista, an extra: half of it with a field on it, or an isosurface."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pdpost.figures.style import FigureError
from pdpost.measures import fields
from pdpost.measures.slices import AXES
from pdsolve.results import Nodes

SIZE = (1200, 900)  # pixels
STONE, LIGHT = "#9aa5ad", "white"
EYE = (-1.6, -2.6, 1.4)  # from where it is looked at, in sizes of the body
SMOOTH = 20  # rounds that an isosurface is smoothed
NEAR_LATTICE = 1e-6  # of a spacing


def render(
    nodes: Nodes,
    values: NDArray[np.float64],
    name: str,
    level: float | None = None,
    plane: tuple[str, float] | None = None,
) -> bytes:
    """A PNG of the `values` (n,) of the field `name`.

    With a `level` the surface where they are that, else the body, in colours; what is in front of a `plane` (axis, m)
    is cut away. Raises FigureError without PyVista, or where nothing is left to be seen.
    """
    pyvista = _pyvista()
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=SIZE)
    plotter.set_background(LIGHT)
    unit = fields.FIELDS[name].unit
    seen = 0
    for spacing in np.unique(nodes.delta):
        own = nodes.delta == spacing
        mesh = _image(pyvista, nodes.position[own], values[own], float(spacing), level is not None)
        if mesh is None:
            continue
        part = mesh.contour([level], scalars="value") if level is not None else mesh.threshold(0.5, scalars="there")
        if level is not None and part.n_points:
            part = part.smooth_taubin(n_iter=SMOOTH)
        if plane is not None and part.n_points:
            axis, at = plane
            origin = [at if each == axis else 0.0 for each in AXES]
            part = part.clip(normal=axis, origin=origin, invert=False, crinkle=level is None)
        if part.n_points:
            seen += part.n_points
            colours = {"color": STONE, "specular": 0.3, "smooth_shading": True} if level is not None else {}
            colours |= {"ambient": 0.35}
            shown = {"scalars": "value", "cmap": "viridis", "show_scalar_bar": False} if level is None else {}
            high = float(np.nanmax(values)) or 1.0
            plotter.add_mesh(part, **colours, **shown, **({"clim": (0.0, high)} if level is None else {}))
    if not seen:
        plotter.close()
        raise FigureError(f"render: found nothing of {name} to be seen, expected another level, plane or frame")
    if level is None:
        plotter.add_scalar_bar(title=f"{fields.FIELDS[name].title}, {unit}".rstrip(", "), color="black")
    middle = nodes.position.mean(axis=0)
    size = float(np.ptp(nodes.position, axis=0).max()) if level is None else 0.0
    plotter.camera_position = [tuple(middle + np.array(EYE) * (size or 1.0)), tuple(middle), (0, 0, 1)]
    plotter.reset_camera()
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    written = BytesIO()
    Image.fromarray(picture).save(written, "PNG")
    return written.getvalue()


def _pyvista() -> Any:
    try:
        import pyvista
        from vtkmodules.vtkCommonCore import vtkLogger
    except ImportError:
        raise FigureError("render: found no PyVista, expected it: pip install 'pdsuite[render]'") from None
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # where there is no display it says so, and does without
    return pyvista


def _image(
    pyvista: Any, position: NDArray[np.float64], values: NDArray[np.float64], spacing: float, points: bool
) -> Any:
    """Nodes of a lattice as an image, at its points or in its cells; None where they are of none."""
    place = (position - position.min(axis=0)) / spacing
    whole = np.rint(place).astype(np.int64)
    if np.abs(place - whole).max() > NEAR_LATTICE * (1 + whole.max()):
        return None
    shape = whole.max(axis=0) + 1 + 2 * points
    flat = np.ravel_multi_index(tuple((whole + points).T), tuple(shape.tolist()), order="F")
    value, there = np.zeros(int(np.prod(shape))), np.zeros(int(np.prod(shape)))
    value[flat], there[flat] = values, 1.0
    low = position.min(axis=0) - spacing * (1.0 if points else 0.5)
    image = pyvista.ImageData(dimensions=shape if points else shape + 1, spacing=(spacing,) * 3, origin=low)
    data = image.point_data if points else image.cell_data
    data["value"], data["there"] = value, there
    return image
