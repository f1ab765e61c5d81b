"""Explicit bond-based peridynamics with fracture: input is a node grid, output an SQLite database of results.

For scripts: `read_model` reads a grid file with settings, `simulate` solves it; `read_study` and `solve_study` do so
for many runs, `fit_study` fits parameters to a measured curve; `estimate_run` and `plan_study` estimate the cost;
`bond_pairs` lists the bonds of a run.
"""

from typing import TYPE_CHECKING

from pdmesh.lazy_imports import lazily

if TYPE_CHECKING:
    from pdsolve.errors import UnstableError
    from pdsolve.estimate import Plan, estimate_run, estimate_size
    from pdsolve.measures.measured_curve import MeasuredCurve, MeasuredCurveError, read_measured_curve
    from pdsolve.model import Model, ModelError, ModelWarning, read_model
    from pdsolve.options import Options
    from pdsolve.results import Results, ResultsError
    from pdsolve.run.progress import Watch
    from pdsolve.run.simulation import resume, simulate
    from pdsolve.schemes import bond_pairs
    from pdsolve.study.description import Study, StudyError, read_study
    from pdsolve.study.dispatch import StudyWatch, StudyWorkers, solve_study
    from pdsolve.study.fit import Fit, FitComparison, FitProgress, FittedParameter, fit_study
    from pdsolve.study.plan import plan_study, study_plan_lines
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Fit": "pdsolve.study.fit",
            "FitComparison": "pdsolve.study.fit",
            "FitProgress": "pdsolve.study.fit",
            "FittedParameter": "pdsolve.study.fit",
            "MeasuredCurve": "pdsolve.measures.measured_curve",
            "MeasuredCurveError": "pdsolve.measures.measured_curve",
            "Model": "pdsolve.model",
            "ModelError": "pdsolve.model",
            "ModelWarning": "pdsolve.model",
            "Options": "pdsolve.options",
            "Plan": "pdsolve.estimate",
            "Results": "pdsolve.results",
            "ResultsError": "pdsolve.results",
            "Study": "pdsolve.study.description",
            "StudyError": "pdsolve.study.description",
            "StudyWatch": "pdsolve.study.dispatch",
            "StudyWorkers": "pdsolve.study.dispatch",
            "UnstableError": "pdsolve.errors",
            "Watch": "pdsolve.run.progress",
            "bond_pairs": "pdsolve.schemes",
            "estimate_run": "pdsolve.estimate",
            "estimate_size": "pdsolve.estimate",
            "fit_study": "pdsolve.study.fit",
            "plan_study": "pdsolve.study.plan",
            "read_measured_curve": "pdsolve.measures.measured_curve",
            "read_model": "pdsolve.model",
            "read_study": "pdsolve.study.description",
            "resume": "pdsolve.run.simulation",
            "simulate": "pdsolve.run.simulation",
            "solve_study": "pdsolve.study.dispatch",
            "study_plan_lines": "pdsolve.study.plan",
        },
    )

__all__ = [
    "Fit",
    "FitComparison",
    "FitProgress",
    "FittedParameter",
    "MeasuredCurve",
    "MeasuredCurveError",
    "Model",
    "ModelError",
    "ModelWarning",
    "Options",
    "Plan",
    "Results",
    "ResultsError",
    "Study",
    "StudyError",
    "StudyWatch",
    "StudyWorkers",
    "UnstableError",
    "Watch",
    "bond_pairs",
    "estimate_run",
    "estimate_size",
    "fit_study",
    "plan_study",
    "read_measured_curve",
    "read_model",
    "read_study",
    "resume",
    "simulate",
    "solve_study",
    "study_plan_lines",
]
