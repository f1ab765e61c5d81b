"""Pictures, histories and crack figures from a database of peridynamic results.

For scripts: `Results.open` reads a database, `crack` returns what its cracks did (`crack_3d` of a body), `figures`
draws it. `crack_table` and `study_table` are tables that `pandas.DataFrame` accepts directly. `pdsolve.measures` holds
the other measures, `pdpost.exports` writes files for other programs. `%load_ext pdpost` lets a notebook draw results.
"""

from typing import TYPE_CHECKING, Any

from pdmesh.lazy_imports import lazily

if TYPE_CHECKING:
    from pdpost import figures
    from pdpost.figures.field_figure import notebook_png
    from pdpost.reading.studies import crack_table, study_table
    from pdsolve.measures.bond_pairs import largest_displacement, largest_stretch
    from pdsolve.measures.boundary_motion import boundary_motion
    from pdsolve.measures.crack_3d import CrackSurfaceSummary, crack_3d
    from pdsolve.measures.crack_summary import CrackPathSummary, crack
    from pdsolve.results import Results
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Results": "pdsolve.results",
            "CrackPathSummary": "pdsolve.measures.crack_summary",
            "CrackSurfaceSummary": "pdsolve.measures.crack_3d",
            "boundary_motion": "pdsolve.measures.boundary_motion",
            "crack": "pdsolve.measures.crack_summary",
            "crack_3d": "pdsolve.measures.crack_3d",
            "crack_table": "pdpost.reading.studies",
            "figures": "pdpost.figures",
            "largest_displacement": "pdsolve.measures.bond_pairs",
            "largest_stretch": "pdsolve.measures.bond_pairs",
            "notebook_png": "pdpost.figures.field_figure",
            "study_table": "pdpost.reading.studies",
        },
    )


def load_ipython_extension(shell: Any) -> None:
    """Let a notebook draw results that end a cell: `%load_ext pdpost`. `shell` is IPython's."""
    from pdpost.figures.field_figure import notebook_png
    from pdsolve.results import Results

    shell.display_formatter.formatters["image/png"].for_type(Results, notebook_png)


__all__ = [
    "CrackPathSummary",
    "CrackSurfaceSummary",
    "Results",
    "boundary_motion",
    "crack",
    "crack_3d",
    "crack_table",
    "figures",
    "largest_displacement",
    "largest_stretch",
    "notebook_png",
    "study_table",
]
