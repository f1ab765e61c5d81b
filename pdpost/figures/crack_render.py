"""A cracked body rendered by PyVista (an extra): its cracks inside it, or its fragments apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpost.figures.colours import Colours, mappable
from pdpost.figures.opening_colours import CMAP, Opening, opening_colours
from pdpost.figures.render import STONE, add_body, framed, image, needed_pyvista, plotter_of, taken
from pdpost.figures.style import COLOURS, FigureError
from pdpost.measures.crack_faces import Opened, Surface
from pdpost.measures.fragments_in_space import SMALLEST, connected_pieces
from pdsolve.results import Nodes

CLEAR = 0.12  # opacity of the body around its cracks
OLD = "#8a8a8a"  # colour of pre-cracks
LIGHTING = {"ambient": 0.3, "diffuse": 0.7, "specular": 0.15}


def cracks_in_body(nodes: Nodes, surface: Surface, title: str) -> Figure:
    """The surface of the cracks, coloured by when it opened, in the body as through glass. Raises FigureError."""
    pyvista = needed_pyvista()
    plotter = plotter_of(pyvista)
    for part in _solids(pyvista, nodes, np.ones(len(nodes.ids), dtype=bool)):
        plotter.add_mesh(part, color=STONE, opacity=CLEAR)
    colours = _add_surface(pyvista, plotter, surface)
    painted = colours.painted if surface.grown.any() else None
    return framed(taken(plotter, nodes.position.mean(axis=0)), title, painted, colours.label, "max")


def cut_open(
    nodes: Nodes,
    values: NDArray[np.float64],
    shown: Colours,
    surface: Surface | None,
    title: str,
    plane: tuple[str, float],
) -> Figure:
    """The body behind `plane` (axis, m) in the colours of `values` (n,), and the whole surface of its cracks.

    Raises FigureError without PyVista.
    """
    pyvista = needed_pyvista()
    plotter = plotter_of(pyvista)
    add_body(pyvista, plotter, nodes, values, shown, None, plane)
    if surface is not None:
        _add_surface(pyvista, plotter, surface)
    return framed(taken(plotter, nodes.position.mean(axis=0)), title, mappable(shown), shown.label, shown.beyond)


def _add_surface(pyvista: Any, plotter: Any, surface: Surface) -> Opening:
    """Add the surface of cracks to a plotter; returns the colours of what opened."""
    colours = opening_colours(surface)
    for grown in (False, True):
        some = surface.grown == grown
        if not some.any():
            continue
        quads = np.column_stack([np.full(some.sum(), 4), surface.faces[some]])
        mesh = pyvista.PolyData(surface.corners, quads.ravel())
        if grown:
            mesh.cell_data["opened"] = surface.time[some] * colours.factor
            clim = colours.painted.get_clim()
            plotter.add_mesh(mesh, scalars="opened", cmap=CMAP, clim=clim, show_scalar_bar=False, **LIGHTING)
        else:
            plotter.add_mesh(mesh, color=OLD, **LIGHTING)
    return colours


def fragments_apart(nodes: Nodes, found: Opened, by: float, title: str) -> Figure:
    """The fragments of a body, each in a colour, moved from its middle by `by` times their distance from it.

    Raises FigureError.
    """
    pyvista, piece = needed_pyvista(), connected_pieces(found)
    count = np.bincount(piece)
    middle, plotter = nodes.position.mean(axis=0), plotter_of(pyvista)
    large = np.flatnonzero(count >= SMALLEST)
    if not len(large):
        raise FigureError(f"--explode: found no fragment of {SMALLEST} nodes, expected some")
    for number, one in enumerate(large[np.argsort(-count[large], kind="stable")]):
        own = piece == one
        way = by * (nodes.position[own].mean(axis=0) - middle)
        for part in _solids(pyvista, nodes, own):
            plotter.add_mesh(part.translate(way), color=COLOURS[number % len(COLOURS)], **LIGHTING)
    return framed(taken(plotter, middle), title)


def _solids(pyvista: Any, nodes: Nodes, some: NDArray[np.bool_]) -> list[Any]:
    """The cubes of some (n,) nodes, a mesh for each spacing."""
    found = []
    for spacing in np.unique(nodes.delta[some]):
        own = some & (nodes.delta == spacing)
        mesh = image(pyvista, nodes.position[own], np.ones(int(own.sum())), float(spacing), False)
        if mesh is not None:
            found.append(mesh.threshold(0.5, scalars="there"))
    return found
