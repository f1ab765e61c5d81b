"""Models and studies of anyone's making: an answer or one line, never a traceback, a signal or no end."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from forged_databases import apart
from forged_inputs import STUDY, forged_toml, models

from benchmarks.kinds_of_run import KINDS

SOON = ("bonds", "particles", "at rest", "dissolution")  # seconds to compile
SLOW = (*SOON, "bilinear", "split", "ordinary", "hybrid", "collocation", "body", "diffusion")


@pytest.mark.slow
def test_forged_models(tmp_path: Path) -> None:
    """Those that are sound are solved first."""
    models(tmp_path, {name: KINDS[name]()[0] for name in SOON})
    assert apart("forged_models", tmp_path, 1, 12, module="forged_inputs") == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.endurance)])
def test_many_forged_models(count: int, tmp_path: Path) -> None:
    models(tmp_path, {name: KINDS[name]()[0] for name in SLOW})
    assert apart("forged_models", tmp_path, 2, count, module="forged_inputs", limit=3000) == []


@pytest.mark.slow
def test_forged_studies(tmp_path: Path) -> None:
    """None of them is solved."""
    models(tmp_path, {"plate": KINDS["bonds"]()[0]})
    assert apart("forged_studies", tmp_path, 1, 20, 0, module="forged_inputs") == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.endurance)])
def test_many_forged_studies(count: int, tmp_path: Path) -> None:
    """One that is sound is solved first, then every tenth: those start processes."""
    models(tmp_path, {"plate": KINDS["bonds"]()[0]})
    assert apart("forged_studies", tmp_path, 2, count, 10, module="forged_inputs", limit=3000) == []


def test_forgeries_differ() -> None:
    """Of studies, and many of them are TOML still."""
    texts = {forged_toml(STUDY, random.Random(seed)) for seed in range(40)}
    assert len(texts) > 35
    assert STUDY not in texts
