"""Through how many files a reader follows a model."""

from __future__ import annotations

from benchmarks.size import followed, small_plate


def test_a_model_reaches_its_first_step_through_few_files() -> None:
    """Features that a model does not use are not called."""
    files = followed(small_plate())
    assert len(files) <= 62, files  # measured 62
    assert not [file for file in files if "adaptivity_choice" in file or "rigid" in file or "supports" in file]
