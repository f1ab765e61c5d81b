"""Explicit bond-based peridynamics with fracture: a node grid in, an SQLite database of results out.

For scripts: `read_model` reads a grid file with what is laid over it, `simulate` solves it; `read_study` and
`solve_study` do so with many.
"""

from typing import TYPE_CHECKING

from pdmesh.lazily import lazily

if TYPE_CHECKING:
    from pdsolve.model import Model, ModelError, ModelWarning, read_model
    from pdsolve.results import Results, ResultsError
    from pdsolve.simulation import resume, simulate
    from pdsolve.study.crew import solve_study
    from pdsolve.study.description import Study, StudyError, read_study
    from pdsolve.study.watch import StudyWatch
    from pdsolve.system import Options
    from pdsolve.unstable import UnstableError
    from pdsolve.watch import Watch
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Model": "pdsolve.model",
            "ModelError": "pdsolve.model",
            "ModelWarning": "pdsolve.model",
            "Options": "pdsolve.system",
            "Results": "pdsolve.results",
            "ResultsError": "pdsolve.results",
            "Study": "pdsolve.study.description",
            "StudyError": "pdsolve.study.description",
            "StudyWatch": "pdsolve.study.watch",
            "UnstableError": "pdsolve.unstable",
            "Watch": "pdsolve.watch",
            "read_model": "pdsolve.model",
            "read_study": "pdsolve.study.description",
            "resume": "pdsolve.simulation",
            "simulate": "pdsolve.simulation",
            "solve_study": "pdsolve.study.crew",
        },
    )

__all__ = [
    "Model",
    "ModelError",
    "ModelWarning",
    "Options",
    "Results",
    "ResultsError",
    "Study",
    "StudyError",
    "StudyWatch",
    "UnstableError",
    "Watch",
    "read_model",
    "read_study",
    "resume",
    "simulate",
    "solve_study",
]
