"""Results as a notebook shows them: their last picture, as `pdpost` draws it, and a line of words."""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pdsolve.results.reader import Results

DPI = 110


def png(results: Results) -> bytes | None:
    """The damage, or of diffusion what diffuses, after the last frame as a PNG; None without a frame."""
    steps = results.frames()[0]
    if not len(steps):
        return None
    from pdpost.figures.field_figure import field  # drawing is pdpost's, and is needed by those alone who look
    from pdpost.figures.style import styled, written

    with styled():
        return written(field(results), "png", DPI)


def words(results: Results) -> str:
    """Where the results are, of what they are, how the run stands."""
    try:
        status, steps, nodes = results.meta().get("status"), results.frames()[0], len(results.nodes(0).ids)
    except (sqlite3.Error, ValueError):  # closed, or damaged: whoever asks for words wants no error
        return f"<Results {results.name}>"
    return f"<Results {results.name}: {nodes} nodes, {len(steps)} frames, {status}>"
