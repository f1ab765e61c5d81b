"""`pdpost fatigue`: lives of smooth bodies beside Wöhler's line, growth of cracks beside the line given, many runs."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from pdmesh import Body, Box, Circle, Fatigue, Material, Run, Scene, box, build
from pdpost.__main__ import main as pdpost
from pdpost.figures.fatigue_figure import fatigue as figure
from pdsolve.measures.fatigue import CrackAreaGrowth, FatigueLife, ParisLine, TipFatigueGrowth
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

STEEL = Material(E=200e9, rho=7850, G0=1e9)
A1, M1 = 1e12, 6.0


def bar(strain: float) -> Scene:
    """A small bar with a hole, stretched by its ends, until its first bonds break."""
    run = Run(solver="static", steps=1, every=1, fatigue=Fatigue(A1=A1, m1=M1, endurance=1e-4))
    return (
        Scene(box(0, 0, 0.03, 0.012), 1e-3, STEEL, 3.0, run)
        .hole(Circle(0.015, 0.006, 0.0025))
        .fix("left", x=0, y=0)
        .fix("right", x=strain * 0.03, y=None)
    )


@pytest.fixture(scope="module")
def bars(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder, names = tmp_path_factory.mktemp("bars"), []
    for strain in (1e-3, 2e-3):
        path, made = folder / f"bar{strain * 1e3:.0f}.sqlite", build(bar(strain))
        simulate(Model(made.grid, made.settings), path, Options(threads=1)).close()
        names.append(str(path))
    return names


@pytest.mark.slow
def test_smooth_bodies_lie_on_woehlers_line(
    bars: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "lives.png"
    assert pdpost(["fatigue", bars[0], "--beside", bars[1], "-o", str(picture), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert picture.stat().st_size > 5000
    both = [said, *said["beside"]]
    assert [one["name"] for one in both] == ["bar1", "bar2"]
    for one in both:
        assert one["first_break"] == pytest.approx(1 / (A1 * one["first_range"] ** M1), rel=1e-9)
        assert one["tips"] == []
    assert both[1]["first_range"] == pytest.approx(2 * both[0]["first_range"], rel=0.01)
    assert pdpost(["fatigue", bars[0], "--beside", bars[1], "--csv", "-"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [(row["run"], row["tip"]) for row in rows] == [("bar1", "first break"), ("bar2", "first break")]
    assert float(rows[1]["range of stretch"]) == both[1]["first_range"]


@pytest.mark.slow
def test_the_area_that_opened_in_a_body_is_measured_over_cycles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bar in space, which is notched half through, until its crack has gone some spacings."""
    run = Run(solver="static", steps=60, every=2, fatigue=Fatigue(A=1e15, m=4.0))
    bar = (
        Body(Box((0, 0, 0), (0.012, 0.012, 0.005)), 1e-3, STEEL, 3.0, run)
        .crack(
            [
                [(-1, 0.006, -1), (0.004, 0.006, -1), (0.004, 0.006, 1)],
                [(-1, 0.006, -1), (-1, 0.006, 1), (0.004, 0.006, 1)],
            ]
        )
        .fix("front", x=0, y=0, z=0)
        .fix("back", x=0, y=2e-5, z=0)
    )
    built, path = build(bar), tmp_path / "bar.sqlite"
    simulate(Model(built.grid, built.settings), path, Options(threads=1)).close()
    assert pdpost(["fatigue", str(path), "-o", str(tmp_path / "bar.png"), "--json"]) == 0
    cycles, area = (np.array(column) for column in json.loads(capsys.readouterr().out)["area"].values())
    assert (np.diff(cycles) >= 0).all()
    assert (np.diff(area) >= 0).all()
    assert cycles[0] == area[0] == 0
    assert 1e-6 * 5 < area[-1] <= 0.008 * 0.005  # m^2: more than a spacing, less than what is not cut


def life(name: str, given: Fatigue, line: ParisLine | None, first: float | None = None) -> FatigueLife:
    dK = np.geomspace(10e6, 40e6, 5)
    rate = np.full(4, 2e-8)
    tip = TipFatigueGrowth("branch 0", np.arange(5.0), np.arange(5.0) * 1e-3, dK, dK, rate, np.ones(4, dtype=bool))
    return FatigueLife(name, 4.0, 0.1, first, None if first is None else 1e-3, given, [tip], line)


def test_the_line_that_was_given_stands_beside_the_one_found() -> None:
    line = ParisLine(1e-36, 3.5, 4, 0.0)
    of_K = life("K", Fatigue(C=2e-37, m=4.0), line)
    of_bonds = life("bonds", Fatigue(A=1e9, m=3.0, A1=A1, m1=M1), line, first=1e5)
    at = np.array([10e6, 20e6])
    assert of_K.growth_per_cycle_of_input_law(at) == pytest.approx([2e-9, 3.2e-8])
    given = of_bonds.growth_per_cycle_of_input_law(at)
    assert given is not None
    assert given[1] / given[0] == pytest.approx(8)
    assert life("none", Fatigue(A=1e9, m=3.0), None).growth_per_cycle_of_input_law(at) is None
    assert of_bonds.woehler_cycles_to_break(at * 1e-10) == pytest.approx([1e6, 1e6 / 64])
    drawn = figure([of_K, of_bonds])
    lengths, rates, lives = drawn.axes
    assert {one.get_text() for one in rates.get_legend().get_texts()} == {  # type: ignore[union-attr]
        *("K: measured, m = 3.5", "K: given, m = 4", "bonds: measured, m = 3.5", "bonds: given, m = 3")
    }
    assert len(lengths.lines) == 2
    (curve, point) = lives.lines
    assert point.get_xydata() == pytest.approx(np.array([[1e5, 1e-3]]))
    assert curve.get_xdata() == pytest.approx(1 / (A1 * np.asarray(curve.get_ydata()) ** M1))


def late_growth() -> FatigueLife:
    """A body whose crack is across after 2e4 cycles, and goes on beside it after 1e9."""
    growth = CrackAreaGrowth(np.array([0.0, 1e4, 1.5e4, 2e4, 1e9]), 1e-6 * np.array([0.0, 5.0, 10.0, 14.0, 15.0]))
    return life("late", Fatigue(A=1e9, m=3.0), None)._replace(total_cycles=1e9, tip_growths=[], area_growth=growth)


def test_growth_that_ends_early_has_an_axis_that_shows_it() -> None:
    late = late_growth()
    assert late.cycles_until_last_tenth() == 2e4
    assert late.spans_orders_of_magnitude
    assert figure([late]).axes[0].get_xscale() == "log"
    soon = late._replace(total_cycles=3e4)
    assert figure([soon]).axes[0].get_xscale() == "linear"
    still = late._replace(area_growth=CrackAreaGrowth(np.array([0.0, 1.0]), np.zeros(2)))
    assert still.cycles_until_last_tenth() is None


def test_the_growth_that_counts_is_that_of_the_longest_crack() -> None:
    one = life("two", Fatigue(A=1e9, m=3.0), None)
    (tip,) = one.tip_growths
    both = one._replace(tip_growths=[tip, tip._replace(cycles=1e6 * tip.cycles, grown_length=tip.grown_length / 2)])
    assert both.cycles_until_last_tenth() == 4


def test_lengths_without_a_K_stand_alone() -> None:
    unknown = life("narrow", Fatigue(A=1e9, m=3.0), None)._replace(K_refusal="the edge is near")
    (lengths,) = figure([unknown]).axes
    assert lengths.get_xlabel() == "cycles"
    assert len(figure([life("wide", Fatigue(A=1e9, m=3.0), None), unknown]).axes) == 2


def narrow_plate(run: Run) -> Scene:
    """A plate with a crack whose tip has no room for K, pulled by its ends."""
    return (
        Scene(box(0, 0, 0.012, 0.012), 1e-3, STEEL, 3.0, run)
        .crack([(0, 0.006), (0.004, 0.006)])
        .fix("bottom", x=0, y=0)
        .fix("top", x=0, y=2e-5)
    )


@pytest.mark.slow
def test_a_narrow_plate_has_its_length_over_cycles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Until the crack is across; `--until` leaves out what comes later, and the end of the run is told."""
    built, path = (
        build(narrow_plate(Run(solver="static", steps=60, every=1, fatigue=Fatigue(A=1e15, m=4.0)))),
        tmp_path / "n.sqlite",
    )
    simulate(Model(built.grid, built.settings), path, Options(threads=1)).close()
    picture = ["-o", str(tmp_path / "n.png"), "--force"]
    assert pdpost(["fatigue", str(path), *picture]) == 0
    said = capsys.readouterr().out
    assert "no K" in said
    assert "the run ended: " in said
    assert pdpost(["fatigue", str(path), "--json"]) == 0
    every = json.loads(capsys.readouterr().out)
    tip = every["tips"][0]
    assert tip["K"][0] is None
    assert np.diff(tip["cycles"]).min() >= 0
    assert 6e-3 < tip["length"][-1] < 9e-3
    half = every["cycles"] / 2
    assert pdpost(["fatigue", str(path), "--json", "--until", str(half)]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["cycles"] <= half
    assert first["ended"] is None
    assert every["ended"] is not None
    assert pdpost(["fatigue", str(path), "--json", "--until", "1e-9"]) != 0
