"""Style of all pictures and how they are written: fonts, lines, colours; equal input gives equal bytes."""

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
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.transforms import Bbox

from pdmesh.files import FilePath, write_atomically
from pdmesh.plain_figure import UNDATED, Figure, FigureError, check_format
from pdmesh.spelling import meant

STYLE: dict[str, Any] = {
    "figure.figsize": (7.0, 4.8),  # inches: the width of what is drawn; heights are as the pictures need them
    "font.size": 9,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.5,
    "axes.titlesize": 9,
    "savefig.bbox": "tight",  # cut to what is drawn; "standard": exactly as wide as figure.figsize
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

FLATTER = 0.7  # power of its width that the height of a figure goes with, as words stay as high
EDGING = 0.03  # inches around a figure of a journal
TRIALS = 8
NARROW = 5.0  # inches

_ARIAL = ("Arial", "Helvetica", "Liberation Sans", "Nimbus Sans")
_TIMES = ("Times New Roman", "Liberation Serif", "STIXGeneral")
JOURNALS = {  # width, mm; size of words, points; fonts, the first that is there
    "elsevier": (90.0, 8.0, _ARIAL),  # Elsevier, artwork sizing: one column, one and a half, two
    "elsevier-middle": (140.0, 8.0, _ARIAL),
    "elsevier-wide": (190.0, 8.0, _ARIAL),
    "springer": (84.0, 8.0, _ARIAL),  # Springer, artwork instructions: Helvetica or Arial, 8 to 12 points
    "springer-wide": (174.0, 8.0, _ARIAL),
    "aps": (86.0, 8.0, _TIMES),  # Physical Review: 8.6 and 17.8 cm, letters of 2 mm at least
    "aps-wide": (178.0, 8.0, _TIMES),
    "ieee": (88.9, 8.0, _TIMES),  # IEEE: 3.5 and 7.16 inches
    "ieee-wide": (181.9, 8.0, _TIMES),
}

KINDS = (  # of settings that pictures have
    *("axes.", "figure.", "font.", "grid.", "hatch.", "image.", "legend.", "lines.", "markers.", "mathtext.", "patch."),
    *("path.", "pdf.", "ps.", "savefig.", "scatter.", "svg.", "text.", "xaxis.", "xtick.", "yaxis.", "ytick."),
)
OF_TEX = ("text.usetex", "text.latex", "text.parse_math")
BOUNDS = {"font.size": (1.0, 72.0), "savefig.dpi": (10.0, 1200.0), "figure.dpi": (10.0, 1200.0)}
LARGEST = 1000.0  # number of any other setting


@contextmanager
def styled(settings: Mapping[str, object] | None = None) -> Iterator[None]:
    """A context in which figures have the house style, overridden by a user's matplotlib settings.

    The setting `journal` names a preset, applied after the house style and before the other settings. Raises
    FigureError for a setting that matplotlib does not know or cannot draw with.
    """
    style = dict(settings or {})
    journal = style.pop("journal", None)
    for name, value in style.items():
        if name not in matplotlib.rcParams or not name.startswith(KINDS):
            known = [setting for setting in matplotlib.rcParams if setting.startswith(KINDS)]
            near = meant(name, STYLE, cutoff=1.0) or meant(name, known)
            raise FigureError(
                f"--style {name} is no matplotlib setting; "
                + (f"did you mean {near}?" if near else "use one such as savefig.dpi")
            )
        if name.startswith(OF_TEX):
            raise FigureError(
                f"--style {name}: TeX is not used, as it would run names in a model as a program; leave it out"
            )
        try:
            parsed_value = matplotlib.RcParams({name: value})[name]
        except Exception as error:  # of many kinds
            raise FigureError(f"--style {name}={value}: {error}") from None
        low, high = BOUNDS.get(name, (-LARGEST, LARGEST))
        for number in np.ravel(np.array(parsed_value, dtype=object)):
            if isinstance(number, int | float) and not (math.isfinite(number) and low <= number <= high):
                raise FigureError(f"--style {name}={value} is out of range; use {low:g} to {high:g}")
    chosen = STYLE | ({} if journal is None else _preset(str(journal))) | style
    if style:
        _try(chosen, ", ".join(f"{name}={value}" for name, value in style.items()))
    with matplotlib.rc_context(rc=chosen):
        yield


def _preset(name: str) -> dict[str, Any]:
    """Settings of a journal's preset. Raises FigureError."""
    if name not in JOURNALS:
        raise FigureError(f"--journal is '{name}'; use one of {', '.join(JOURNALS)}")
    width, size, fonts = JOURNALS[name]
    installed = {font.name for font in font_manager.fontManager.ttflist}
    serif = fonts[0].startswith("Times")
    return {
        "figure.figsize": (width / 25.4, 0.75 * width / 25.4),
        "savefig.bbox": "standard",
        "savefig.dpi": 600,
        "font.size": size,
        "axes.titlesize": size,
        "font.family": "serif" if serif else "sans-serif",
        "font.serif" if serif else "font.sans-serif": [
            *(font for font in fonts if font in installed),
            "DejaVu Serif" if serif else "DejaVu Sans",
        ],
        "mathtext.fontset": "stix" if serif else "dejavusans",
    }


def narrow() -> bool:
    """Whether figures are too narrow for panels side by side."""
    return bool(matplotlib.rcParams["figure.figsize"][0] < NARROW)


def save(figure: Figure, path: FilePath) -> None:
    """Write a figure in the format of the path's suffix, with reproducible bytes. Raises FigureError."""
    path = Path(path)
    write_atomically(path, written(figure, check_format(path)))


def written(figure: Figure, kind: str, dpi: float | None = None) -> bytes:
    """Bytes of a figure in a format such as "png", reproducible; `dpi` overrides the style's."""
    picture = io.BytesIO()
    more: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
    box: Bbox | str = "tight"
    with matplotlib.rc_context({"svg.hashsalt": "pdpost"}):
        if matplotlib.rcParams["savefig.bbox"] != "tight":  # exactly as wide as the style says, with all that is in it
            width = matplotlib.rcParams["figure.figsize"][0]
            wide, tall = figure.get_size_inches()
            if figure.get_layout_engine() is not None:  # which finds room for words of any size
                figure.set_size_inches(width, tall * (width / wide) ** FLATTER)
            canvas, room = FigureCanvasAgg(figure), width - 2 * EDGING
            for _ in range(TRIALS):
                figure.draw_without_rendering()
                bounds = figure.get_tightbbox(canvas.get_renderer())
                if bounds.width <= room:
                    break
                figure.set_size_inches(*(figure.get_size_inches() * room / bounds.width).tolist())
            middle = (bounds.x0 + bounds.x1) / 2
            box = Bbox.from_extents(middle - width / 2, bounds.y0 - EDGING, middle + width / 2, bounds.y1 + EDGING)
        figure.savefig(picture, format=kind, bbox_inches=box, metadata=UNDATED.get(kind), **more)
    return picture.getvalue()


def _try(style: Mapping[str, Any], named: str) -> None:
    """Draw a small picture, as matplotlib accepts settings that it cannot draw with. Raises FigureError."""
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
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise FigureError(
            f"--style {named}: no picture can be drawn with these settings ({reason}); change them"
        ) from None
