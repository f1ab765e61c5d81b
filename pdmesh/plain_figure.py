"""Figures that show text as text: the one way to a figure in the three packages."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.figure
from matplotlib.artist import Artist
from matplotlib.axis import Tick
from matplotlib.text import Text

from pdmesh.files import write_atomically
from pdmesh.plain_text import for_figure

PROGRAMS = ("pgf",)  # formats whose text is a program
# What files would say of the time and the program, by their format: without it, bytes are reproducible
UNDATED: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}


class FigureError(ValueError):
    """A picture that cannot be drawn; the message says what was found and what was expected."""


class Figure(matplotlib.figure.Figure):
    """A figure in which titles, labels and legends hold no formulas, no control characters and no endless lines.

    Numbers beside axes are Matplotlib's own, with powers as formulas.
    """

    def draw(self, renderer: Any) -> None:
        """Draw the figure, after making its text plain."""
        for text in _texts(self):
            text.set_text(for_figure(text.get_text()))
            text.set_parse_math(False)
            text.set_usetex(False)
        super().draw(renderer)


def formats() -> list[str]:
    """Formats in which a figure can be written, by their suffixes."""
    return sorted(set(Figure().canvas.get_supported_filetypes()) - set(PROGRAMS))


def check_format(path: Path) -> str:
    """Format of the path's suffix. Raises FigureError, naming the supported formats."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in formats():
        raise FigureError(f"{path}: suffix '{path.suffix}' is not known; use one of .{', .'.join(formats())}")
    return kind


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's suffix, with reproducible bytes. Raises FigureError."""
    kind, picture = check_format(path), io.BytesIO()
    figure.savefig(picture, format=kind, metadata=UNDATED.get(kind))
    write_atomically(path, picture.getvalue())


def _texts(artist: Artist) -> Iterator[Text]:
    """All text in a figure but the numbers beside axes."""
    for child in artist.get_children():
        if isinstance(child, Text):
            yield child
        if not isinstance(child, Tick):
            yield from _texts(child)
