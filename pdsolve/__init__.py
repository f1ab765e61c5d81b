"""Explicit bond-based peridynamics with fracture: a node grid in, an SQLite database of results out.

For scripts: `read_model` reads a grid file with what is laid over it, `simulate` solves it.
"""

from typing import TYPE_CHECKING

from pdmesh.lazily import lazily

if TYPE_CHECKING:
    from pdsolve.model import Model, ModelError, ModelWarning, read_model
    from pdsolve.results import Results, ResultsError
    from pdsolve.simulation import resume, simulate
    from pdsolve.system import Options
    from pdsolve.unstable import UnstableError
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
            "UnstableError": "pdsolve.unstable",
            "read_model": "pdsolve.model",
            "resume": "pdsolve.simulation",
            "simulate": "pdsolve.simulation",
        },
    )

__all__ = [
    "Model",
    "ModelError",
    "ModelWarning",
    "Options",
    "Results",
    "ResultsError",
    "UnstableError",
    "read_model",
    "resume",
    "simulate",
]
