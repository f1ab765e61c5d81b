"""What a notebook shows of results: a picture of the last frame."""

from __future__ import annotations

from pdpost.figures.field_figure import field
from pdpost.figures.style import styled, written
from pdsolve.results import Results

DPI = 110


def notebook_png(results: Results) -> bytes | None:
    """The damage, or of diffusion what diffuses, after the last frame as a PNG; None without a frame."""
    if not len(results.frames()[0]):
        return None
    with styled():
        return written(field(results), "png", DPI)
