"""How all pictures look and how they are written: fonts, lines, colours; the same bytes each time."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import font_manager
from matplotlib.figure import Figure

from pdmesh.files import write_atomically

STYLE: dict[str, Any] = {
    "font.size": 9,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.titlesize": 9,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,  # TrueType, which journals ask for and programs edit
    "ps.fonttype": 42,
    "svg.fonttype": "none",  # text stays text
}

# M. Okabe, K. Ito, Color Universal Design (2008): all can tell them apart.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY_BLUE, YELLOW, BLACK = "#E69F00", "#56B4E9", "#F0E442", "#000000"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, BLACK)  # of curves, in this order
SHADES = (BLUE, ORANGE, GREEN, PURPLE, SKY_BLUE, VERMILION, YELLOW, BLACK)  # of spacings, in this order
UNKNOWN = "#707070"  # nodes without a value
TORN = "#c8c8c8"  # nodes whose value says nothing, as most of their bonds are broken
EDGE = "#262626"  # of the plate and its holes
GROWN = BLUE  # cracks that have grown
THIN, THICK = 0.6, 1.2  # points: an edge, a pre-crack

KINDS = (  # of settings that pictures have
    *("axes.", "figure.", "font.", "grid.", "hatch.", "image.", "legend.", "lines.", "markers.", "mathtext.", "patch."),
    *("path.", "pdf.", "ps.", "savefig.", "scatter.", "svg.", "text.", "xaxis.", "xtick.", "yaxis.", "ytick."),
)
BOUNDS = {"font.size": (1.0, 72.0), "savefig.dpi": (10.0, 1200.0), "figure.dpi": (10.0, 1200.0)}
LARGEST = 1000.0  # number of any other setting
UNDATED = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}


class FigureError(ValueError):
    """A picture that cannot be drawn; the message says what was found and what was expected."""


@contextmanager
def styled(settings: Mapping[str, object] | None = None) -> Iterator[None]:
    """While it lasts, figures are drawn in the house style, with a user's matplotlib settings over it.

    Raises FigureError for one that matplotlib does not know, or that no picture can be drawn with.
    """
    with matplotlib.rc_context(rc=_checked(settings or {})):
        yield


def _checked(style: Mapping[str, object]) -> dict[str, Any]:
    """The house style with a user's settings over it, each of which matplotlib knows. Raises FigureError."""
    for name, value in style.items():
        if name not in matplotlib.rcParams or not name.startswith(KINDS):
            raise FigureError(f"--set {name}: found no such matplotlib setting, expected one such as savefig.dpi")
        try:
            known = matplotlib.RcParams({name: value})[name]
        except Exception as error:  # of many kinds
            raise FigureError(f"--set {name}={value}: {error}") from None
        low, high = BOUNDS.get(name, (-LARGEST, LARGEST))
        for number in np.ravel(np.array(known, dtype=object)):
            if isinstance(number, int | float) and not (math.isfinite(number) and low <= number <= high):
                raise FigureError(f"--set {name}={value}: found {number:g}, expected {low:g} to {high:g}")
    chosen = STYLE | dict(style)
    if style:
        _try(chosen, ", ".join(f"{name}={value}" for name, value in style.items()))
    return chosen


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's suffix, the same bytes each time. Raises FigureError."""
    write_atomically(path, written(figure, check_format(path)))


def written(figure: Figure, kind: str, dpi: float | None = None) -> bytes:
    """A figure in a format such as "png", the same bytes each time; `dpi` if it is not the style's."""
    picture = io.BytesIO()
    more: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
    with matplotlib.rc_context({"svg.hashsalt": "pdpost"}):
        figure.savefig(picture, format=kind, bbox_inches="tight", metadata=UNDATED.get(kind), **more)
    return picture.getvalue()


def check_format(path: Path) -> str:
    """The format of the path's suffix. Raises FigureError, naming those there are, if there is none."""
    formats = Figure().canvas.get_supported_filetypes()
    kind = path.suffix.lower().removeprefix(".")
    if kind not in formats:
        raise FigureError(f"{path}: found suffix '{path.suffix}', expected one of .{', .'.join(sorted(formats))}")
    return kind


def _try(style: Mapping[str, Any], named: str) -> None:
    """Draw a small picture: matplotlib takes settings that it cannot draw with. Raises FigureError."""
    try:
        with matplotlib.rc_context(rc=dict(style)), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            font_manager.findfont(font_manager.FontProperties(), fallback_to_default=False)
            figure = Figure(figsize=(2, 2), layout="constrained")
            axes = figure.add_subplot(title="a", xlabel="b", ylabel="$c^2$")
            axes.plot([0, 1], [0, 1], "o-", label="d")
            axes.grid(True)
            figure.colorbar(axes.imshow([[0, 1]]))
            axes.legend()
            for kind in ("png", "pdf", "svg"):
                written(figure, kind, dpi=20)
    except Exception as error:
        found = " ".join(str(error).split())[:200] or type(error).__name__
        raise FigureError(f"--set {named}: found settings that no picture can be drawn with ({found})") from None
