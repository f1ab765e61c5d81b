"""The picture that a notebook shows for results: the last frame."""

from __future__ import annotations

from pdpost.figures.field_figure import field
from pdpost.figures.style import styled, written
from pdsolve.results import Results

DPI = 110


def notebook_png(results: Results) -> bytes | None:
    """PNG of the damage, or of the amount that diffuses, in the last frame; None without a frame."""
    if not len(results.frames()[0]):
        return None
    with styled():
        return written(field(results), "png", DPI)
