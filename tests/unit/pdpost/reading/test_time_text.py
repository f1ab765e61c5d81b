"""Times in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damaged_results import lattice, run
from plates import GLASS

from pdmesh import Run, Scene, Static, box, build
from pdpost import figures
from pdpost.figures.colours import scaled, title
from pdsolve.__main__ import main as pdsolve
from pdsolve.measures.crack_summary import crack, summary_for_json, summary_sentences
from pdsolve.measures.cracks import CrackEvent
from pdsolve.measures.embedded_model import moment
from pdsolve.measures.frame_steps import time_text
from pdsolve.results import Results


def test_the_unit_is_that_of_the_time() -> None:
    assert [time_text(seconds) for seconds in (0.0, 4.25e-5, -1e-3, 9.99e-3, 0.034, 0.099, -0.1, 0.75, 36)] == [
        "0 us",
        "42.5 us",
        "-1000 us",
        "9990 us",
        "34 ms",
        "99 ms",
        "-0.1 s",
        "0.75 s",
        "36 s",
    ]
    assert time_text(2e-6, "+.3g", "µs") == "+2 µs"


def test_a_crack_at_rest_has_no_speed() -> None:
    model = '{"material": {"E": 65e9, "rho": 2235, "G0": 204}, "run": {"solver": "static"}}'
    steps = [(10 * x, x, 0) for x in range(5, 15)]
    results = run(lattice(), steps, model=model)
    found = crack(results)
    assert "m/s" in " ".join(summary_sentences(crack(run(lattice(), steps, model=model.replace("static", "explicit")))))
    assert "m/s" not in " ".join(summary_sentences(found))
    assert summary_for_json(found)["branches"][0]["mean_speed"] is None
    assert np.isnan(found.branches[0].speed.value).all()
    assert len(figures.crack(results, found).axes) == 2


def test_a_crack_of_load_steps_is_told_in_seconds() -> None:
    model = '{"material": {"E": 65e9, "rho": 2235, "G0": 204}}'
    found = crack(run(lattice(), [(x, x, 0) for x in range(5, 15)], model=model))
    slow = replace(found, events=replace(found.events, first_break=CrackEvent(5, 2.5)))
    assert summary_sentences(slow)[0] == "first break: step 5, 2.5 s"


def test_no_time_is_a_power_of_ten() -> None:
    found = [time_text(seconds) for seconds in (9.9994e-3, 9.9996e-3, 9999.4, 9999.6, 1_209_600)]
    assert found == ["9999 us", "10 ms", "9999 s", "10000 s", "1209600 s"]


def test_slow_runs_are_in_seconds() -> None:
    assert scaled([np.array([0.0, 34e3])], "s") == (1.0, "s")
    assert scaled([np.array([0.0, 4e-5])], "s") == (1e6, "µs")
    assert scaled([np.array([34e3])], "m") == (1e-3, "km")


def test_pressures_have_engineering_prefixes() -> None:
    """Pa, kPa, MPa and GPa; below a thousandth of 1 Pa a power of ten; temperatures have no prefix."""
    units = [scaled([np.array([-size])], "Pa")[1] for size in (0.7, 3.0, 4e4, 2e8, 7e10, 2e-5)]
    assert units == ["Pa", "Pa", "kPa", "MPa", "GPa", "10⁻⁶ Pa"]
    assert scaled([np.array([0.2])], "Pa√m") == (1.0, "Pa√m")
    assert scaled([np.array([1500.0])], "K") == (1.0, "K")


def test_a_run_at_rest_counts_load_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "beam.json"
    scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, GLASS, 3, Run(solver="static", static=Static(load_steps=2)))
    build(scene.fix("left").load("right", traction=(1e3, 0), profile=((0, 0), (2, 1)))).write(path)
    assert pdsolve([str(path), "--quiet", "--threads", "1"]) == 0
    with Results.open(tmp_path / "beam.sqlite") as results:
        assert moment(results, 2) == "load step 2"
        assert title(results, "damage", "", 2, 5.0) == "Damage at load step 2, 5 times the displacement"
