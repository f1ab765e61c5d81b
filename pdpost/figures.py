"""Pictures of a run, with matplotlib; a figure is returned, never shown."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdmesh.files import write_atomically
from pdsolve.results import Results

STYLE = {"font.size": 9, "axes.linewidth": 0.6, "savefig.dpi": 200}
WIDTH = 7.0  # inches


class FigureError(ValueError):
    """A picture that cannot be drawn; the message says what was found and what was expected."""


def styled(style: Mapping[str, str]) -> dict[str, object]:
    """The house style with a user's matplotlib settings over it. Raises FigureError for one it does not know."""
    for name, value in style.items():
        if name not in matplotlib.rcParams:
            raise FigureError(f"--set {name}: found no such matplotlib setting, expected one such as savefig.dpi")
        try:
            matplotlib.RcParams({name: value})
        except ValueError as error:
            raise FigureError(f"--set {name}={value}: {error}") from None
    return STYLE | dict(style)


def damage(results: Results, step: int) -> Figure:
    """The damage of the frame at `step`: each node a square the size of its spacing, at its reference position."""
    nodes = results.nodes()
    steps, times = results.frames()
    values = results.field("damage", step)
    time = float(times[list(steps).index(step)])
    figure, axes = _plate(nodes.position, nodes.delta)
    squares = _squares(nodes.position, nodes.delta) * 1e3
    colours = {"cmap": "magma_r", "clim": (0, 1), "edgecolors": "face", "linewidths": 0.2}
    cells = PolyCollection(squares, array=values, **colours)  # type: ignore[arg-type]
    axes.add_collection(cells)
    figure.colorbar(cells, cax=axes.inset_axes((1.02, 0, 0.025, 1)), label="damage")
    axes.set_title(f"Damage at {time * 1e6:.4g} µs (step {step})")
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's suffix, the same bytes each time. Raises FigureError."""
    formats = figure.canvas.get_supported_filetypes()
    kind = path.suffix.lower().removeprefix(".")
    if kind not in formats:
        raise FigureError(f"{path}: found suffix '{path.suffix}', expected one of .{', .'.join(sorted(formats))}")
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}
    picture = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "pdpost"}):
        figure.savefig(picture, format=kind, bbox_inches="tight", metadata=undated.get(kind))
    write_atomically(path, picture.getvalue())


def _aspect(position: NDArray[np.float64]) -> float:
    size = np.ptp(position, axis=0)
    return float(min(max(size[1] / max(size[0], 1e-300), 0.2), 2.0))


def _plate(position: NDArray[np.float64], delta: NDArray[np.float64]) -> tuple[Figure, matplotlib.axes.Axes]:
    figure = Figure(figsize=(WIDTH, WIDTH * _aspect(position) + 0.6), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x, mm", ylabel="y, mm")
    edge = delta.min() / 2
    low, high = position.min(axis=0) - edge, position.max(axis=0) + edge
    axes.set_xlim(low[0] * 1e3, high[0] * 1e3)
    axes.set_ylim(low[1] * 1e3, high[1] * 1e3)
    return figure, axes


def _squares(position: NDArray[np.float64], delta: NDArray[np.float64]) -> NDArray[np.float64]:
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    squares: NDArray[np.float64] = position[:, None, :] + delta[:, None, None] * corners
    return squares
