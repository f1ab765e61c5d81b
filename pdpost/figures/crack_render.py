"""A cracked body rendered by PyVista (an extra): its cracks inside it, or its fragments apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray

from pdmesh.plain_figure import Figure, FigureError
from pdpost.figures.colours import CMAP, Colours, Opening, colours, mappable, opening_colours, title
from pdpost.figures.render import STONE, add_body, framed, image, needed_pyvista, plotter_of, taken
from pdpost.figures.style import COLOURS
from pdsolve.measures import slices
from pdsolve.measures.crack_faces import (
    CrackSurface,
    FaceNeighbourPairs,
    build_crack_surface,
    find_opened_face_neighbours,
)
from pdsolve.measures.fragments import SMALLEST, fragment_number_of_nodes
from pdsolve.measures.frame_steps import has_diffusion_only
from pdsolve.results import Nodes, Results

CLEAR = 0.12  # opacity of the body around its cracks
OLD = "#8a8a8a"  # colour of pre-cracks
LIGHTING = {"ambient": 0.3, "diffuse": 0.7, "specular": 0.15}


def cracks_in_body(nodes: Nodes, cracks: CrackSurface, written: str, by_steps: bool = False) -> Figure:
    """The surface of the cracks, coloured by when it opened, in the body as through glass. Raises FigureError."""
    pyvista = needed_pyvista()
    plotter = plotter_of(pyvista)
    for part in _solids(pyvista, nodes, np.ones(len(nodes.ids), dtype=bool)):
        plotter.add_mesh(part, color=STONE, opacity=CLEAR)
    times = _add_surface(pyvista, plotter, cracks, by_steps)
    painted = times.painted if cracks.face_opened_during_run.any() else None
    return framed(taken(plotter, nodes.position.mean(axis=0)), written, painted, times.label, "max")


def cut_open(
    nodes: Nodes,
    values: NDArray[np.float64],
    shown: Colours,
    cracks: CrackSurface | None,
    written: str,
    plane: tuple[str, float],
    uncropped: bool = False,
) -> Figure:
    """The body behind `plane` (axis, m) in the colours of `values` (n,), and the whole surface of its cracks.

    `uncropped`: in a picture of a fixed size. Raises FigureError without PyVista.
    """
    pyvista = needed_pyvista()
    plotter = plotter_of(pyvista)
    add_body(pyvista, plotter, nodes, values, shown, None, plane)
    if cracks is not None:
        _add_surface(pyvista, plotter, cracks)
    pixels = taken(plotter, (nodes.position.min(axis=0) + nodes.position.max(axis=0)) / 2, uncropped)
    return framed(pixels, written, mappable(shown), shown.label if uncropped else shown.full_label, shown.beyond)


def frame_cut_open(
    results: Results,
    name: str,
    part: str,
    step: int,
    plane: tuple[str, float] | None = None,
    largest: float | None = None,
    uncropped: bool = False,
) -> Figure:
    """`cut_open` of the component `part` of a field after `step`, by a plane through the middle if none is given."""
    values = slices.reliable_field_values(results, name, step, part or None)
    plane = plane or ("y", float(slices.default_slice_point(results)[1]))
    cracks = (
        None
        if has_diffusion_only(results)
        else build_crack_surface(results, step, find_opened_face_neighbours(results, step))
    )
    shown = colours(name, part, values, largest)
    return cut_open(results.nodes(step), values, shown, cracks, title(results, name, part, step, 0.0), plane, uncropped)


def film(
    results: Results,
    name: str,
    part: str,
    steps: Iterable[int],
    plane: tuple[str, float],
    dpi: float,
    largest: float | None,
) -> Iterator[NDArray[np.uint8]]:
    """Pictures (rows, columns, 3) of a body cut open after these steps, of one size. Raises FigureError."""
    for step in steps:
        figure = frame_cut_open(results, name, part, step, plane, largest, uncropped=True)
        canvas = FigureCanvasAgg(figure)
        figure.set_dpi(dpi)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def _add_surface(pyvista: Any, plotter: Any, cracks: CrackSurface, by_steps: bool = False) -> Opening:
    """Add the surface of cracks to a plotter; returns the colours of what opened."""
    times = opening_colours(cracks, by_steps)
    for is_opened in (False, True):
        face_mask = cracks.face_opened_during_run == is_opened
        if not face_mask.any():
            continue
        quads = np.column_stack([np.full(face_mask.sum(), 4), cracks.face_corners[face_mask]])
        mesh = pyvista.PolyData(cracks.corners, quads.ravel())
        if is_opened:
            mesh.cell_data["opened"] = cracks.opening_time[face_mask] * times.factor
            clim = times.painted.get_clim()
            plotter.add_mesh(mesh, scalars="opened", cmap=CMAP, clim=clim, show_scalar_bar=False, **LIGHTING)
        else:
            plotter.add_mesh(mesh, color=OLD, **LIGHTING)
    return times


def fragments_apart(nodes: Nodes, parted_pairs: FaceNeighbourPairs, by: float, written: str) -> Figure:
    """The fragments of a body, each in a colour, moved from its middle by `by` times their distance from it.

    Raises FigureError.
    """
    pyvista, piece = needed_pyvista(), fragment_number_of_nodes(parted_pairs)
    count = np.bincount(piece)
    middle, plotter = nodes.position.mean(axis=0), plotter_of(pyvista)
    large = np.flatnonzero(count >= SMALLEST)
    if not len(large):
        raise FigureError(f"--explode: there is no fragment of {SMALLEST} nodes; draw a frame with some")
    for number, piece_number in enumerate(large[np.argsort(-count[large], kind="stable")]):
        node_mask = piece == piece_number
        way = by * (nodes.position[node_mask].mean(axis=0) - middle)
        for part in _solids(pyvista, nodes, node_mask):
            plotter.add_mesh(part.translate(way), color=COLOURS[number % len(COLOURS)], **LIGHTING)
    return framed(taken(plotter, middle), written)


def _solids(pyvista: Any, nodes: Nodes, node_mask: NDArray[np.bool_]) -> list[Any]:
    """The cubes of some (n,) nodes, a mesh for each spacing."""
    meshes = []
    for spacing in np.unique(nodes.delta[node_mask]):
        spacing_mask = node_mask & (nodes.delta == spacing)
        mesh = image(pyvista, nodes.position[spacing_mask], np.ones(int(spacing_mask.sum())), float(spacing), False)
        if mesh is not None:
            meshes.append(mesh.threshold(0.5, scalars="there"))
    return meshes
