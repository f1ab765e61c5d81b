"""Figures. A figure is a matplotlib figure that is returned, never shown; matplotlib's current settings apply.

`with styled():` draws in the house style of the commands, and `save` writes the same bytes each time.
"""

from typing import TYPE_CHECKING

from pdmesh.lazy_imports import lazily

if TYPE_CHECKING:
    from pdmesh.plain_figure import FigureError
    from pdpost.figures.animation import gif
    from pdpost.figures.bond_figure import bonds
    from pdpost.figures.charts import balance, histories, masses, reactions
    from pdpost.figures.crack_figure import comparison, crack
    from pdpost.figures.crack_surface_figure import crack_surface
    from pdpost.figures.field_figure import field
    from pdpost.figures.frames_figure import frames
    from pdpost.figures.page import report
    from pdpost.figures.scene_figure import nodes
    from pdpost.figures.study_figure import study
    from pdpost.figures.style import save, styled
    from pdpost.figures.tradeoff_figure import tradeoff
else:
    _HOMES = {
        "FigureError": "style",
        "balance": "charts",
        "bonds": "bond_figure",
        "comparison": "crack_figure",
        "crack": "crack_figure",
        "crack_surface": "crack_surface_figure",
        "field": "field_figure",
        "frames": "frames_figure",
        "gif": "animation",
        "histories": "charts",
        "masses": "charts",
        "nodes": "scene_figure",
        "reactions": "charts",
        "report": "page",
        "save": "style",
        "study": "study_figure",
        "styled": "style",
        "tradeoff": "tradeoff_figure",
    }
    __getattr__, __dir__ = lazily(__name__, {name: f"{__name__}.{home}" for name, home in _HOMES.items()})

__all__ = [
    "FigureError",
    "balance",
    "bonds",
    "comparison",
    "crack",
    "crack_surface",
    "field",
    "frames",
    "gif",
    "histories",
    "masses",
    "nodes",
    "reactions",
    "report",
    "save",
    "study",
    "styled",
    "tradeoff",
]
