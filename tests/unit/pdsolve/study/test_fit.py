"""Least squares over runs whose curves are formulas: what comes out is known, and what cannot is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from messages import mentions, naming

from pdsolve.measures.measured_curve import MeasuredCurve
from pdsolve.study import fit
from pdsolve.study.description import Case, Study, StudyError, read_study
from pdsolve.study.fit import Fit, fit_study
from pdsolve.study.table import FAILED, FINISHED, Row

WAY = np.linspace(0, 2e-3, 41)
Curve = Callable[[dict[str, float]], np.ndarray]


def softening(model: dict[str, float]) -> np.ndarray:
    """A force that rises with E to a peak of f_t and falls over a length by G0 / f_t."""
    strength, toughness = model["material.f_t"], model["material.G0"]
    return np.minimum(WAY * 2e10, strength * np.exp(-np.maximum(WAY - 1e-4, 0) * strength / (4e3 * toughness)))


class Runs:
    """Runs that are formulas."""

    dimension = 2

    def __init__(self, curve: Curve, fails: Callable[[dict[str, float]], bool]) -> None:
        self.curve, self.fails = curve, fails
        self.models: list[dict[str, float]] = []

    def solve(self, cases: Sequence[Case], *_: object) -> list[Row]:
        rows = []
        for case in cases:
            self.models.append(dict(case.model))
            bad = self.fails(self.models[-1])
            number = len(self.models)
            rows.append(Row(number, case.key, FAILED if bad else FINISHED, "too far" if bad else None, number, 0, {}))
        return rows[::-1]

    def forces(self, number: int, *_: object) -> tuple[np.ndarray, np.ndarray]:
        return WAY, self.curve(self.models[number - 1])


@pytest.fixture
def solve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[Fit, Runs]]:
    """Fits the parameters of a text to a curve."""

    def fitted(
        text: str,
        curve: Curve,
        forces: np.ndarray,
        fails: Callable[[dict[str, float]], bool] = lambda model: False,
        way: np.ndarray = WAY,
        **more: Any,
    ) -> tuple[Fit, Runs]:
        runs = Runs(curve, fails)

        @contextmanager
        def open_runs(*_: object) -> Iterator[Runs]:
            yield runs

        monkeypatch.setattr(fit, "open_runs", open_runs)
        monkeypatch.setattr(fit, "load_displacement_points", runs.forces)
        monkeypatch.setattr(fit.Results, "open", staticmethod(nullcontext))
        measured = MeasuredCurve("curve.csv", way, forces, np.ones(len(way)), True)
        return fit_study(read(tmp_path, text), measured, "study.sqlite", **more), runs

    return fitted


def read(folder: Path, text: str) -> Study:
    """The study of this fit."""
    (folder / "plate.py").write_text("")
    path = folder / "study.toml"
    path.write_text(f'drawing = "plate.py"\n[fit]\ncondition = "pull"\n{text}')
    return read_study(path)


BOTH = """
[fit.model]
material.f_t = {first = 2.5e6, bounds = [1e6, 1e7]}
material.G0 = {first = 160, bounds = [20, 800]}
"""
STIFFNESS = "[fit.model]\nmaterial.E = {first = 1, bounds = [0.1, 10]}\n"


def test_two_parameters_of_an_exact_curve_come_back(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    truth = {"material.f_t": 3.33e6, "material.G0": 124.0}
    told: list[Any] = []
    result, runs = solve(BOTH, softening, softening(truth), watch=told.append)
    strength, toughness = result.parameters
    assert strength.value == pytest.approx(3.33e6, rel=1e-3)
    assert toughness.value == pytest.approx(124, rel=1e-3)
    assert (strength.unit, toughness.unit) == ("Pa", "J/m^2")
    assert result.is_converged
    assert result.misfit < 1e-3 < result.first_misfit
    assert result.remarks == ()
    assert result.runs == len({tuple(model.items()) for model in runs.models}) == len(runs.models)
    assert all(float(f"{value:.6g}") == value for model in runs.models for value in model.values())
    assert [progress.evaluation for progress in told] == list(range(1, result.evaluations + 1))
    assert result.correlation[0, 1] == result.correlation[1, 0]
    assert result.comparison.fitted == pytest.approx(softening(truth), rel=5e-3)


def test_a_standard_error_is_that_of_linear_regression(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    noise = np.random.default_rng(0).normal(0, 0.02, len(WAY))
    result, _ = solve(STIFFNESS, lambda model: model["material.E"] * WAY * 1e3, 3 * WAY * 1e3 + noise)
    (parameter,) = result.parameters
    x, y = WAY * 1e3, 3 * WAY * 1e3 + noise
    slope = x @ y / (x @ x)
    deviation = np.sqrt(np.sum((y - slope * x) ** 2) / (len(x) - 1) / (x @ x))
    assert parameter.value == pytest.approx(slope, rel=1e-4)
    assert parameter.standard_error == pytest.approx(deviation, rel=0.02)  # of forward differences over 2 %


def test_a_parameter_that_may_be_negative_is_scaled_by_its_bounds(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    text = "[fit.model]\nmaterial.nu = {first = 0.1, bounds = [-1, 3]}\n"
    noise = np.random.default_rng(2).normal(0, 1e-5, len(WAY))
    result, runs = solve(text, lambda model: (5 + model["material.nu"]) * WAY, 4.5 * WAY + noise)
    (parameter,) = result.parameters
    slope = WAY @ noise / (WAY @ WAY)
    deviation = np.sqrt(np.sum((noise - slope * WAY) ** 2) / (len(WAY) - 1) / (WAY @ WAY))
    assert parameter.value == pytest.approx(-0.5 + slope, abs=1e-3)
    assert parameter.standard_error == pytest.approx(deviation, rel=1e-3)
    assert runs.models[1]["material.nu"] == pytest.approx(0.1 + 0.02 * 4)  # the step of the derivative


def test_what_the_curve_does_not_depend_on_is_not_determined(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    text = STIFFNESS + "material.G0 = {first = 7, bounds = [1, 20]}\n"
    result, _ = solve(text, lambda model: (model["material.E"] + 1e-7 * model["material.G0"]) * WAY, 2 * WAY)
    stiffness, toughness = result.parameters
    assert stiffness.value == pytest.approx(2, rel=1e-3)
    assert result.evaluations <= 5  # as without it
    assert (toughness.value, toughness.standard_error, toughness.is_determined) == (7, None, False)
    assert mentions(result.remarks, "material.G0", "not determined")
    assert np.isnan(result.correlation[1]).all()


def test_parameters_that_act_alike_are_named(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    text = STIFFNESS + "material.nu = {first = 1, bounds = [0.5, 2]}\n"
    noise = np.random.default_rng(1).normal(0, 1e-5, len(WAY))
    forces = lambda model: model["material.E"] * model["material.nu"] * (WAY + 1e-6 * model["material.nu"])  # noqa: E731
    result, _ = solve(text, forces, 2 * WAY + noise)
    assert mentions(result.remarks, "material.E", "material.nu", "correlation")


def test_a_parameter_at_a_bound_is_named(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    text = "[fit.model]\nmaterial.E = {first = 1, bounds = [0.5, 1.2]}\n"
    result, _ = solve(text, lambda model: model["material.E"] * WAY, 2 * WAY)
    assert result.parameters[0].value == pytest.approx(1.2, rel=2e-3)
    assert mentions(result.remarks, "material.E", "bound")


def test_bounds_closer_than_a_step_of_the_derivative(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    text = "[fit.model]\nmaterial.E = {first = 1, bounds = [1, 1.01]}\n"
    result, _ = solve(text, lambda model: model["material.E"] * WAY, 1.005 * WAY)
    assert result.parameters[0].is_determined
    assert result.parameters[0].value == pytest.approx(1.005, rel=5e-4)  # measured 1.00466


def test_a_run_that_fails_on_the_way_is_stepped_back_from(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    fails = lambda model: model["material.E"] > 1.7  # noqa: E731
    told: list[Any] = []
    curve = lambda model: model["material.E"] ** 2 * WAY  # noqa: E731
    result, _ = solve(STIFFNESS, curve, 1.6**2 * WAY, fails, watch=told.append)
    assert [progress.misfit is None for progress in told] == [fails(progress.values) for progress in told]
    assert told[1].misfit is None
    assert result.parameters[0].value == pytest.approx(1.6, rel=1e-3)
    with pytest.raises(StudyError, match=naming("run 1", "material.E", "too far")):
        solve(STIFFNESS, lambda model: WAY, WAY, lambda model: True)


def test_points_beyond_the_first_curve_or_going_back_are_left_out(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    way = np.array([0.0, 1e-3, 0.5e-3, 1.5e-3, 3e-3])
    result, _ = solve(STIFFNESS, lambda model: model["material.E"] * WAY, 2 * way + (way == 0.5e-3), way=way)
    assert result.comparison.displacement.tolist() == [0.0, 1e-3, 1.5e-3]
    assert result.parameters[0].value == pytest.approx(2, rel=1e-3)
    assert mentions(result.remarks[0], "1 of 5", "2 mm")
    assert mentions(result.remarks[1], "1 of 5", "$.fit.gap")


def test_fewer_points_than_parameters_are_refused_before_a_run(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    with pytest.raises(StudyError, match=naming("curve.csv", "1 points", "2 parameters")):
        solve(BOTH, lambda model: pytest.fail("a run"), WAY[1:2], way=WAY[1:2])


def test_the_number_of_trials_is_limited_and_said(solve: Callable[..., tuple[Fit, Runs]]) -> None:
    truth = softening({"material.f_t": 6e6, "material.G0": 60.0})
    result, _ = solve("evaluations = 2\n" + BOTH, softening, truth)
    assert result.evaluations == 2
    assert not result.is_converged
    assert mentions(result.remarks, "$.fit.evaluations")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("no parameter",)),
        ("[fit.model]\nmaterial.E = {first = 1}\n", ("material.E", "bounds")),
        ("[fit.model]\nmaterial.E = {bounds = [1, 2]}\n", ("material.E", "first")),
        ("[fit.model]\nmaterial.E = {first = 1, bounds = [2, 3]}\n", ("material.E", "2", "3")),
        ("[fit.model]\nmaterial.E = {first = 1, bounds = [3, 0]}\n", ("material.E", "smaller")),
        ("[fit.drawing]\nlength = {first = 1, bounds = [0, inf]}\n", ("length", "finite")),
        (STIFFNESS + "[set.model]\nmaterial.E = 1\n", ("material.E", "$.set")),
        (STIFFNESS + "[vary.model]\nmaterial.G0 = [1]\n", ("$.vary",)),
        ("thickness = -1\n" + STIFFNESS, ("thickness",)),
        ("[fit.model]\nmaterial.E = 3\n", ("material.E", "3", "bounds")),
        ("[fit.model]\nmaterial.E = {first = 1, bound = [0, 2]}\n", ("material.E.first", "bounds")),
    ],
)
def test_a_fit_that_cannot_be_is_refused_in_one_line(tmp_path: Path, text: str, parts: tuple[str, ...]) -> None:
    with pytest.raises(StudyError, match=naming("study.toml")) as raised:
        read(tmp_path, text)
    assert "\n" not in str(raised.value)
    assert mentions(raised.value, *parts)


def test_the_runs_of_a_study_with_a_fit_are_the_first_guess(tmp_path: Path) -> None:
    study = read(tmp_path, BOTH + "[set.model]\nmaterial.E = 5\n")
    (case,) = study.cases()
    assert case.values == {"material.E": 5, "material.f_t": 2.5e6, "material.G0": 160}
    assert study.varied == ["material.f_t", "material.G0"]
