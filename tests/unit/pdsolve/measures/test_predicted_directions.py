"""How far the path of a crack lies from what stress intensities predict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pdsolve.measures import crack_summary, directions
from pdsolve.measures.directions import InitialCrackDirection, PredictedCrackDirection, predict_initial_directions
from pdsolve.results import ResultsError

LEFT = InitialCrackDirection((0.02, 0.03), -45.1, -46.9, -43.4, 0.02, -45.1)


def results() -> Any:
    return SimpleNamespace(frames=lambda: (np.array([0, 4, 5, 6, 7]), np.zeros(5)))


def around(angle: float, low: float, high: float, J: float = 45.0) -> Any:
    value, ends = {"angle": np.array([angle]), "J": np.array([J])}, ({"angle": np.array([one])} for one in (low, high))
    return SimpleNamespace(value=value, low=next(ends), high=next(ends))


def test_the_last_frame_before_bonds_broke_predicts(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []

    def follow(_: Any, steps: list[int], near: tuple[float, float]) -> list[Any]:
        looked.append((steps, near))
        return [around(-70.5, -71.0, -70.0)]

    monkeypatch.setattr(directions, "follow_tip_intensities", follow)
    (found,) = predict_initial_directions(results(), [LEFT], 6)
    assert looked == [([5], (0.02, 0.03))]
    assert (found.frame_step, found.angle_from_pre_crack) == (5, -70.5)
    assert found.path_deviation == pytest.approx(25.4)
    assert predict_initial_directions(results(), [LEFT], 0) == []


@pytest.mark.parametrize("angle", [(-70.5, -90.0, -60.0), (np.nan, np.nan, np.nan), (-70.5, -71.0, -70.0, 0.0)])
def test_what_is_vague_predicts_nothing(angle: tuple[float, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(directions, "follow_tip_intensities", lambda *_: [around(*angle)])
    assert predict_initial_directions(results(), [LEFT], 6) == []


def test_a_tip_without_room_predicts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def follow(*_: Any) -> Any:
        raise ResultsError("found no tip")

    monkeypatch.setattr(directions, "follow_tip_intensities", follow)
    assert predict_initial_directions(results(), [LEFT], 6) == []


def test_a_path_that_leans_to_the_grid_is_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crack_summary, "moment", lambda _, step: f"load step {step}")
    lines = crack_summary.prediction_sentences(
        [
            PredictedCrackDirection((0.02, 0.03), 5, -70.5, -71, -70, 25.4),
            PredictedCrackDirection((0.02, 0.03), 5, -1e-4, -1, 1, -0.3),
        ],
        results(),
    )
    assert lines[0].startswith("from (20, 30) mm: sif at load step 5, before bonds broke, predicts -70.5 degrees; the")
    assert "25.4 degrees from it: cracks of broken bonds lean to rows" in lines[0]
    assert lines[1].endswith("predicts +0.0 degrees; the path lies 0.3 degrees from it")
