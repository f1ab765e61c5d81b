"""Figures that show text as text: the one way to a figure in the three packages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.figure
from matplotlib.artist import Artist
from matplotlib.axis import Tick
from matplotlib.text import Text

from pdmesh.plain_text import for_figure

PROGRAMS = ("pgf",)  # formats whose text is a program


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


def _texts(artist: Artist) -> Iterator[Text]:
    """All text in a figure but the numbers beside axes."""
    for child in artist.get_children():
        if isinstance(child, Text):
            yield child
        if not isinstance(child, Tick):
            yield from _texts(child)
