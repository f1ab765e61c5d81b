"""Parameters of a model by least squares: runs of a study whose load-displacement curves approach a measured one.

SciPy's trust-region method with bounds chooses the parameters. Each comparison is a run of the study, found again in
its table by its parameters, so that a fit that was stopped repeats no finished run.

The variables are scaled to 1 at the first guess: 1 + ln(p / first) where the bounds are positive, so that a step is a
share of the parameter; otherwise 1 + (p - first) / (upper - lower). Derivatives are forward differences over
`fit.step` of these variables (2 %), backward ones at the upper bound: a run follows its path in steps of its own, and
its curve scatters by more than a difference of the usual 1e-8 would show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath
from pdsolve.measures.measured_curve import (
    END,
    MeasuredCurve,
    force_at_displacements,
    goes_on,
    load_displacement_points,
    scale_to_model,
)
from pdsolve.results import Results
from pdsolve.study.description import FitSettings, Study, StudyError
from pdsolve.study.dispatch import DEFAULT_WORKERS, StudyRuns, StudyWorkers, open_runs
from pdsolve.study.measure_columns import UNITS, column_of
from pdsolve.study.table import FINISHED, Row

Floats = NDArray[np.float64]
DIGITS = 6  # of parameters, so that a value computed again names the same run
CHANGE = 5e-4  # of the scaled variables: a step this small ends the fit
DECREASE = 1e-5  # of the sum of squares, likewise
GRADIENT = 1e-6
SEEN = 1e-5  # of the largest measured force: a parameter whose step changes the curve by less is not determined
PULL = 1e-6  # of each variable towards the first guess: it decides what the curve does not
ALIKE = 0.99  # correlation of parameters that the curve cannot tell apart
NEAR = 1e-3  # of the scaled variables: a parameter this near to a bound is at it


class FittedParameter(NamedTuple):
    """A parameter of a fit."""

    name: str
    unit: str  # "" where it has none, or the unit of the drawing
    first: float
    value: float
    standard_error: float | None  # None: the curve does not determine it, or has no more points than parameters
    is_determined: bool
    is_at_bound: bool


class FitComparison(NamedTuple):
    """The n measured points that were compared, and the curves at their displacements; forces as the model has them."""

    displacement: Floats  # (n,) m
    measured: Floats  # (n,) N/m, of a body N
    weight: Floats  # (n,)
    first: Floats  # (n,) by the first guess
    fitted: Floats  # (n,)


class Fit(NamedTuple):
    """The result of a fit."""

    parameters: tuple[FittedParameter, ...]
    correlation: Floats  # (p, p), NaN of parameters that are not determined
    comparison: FitComparison
    first_misfit: float  # root mean square of the residual over the largest measured force
    misfit: float
    runs: int  # those of the derivatives included
    evaluations: int  # sets of parameters that were tried
    is_converged: bool
    is_per_thickness: bool  # whether forces are in N/m, of a 2D model
    remarks: tuple[str, ...]
    run_file: Path  # the database of the fitted run


class FitProgress(NamedTuple):
    """A set of parameters that was tried."""

    evaluation: int  # counted from 1
    values: dict[str, float]
    misfit: float | None  # None: the run failed


def fit_study(
    study: Study,
    measured: MeasuredCurve,
    output: FilePath,
    workers: StudyWorkers = DEFAULT_WORKERS,
    watch: Callable[[FitProgress], None] | None = None,
    again: bool = False,
    force: bool = False,
) -> Fit:
    """Fit the parameters of a study with `[fit]` to a measured curve.

    Parameters
    ----------
    study
        A study with `[fit]`, from `read_study`.
    measured
        The curve, from `read_measured_curve`.
    output
        The table of the runs, which are in a folder beside it; a fit that was stopped goes on from there.
    workers
        The processes that solve the runs of a derivative.
    watch
        Called with each set of parameters that was tried.
    again, force
        Solve failed runs once more; remove existing runs.

    Returns
    -------
    Fit
        Parameters with standard errors, their correlation, and the compared curves.

    Raises
    ------
    StudyError, MeasuredCurveError, BusyError, OSError
        For a study without `[fit]`, a curve with fewer points than parameters, and if a run that the fit needs failed.
    """
    from scipy.optimize import least_squares  # slow to import

    if study.description.fit is None:
        raise StudyError(f"{study.path} has no [fit]; name the condition and the parameters there")
    with open_runs(study, output, workers, force) as runs:
        problem = _Problem(study, study.description.fit, measured, runs, watch, again)
        problem.expect_first_guess()
        solution = least_squares(
            problem.residual,
            np.ones(len(problem.variables)),
            problem.jacobian,
            bounds=(problem.lower, problem.upper),
            method="trf",
            ftol=DECREASE,
            xtol=CHANGE,
            gtol=GRADIENT,
            max_nfev=study.description.fit.evaluations,
        )
        return problem.result(np.asarray(solution.x), np.asarray(solution.jac), int(solution.nfev), solution.status > 0)


class _Variable(NamedTuple):
    """A parameter as a variable that is 1 at the first guess."""

    kind: str
    name: str
    first: float
    bounds: tuple[float, float]

    @property
    def is_share(self) -> bool:
        return self.bounds[0] > 0

    @property
    def width(self) -> float:
        return self.bounds[1] - self.bounds[0]

    def scaled(self, value: float) -> float:
        return 1 + (math.log(value / self.first) if self.is_share else (value - self.first) / self.width)

    def value(self, scaled: float) -> float:
        """The parameter, rounded and within its bounds."""
        value = self.first * math.exp(scaled - 1) if self.is_share else self.first + (scaled - 1) * self.width
        return min(max(float(f"{value:.{DIGITS}g}"), self.bounds[0]), self.bounds[1])

    def error(self, value: float, scaled_error: float) -> float:
        return scaled_error * (value if self.is_share else self.width)


class _Problem:
    """The residual of a fit and its derivative, from runs of the study."""

    def __init__(
        self,
        study: Study,
        fit: FitSettings,
        measured: MeasuredCurve,
        runs: StudyRuns,
        watch: Callable[[FitProgress], None] | None,
        again: bool,
    ) -> None:
        self._study, self._fit, self._runs, self._watch, self._again = study, fit, runs, watch, again
        self._measured = scale_to_model(measured, runs.dimension, fit.thickness, "$.fit.thickness")
        self.variables = [
            _Variable(kind, name, float(parameter.first or 0.0), parameter.bounds or (0.0, 0.0))
            for kind, name, parameter in fit.named()
        ]
        self._expect_points(len(measured.force))
        self.lower, self.upper = (
            np.array([variable.scaled(variable.bounds[end]) for variable in self.variables]) for end in (0, 1)
        )
        self._rows: dict[tuple[float, ...], Row] = {}
        self._curves: dict[tuple[float, ...], tuple[Floats, Floats]] = {}
        self._evaluations = 0
        self._remarks: list[str] = []

    def expect_first_guess(self) -> None:
        """Solve the first guess, and leave out measured points beyond the end of its curve. Raises StudyError."""
        first = self._values(np.ones(len(self.variables)))
        self._solve([first])
        self._expect_run(first)
        displacement, _ = self._curves[first]
        measured, end = self._measured, float(displacement.max())
        is_beyond = measured.displacement > end * END
        if is_beyond.any():
            self._remarks.append(
                f"{is_beyond.sum()} of {len(is_beyond)} measured points are beyond the end of the first run's curve"
                f" ({end * 1e3:.4g} mm) and are left out"
            )
        goes_back = ~goes_on(measured.displacement)
        if goes_back.any():
            self._remarks.append(
                f"{goes_back.sum()} of {len(goes_back)} measured points are at a smaller displacement than one before"
                " and are left out; a fit against the opening of a gap ($.fit.gap) follows snap-backs"
            )
        inside = ~is_beyond & ~goes_back & (measured.weight > 0)
        self._expect_points(int(inside.sum()))
        self._measured = measured._replace(
            displacement=measured.displacement[inside], force=measured.force[inside], weight=measured.weight[inside]
        )
        self._peak = float(np.abs(self._measured.force).max())
        self._share = np.sqrt(self._measured.weight / self._measured.weight.sum()) / self._peak

    def _expect_points(self, number: int) -> None:
        """Raise StudyError for fewer points than parameters."""
        if number < len(self.variables):
            raise StudyError(
                f"{self._measured.name}: {number} points to compare for {len(self.variables)} parameters; give as many"
                " points at least, or let runs go further"
            )

    def residual(self, scaled: Floats) -> Floats:
        """Weighted differences of the curves, NaN of a failed run, and the pull of the variables (n + p,)."""
        values = self._values(scaled)
        self._solve([values])
        residual = self._residual(values)
        self._evaluations += 1
        if self._watch is not None:
            misfit = float(np.linalg.norm(residual))
            named = dict(zip((variable.name for variable in self.variables), values, strict=True))
            self._watch(FitProgress(self._evaluations, named, misfit if math.isfinite(misfit) else None))
        return np.concatenate([residual, PULL * (scaled - 1)])

    def jacobian(self, scaled: Floats) -> Floats:
        """The derivative (n + p, p) of the residual, by differences; 0 where a parameter changes no curve."""
        here = self._values(scaled)
        shifted = []
        for column, variable in enumerate(self.variables):
            above, below = self.upper[column] - scaled[column], scaled[column] - self.lower[column]
            way = min(self._fit.step, above) if above >= min(self._fit.step, below) else -min(self._fit.step, below)
            values = list(here)
            values[column] = variable.value(scaled[column] + way)
            shifted.append(tuple(values))
        self._solve(shifted)
        columns = []
        for column, (variable, there) in enumerate(zip(self.variables, shifted, strict=True)):
            self._expect_run(there)
            change = self._residual(there) - self._residual(here)
            seen = np.abs(self._force(there) - self._force(here)).max() > SEEN * self._peak
            step = variable.scaled(there[column]) - variable.scaled(here[column])
            columns.append(change / step if seen else np.zeros_like(change))
        return np.vstack([np.column_stack(columns), PULL * np.eye(len(columns))])

    def result(self, scaled: Floats, jacobian: Floats, evaluations: int, is_converged: bool) -> Fit:
        """The fit at the end of the iteration."""
        values, first = self._values(scaled), self._values(np.ones(len(self.variables)))
        residual = self._residual(values)
        jacobian = jacobian[: len(residual)]
        is_determined = (jacobian != 0).any(axis=0)
        errors, correlation = _errors_and_correlation(jacobian, residual, is_determined)
        at_bound = (scaled - self.lower < NEAR) | (self.upper - scaled < NEAR)
        parameters = tuple(
            FittedParameter(
                column_of(variable.kind, variable.name),
                UNITS.get(variable.name, ""),
                variable.first,
                value,
                None if math.isnan(error) else variable.error(value, error),
                bool(determined),
                bool(at),
            )
            for variable, value, error, determined, at in zip(
                self.variables, values, errors, is_determined, at_bound, strict=True
            )
        )
        remarks = [*self._remarks, *_remarks(parameters, correlation)]
        if not is_converged:
            remarks.append(
                f"not converged after {evaluations} sets of parameters; begin nearer, or raise $.fit.evaluations"
            )
        comparison = FitComparison(
            self._measured.displacement,
            self._measured.force,
            self._measured.weight,
            self._force(first),
            self._force(values),
        )
        return Fit(
            parameters,
            correlation,
            comparison,
            float(np.linalg.norm(self._residual(first))),
            float(np.linalg.norm(residual)),
            len(self._rows),
            evaluations,
            is_converged,
            self._measured.is_per_thickness,
            tuple(remarks),
            self._rows[values].file,
        )

    def _values(self, scaled: Floats) -> tuple[float, ...]:
        return tuple(variable.value(float(number)) for variable, number in zip(self.variables, scaled, strict=True))

    def _solve(self, wanted: Sequence[tuple[float, ...]]) -> None:
        """Solve the runs with these values, and read their curves."""
        new = [values for values in dict.fromkeys(wanted) if values not in self._rows]
        if not new:
            return
        names = [variable.name for variable in self.variables]
        cases = [self._study.case_of_fit(dict(zip(names, values, strict=True))) for values in new]
        rows = {row.key: row for row in self._runs.solve(cases, None, self._again)}
        for values, case in zip(new, cases, strict=True):
            self._rows[values] = row = rows[case.key]
            if row.status == FINISHED:
                with Results.open(row.file) as results:
                    self._curves[values] = load_displacement_points(results, self._fit.condition, self._fit.gap)

    def _expect_run(self, values: tuple[float, ...]) -> None:
        """Raise StudyError unless the run with these values is finished."""
        row = self._rows[values]
        if values not in self._curves:
            named = ", ".join(
                f"{variable.name} = {value:g}" for variable, value in zip(self.variables, values, strict=True)
            )
            raise StudyError(f"run {row.number} with {named} failed: {row.error}; change the first guess or the bounds")

    def _force(self, values: tuple[float, ...]) -> Floats:
        if values not in self._curves:
            return np.full_like(self._measured.force, np.nan)
        return force_at_displacements(self._measured.displacement, *self._curves[values])

    def _residual(self, values: tuple[float, ...]) -> Floats:
        return np.asarray((self._force(values) - self._measured.force) * self._share)


def _errors_and_correlation(
    jacobian: Floats, residual: Floats, is_determined: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Standard errors (p,) of the scaled variables, and their correlation (p, p); NaN where they are not determined.

    The covariance is s^2 (J^T J)^-1, with s^2 the sum of squares over the points that are more than the parameters.
    """
    points, count = jacobian.shape
    errors, correlation = np.full(count, np.nan), np.full((count, count), np.nan)
    columns = np.flatnonzero(is_determined)
    if not len(columns):
        return errors, correlation
    _, sizes, rows = np.linalg.svd(jacobian[:, columns], full_matrices=False)
    if len(sizes) < len(columns) or sizes[-1] <= 1e-9 * sizes[0]:
        return errors, correlation
    inverse = (rows.T / sizes**2) @ rows
    deviation = np.sqrt(np.diag(inverse))
    correlation[np.ix_(columns, columns)] = inverse / np.outer(deviation, deviation)
    if points > len(columns):
        errors[columns] = deviation * math.sqrt(float(residual @ residual) / (points - len(columns)))
    return errors, correlation


def _remarks(parameters: Sequence[FittedParameter], correlation: Floats) -> list[str]:
    """What is doubtful of a fit, one line each."""
    remarks = [
        f"{parameter.name} is not determined: the curve does not depend on it; leave it out of $.fit"
        for parameter in parameters
        if not parameter.is_determined
    ]
    remarks += [
        f"{parameter.name} ended at a bound; widen its bounds if it may lie beyond"
        for parameter in parameters
        if parameter.is_at_bound
    ]
    for one in range(len(parameters)):
        for other in range(one):
            if abs(correlation[one, other]) > ALIKE:
                remarks.append(
                    f"{parameters[other].name} and {parameters[one].name} have a correlation of"
                    f" {correlation[one, other]:.4f}: the curve tells them hardly apart; fix one of them"
                )
    return remarks
