"""Pictures of a run, with matplotlib; a figure is returned, never shown."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdmesh.files import write_atomically
from pdpost.cracks import damage_at
from pdsolve.results import Nodes, Results

STYLE = {"font.size": 9, "axes.linewidth": 0.6, "savefig.dpi": 200}
WIDTH = 7.0  # inches
PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


class FigureError(ValueError):
    """A picture that cannot be drawn; the message says what was found and what was expected."""


class Picture(NamedTuple):
    """A field of the nodes that can be drawn: its numbers and how they are shown."""

    title: str
    unit: str
    cmap: str
    values: Callable[[Results, int], NDArray[np.floating]]  # of the frame at a step: (n,)
    limits: tuple[float, float] | None = None  # fixed, or from 0 to the largest


def _size_of(letter: str) -> Callable[[Results, int], NDArray[np.floating]]:
    def size(results: Results, step: int) -> NDArray[np.floating]:
        x, y = results.field(f"{letter}x", step), results.field(f"{letter}y", step)
        return np.asarray(np.hypot(x.astype(float), y))

    return size


PICTURES = {
    "damage": Picture("Damage", "", "magma_r", damage_at, (0.0, 1.0)),
    "energy": Picture("Strain energy", "J/m³", "viridis", lambda results, step: results.field("energy", step)),
    "displacement": Picture("Displacement", "m", "viridis", _size_of("u")),
    "velocity": Picture("Velocity", "m/s", "viridis", _size_of("v")),
    "acceleration": Picture("Acceleration", "m/s²", "viridis", _size_of("a")),
}


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


def draw(results: Results, name: str, step: int, largest: float | None = None) -> Figure:
    """The field called `name` after `step`: each node a square the size of its spacing, at its reference position.

    Damage is known at every step, other fields at frames that stored them. `largest` ends the colours, in SI units.
    Raises ResultsError, naming what there is, if the field is not there.
    """
    picture = PICTURES[name]
    nodes = results.nodes()
    values = picture.values(results, step)
    time = step * float(results.meta()["time_step"])
    figure, axes = _plate(nodes)
    if picture.limits is not None:
        low, high = picture.limits
        scale, label = 1.0, picture.title.lower()
    else:
        low, high = 0.0, float(values.max(initial=0.0)) if largest is None else largest
        scale, prefix = prefixed(high)
        label = f"{picture.title.lower()}, {prefix}{picture.unit}"
    squares = _squares(nodes) * 1e3
    colours = {"cmap": picture.cmap, "clim": (low * scale, high * scale), "edgecolors": "face", "linewidths": 0.2}
    cells = PolyCollection(squares, array=values * scale, **colours)  # type: ignore[arg-type]
    axes.add_collection(cells)
    figure.colorbar(cells, cax=axes.inset_axes((1.02, 0, 0.025, 1)), label=label)
    axes.set_title(f"{picture.title} at {time * 1e6:.4g} µs (step {step})")
    return figure


def prefixed(largest: float) -> tuple[float, str]:
    """A factor and an SI prefix that turn numbers up to `largest` into handy ones."""
    power = int(np.floor(np.log10(largest) / 3)) * 3 if largest > 0 else 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 10.0**-power, PREFIXES[power]


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


def _plate(nodes: Nodes) -> tuple[Figure, matplotlib.axes.Axes]:
    figure = Figure(figsize=(WIDTH, WIDTH * _aspect(nodes.position) + 0.6), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x, mm", ylabel="y, mm")
    edge = nodes.delta.min() / 2
    low, high = nodes.position.min(axis=0) - edge, nodes.position.max(axis=0) + edge
    axes.set_xlim(low[0] * 1e3, high[0] * 1e3)
    axes.set_ylim(low[1] * 1e3, high[1] * 1e3)
    return figure, axes


def _squares(nodes: Nodes) -> NDArray[np.float64]:
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    squares: NDArray[np.float64] = nodes.position[:, None, :] + nodes.delta[:, None, None] * corners
    return squares
