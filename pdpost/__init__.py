"""Pictures, histories and crack figures from a database of peridynamic results.

For scripts: `Results.open` reads a database, `crack` returns what its cracks did (`crack_3d` of a
body), `figures` draws it. `crack_table` and
`study_table` are tables that `pandas.DataFrame` accepts directly. `pdpost.measures` holds the other measures,
`pdpost.exports` writes files for other programs.
"""

from typing import TYPE_CHECKING

from pdmesh.lazy_imports import lazily

if TYPE_CHECKING:
    from pdpost import figures
    from pdpost.figures.field_figure import notebook_png
    from pdpost.measures.bond_pairs import largest_displacement, largest_stretch
    from pdpost.measures.crack_3d import CrackSurfaceSummary, crack_3d
    from pdpost.measures.crack_summary import CrackPathSummary, crack, crack_table
    from pdpost.reading.studies import study_table
    from pdsolve.results import Results
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Results": "pdsolve.results",
            "CrackPathSummary": "pdpost.measures.crack_summary",
            "CrackSurfaceSummary": "pdpost.measures.crack_3d",
            "crack": "pdpost.measures.crack_summary",
            "crack_3d": "pdpost.measures.crack_3d",
            "crack_table": "pdpost.measures.crack_summary",
            "figures": "pdpost.figures",
            "largest_displacement": "pdpost.measures.bond_pairs",
            "largest_stretch": "pdpost.measures.bond_pairs",
            "notebook_png": "pdpost.figures.field_figure",
            "study_table": "pdpost.reading.studies",
        },
    )

__all__ = [
    "CrackPathSummary",
    "CrackSurfaceSummary",
    "Results",
    "crack",
    "crack_3d",
    "crack_table",
    "figures",
    "largest_displacement",
    "largest_stretch",
    "notebook_png",
    "study_table",
]
