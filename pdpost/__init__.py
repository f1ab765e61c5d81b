"""Pictures, histories and crack figures from a database of peridynamic results.

For scripts: `Results.open` reads a database, `crack` says what its cracks did, `figures` draws it;
`crack_table` and `study_table` are tables, which `pandas.DataFrame` takes as they are. What is measured
besides is in `pdpost.measures`, files for other programs in `pdpost.exports`.
"""

from typing import TYPE_CHECKING

from pdmesh.lazily import lazily

if TYPE_CHECKING:
    from pdpost import figures
    from pdpost.measures.crack_summary import crack, crack_table
    from pdpost.reading.columns import study_table
    from pdsolve.results import Results
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Results": "pdsolve.results",
            "crack": "pdpost.measures.crack_summary",
            "crack_table": "pdpost.measures.crack_summary",
            "figures": "pdpost.figures",
            "study_table": "pdpost.reading.columns",
        },
    )

__all__ = ["Results", "crack", "crack_table", "figures", "study_table"]
