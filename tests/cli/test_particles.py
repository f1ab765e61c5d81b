"""Cracks that are particles, as they are typed: solved, killed and gone on with, drawn, a notch of another run."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from crack_particle_strips import pulled
from database_contents import contents, kill_when
from messages import mentions, naming

from pdmesh.drawing import parameters
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.fracture.crack_particles import until
from pdsolve.measures.tip_surroundings import tip_histories
from pdsolve.results import Results
from pdsolve.results.errors import DamagedError

RULES = ["--cracks", "particles", "--set", "run.particles.criterion=stress", "--set", "run.particles.strength=2.5e7"]


@pytest.fixture
def strip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A strip with a crack, of bonds, and the folder of it."""
    monkeypatch.chdir(tmp_path)
    from pdmesh.model.document import ParticleRules

    Path("strip.json").write_text(pulled(ParticleRules(), cracks="bonds").to_json())
    return tmp_path


@pytest.mark.slow
def test_solved_drawn_and_taken_as_a_notch(strip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdsolve(["strip.json", *RULES, "--threads", "1", "-q"]) == 0
    for command in (["damage", "strip.sqlite", "-o", "damage.svg"], ["notch", "strip.sqlite"]):
        assert pdpost(command) == 0
    assert "grown crack" in Path("damage.svg").read_text()
    said = capsys.readouterr().out
    assert mentions(said, "strip.notch.json")
    assert pdpost(["notch", "strip.sqlite", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    with Results.open(Path("strip.sqlite")) as results:
        particles = results.particles()
    assert len(told["lines"]) == 3  # a trunk and two branches
    assert sum(map(len, told["lines"])) == len(particles.place) + 2  # the fork is in all of them
    grown = json.loads(Path("strip.notch.json").read_text())
    assert len(grown["notch"]) == len(particles.place) - 1
    assert pdsolve(["strip.notch.json", "--cracks", "bonds", "--dry-run"]) == 0
    assert pdpost(["notch", "strip.sqlite", "--frame", "0", "--csv", "-"]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 2


@pytest.mark.slow
def test_tips_are_those_of_the_particles(strip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At every frame, each with the way of its last arm; nodes that are cracked are not asked."""
    assert pdsolve(["strip.json", *RULES, "--threads", "1", "-q"]) == 0
    with Results.open(Path("strip.sqlite")) as results:
        particles, every, dt = results.particles(), tip_histories(results, 240), float(results.meta()["time_step"])
        fork = int(np.argmax(np.bincount(particles.parent[1:])))
        for step in results.frames()[0].tolist():
            there = until(particles, step)
            ends = np.setdiff1d(np.arange(1, len(there.place)), there.parent)
            arms = there.place[ends] - there.place[there.parent[ends]]
            tips = sorted(filter(None, (front.tip_at(step * dt) for front in every)), key=lambda tip: tip.place[1])
            assert np.array([tip.place for tip in tips]) == pytest.approx(there.place[ends])
            ways = arms / np.hypot(*arms.T)[:, None]
            assert np.array([tip.direction for tip in tips]) == pytest.approx(ways)
    capsys.readouterr()
    assert pdpost(["crack", "strip.sqlite", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    first, forked = int(particles.step[2]), int(particles.step[np.argmax(particles.parent == fork)])
    assert [len(branch["points"]) for branch in told["branches"]] == [
        fork,
        *[(len(particles.place) - fork + 1) // 2] * 2,
    ]
    assert [told[name]["step"] for name in ("start", "branching")] == [first, forked]
    assert told["forks"][0]["place"] == pytest.approx(particles.place[fork])
    assert [way["angle"] for way in told["directions"]] == pytest.approx([0.0])


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_tables(strip: Path) -> None:
    words = ["strip.json", *RULES, "--threads", "1", "-q", "--set", "run.steps=2400", "--set", "run.time_step=1e-8"]
    words += ["--set", "run.every=20"]
    assert pdsolve([*words, "-o", "whole.sqlite"]) == 0

    def met(results: Results) -> bool:
        return int(results.particles().step.max(initial=0)) > 0

    kill_when(met, Path("killed.sqlite"), ["-m", "pdsolve", *words, "-o", "killed.sqlite"])
    with Results.open(Path("killed.sqlite")) as results:
        assert results.meta()["status"] == "running"
    assert pdsolve(["--resume", "killed.sqlite", "--threads", "1", "-q"]) == 0
    assert contents(Path("killed.sqlite")) == contents(Path("whole.sqlite"))


@pytest.mark.slow
def test_a_particle_that_is_missing_is_noticed(strip: Path) -> None:
    import sqlite3
    from contextlib import closing

    assert pdsolve(["strip.json", *RULES, "--threads", "1", "-q"]) == 0
    with closing(sqlite3.connect("strip.sqlite")) as connection:
        connection.execute("DELETE FROM crack_particle WHERE particle = 3")
        connection.commit()
    with (
        Results.open(Path("strip.sqlite")) as results,
        pytest.raises(DamagedError, match=naming("crack_particle", "damaged")),
    ):
        results.particles()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--set", "run.particles.spacing=0.5"], re.escape("$.run.particles.spacing")),
        (["--set", "run.particles.branch=2"], re.escape("$.run.particles.branch")),
        (["--set", "material.gamma=0.5"], re.escape("$.material.gamma")),
        (["--set", "material.gamma=2"], naming("material.gamma", found="2", expected="sight 'visibility'")),
        (
            ["--cracks", "bonds"],
            naming("run.particles.criterion", found="run.cracks bonds", expected="run.cracks particles"),
        ),
        (["--set", "run.particles.toughness=1"], naming("toughness", found="1", expected=("criterion", "stress"))),
        (["--mode", "thesis"], naming("mode", found="thesis", expected=("conservative", "particles"))),
        (["--mode", "thesis", "--dry-run"], naming("mode", found="thesis", expected=("conservative", "particles"))),
    ],
)
def test_bad_input_is_one_line(strip: Path, capsys: pytest.CaptureFixture[str], more: list[str], said: str) -> None:
    assert pdsolve(["strip.json", *RULES, *more, "-o", "bad.sqlite"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert re.search(said, error)
    assert not Path("bad.sqlite").exists()


def test_drawings_say_it_too() -> None:
    own = {"E": 65e9, "rho": 2235.0, "G0": 204.0, "Sight": "diffraction", "Gamma": 2.0}
    values: dict[str, float | str] = {f"Peridynamics/Material/{name}": value for name, value in own.items()}
    values["Peridynamics/Run/Cracks"] = "particles"
    parameters.refuse_unknown(values, from_drawing=False)
    said = parameters.Parameters(values, parameters.UNITS["m"])
    material = parameters.material(said, "Material", None)
    assert material is not None
    assert (material.detour, parameters.run(said).cracks) == (2.0, "particles")


def test_a_run_of_bonds_has_no_particles(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["notch", str(small_results)]) == 2
    assert mentions(capsys.readouterr().err, found="particles", expected="--cracks")


def test_a_notch_has_no_settings(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        pdpost(["notch", str(small_results), "--style", "axes.grid=True"])
    assert stop.value.code == 2
    assert mentions(capsys.readouterr().err, "--style")
