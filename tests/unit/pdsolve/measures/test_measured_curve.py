"""A measured curve in a file, and what a computed curve has at its displacements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming

from pdsolve.measures.measured_curve import (
    MeasuredCurve,
    MeasuredCurveError,
    force_at_displacements,
    goes_on,
    misfit,
    read_measured_curve,
    scale_to_model,
)


def curve(folder: Path, text: str) -> MeasuredCurve:
    """The curve in a file of this text."""
    path = folder / "curve.csv"
    path.write_text(text, encoding="utf-8")
    return read_measured_curve(path)


def test_columns_are_known_by_their_units(tmp_path: Path) -> None:
    text = '\ufeff# a source\n"load, kN",weight,"lift, mm",note\n0,1,0,\n\n1.5,2,0.25,a\n# end\n'
    read = curve(tmp_path, text)
    assert read.displacement.tolist() == [0.0, 0.25e-3]
    assert read.force.tolist() == [0.0, 1500.0]
    assert read.weight.tolist() == [1.0, 2.0]
    assert not read.is_per_thickness
    assert curve(tmp_path, '"a, um","b, N/mm"\n2,3\n').force.tolist() == [3000.0]
    assert read_measured_curve(str(tmp_path / "curve.csv")).is_per_thickness


def test_both_are_positive_at_the_largest_force(tmp_path: Path) -> None:
    """As `pdpost reaction --csv` writes the force on a beam that is bent downwards."""
    read = curve(tmp_path, '"opening, m","force, N/m"\n0,0\n1e-4,-7\n2e-4,-3\n')
    assert read.force.tolist() == [0, 7, 3]
    assert read.displacement.tolist() == [0, 1e-4, 2e-4]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("0 lines",)),
        ('"lift, mm","load, N"\n', ("1 lines",)),
        ('"lift, mm","load"\n1,2\n', ("no column", "force", "load")),
        ("lift,load\n1,2\n", ("no column", "length", "lift")),
        ('"x, m","y, m","load, N"\n1,2,3\n', ("2 columns", "x, m", "y, m")),
        ('"lift, mm","load, N"\n1,2\n3,x\n', ("line 3", "x")),
        ('"lift, mm","load, N"\n1,2\n# but\n3\n', ("line 4",)),
        ('"lift, mm","load, N"\n1,inf\n', ("inf",)),
        ('"lift, mm","load, N"\n1,0\n', ("all forces",)),
        ('"lift, mm","load, N",weight\n1,2,-1\n', ("weight",)),
        ('"lift, mm","load, N\n1,2\n', ("CSV",)),
        ('"lift, mm","load, N"\n1,"2\n3",4\n', ("CSV",)),
        ('"lift, mm","load, N"\n1,2e31\n', ("line 2", "2e31")),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(tmp_path: Path, text: str, parts: tuple[str, ...]) -> None:
    with pytest.raises(MeasuredCurveError, match=naming("curve.csv", *parts)) as raised:
        curve(tmp_path, text)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(MeasuredCurveError, match=naming("none.csv")):
        read_measured_curve(tmp_path / "none.csv")


def test_forces_are_divided_by_the_thickness_in_2d_alone(tmp_path: Path) -> None:
    newton = curve(tmp_path, '"lift, mm","load, N"\n1,2\n')
    per = curve(tmp_path, '"lift, mm","load, N/m"\n1,2\n')
    assert scale_to_model(newton, 2, 0.1, "--thickness").force.tolist() == [20.0]
    assert scale_to_model(newton, 3, None, "--thickness").force.tolist() == [2.0]
    assert scale_to_model(per, 2, None, "--thickness").force.tolist() == [2.0]
    cases = ((newton, 2, None), (newton, 3, 0.1), (per, 2, 0.1), (per, 3, None))
    for read, dimension, thickness in cases:
        with pytest.raises(MeasuredCurveError, match=naming("curve.csv")):
            scale_to_model(read, dimension, thickness, "--thickness")
    for thickness in (0.0, -0.1, float("nan")):
        with pytest.raises(MeasuredCurveError, match=naming("--thickness")):
            scale_to_model(newton, 2, thickness, "--thickness")


def test_over_a_snap_back_the_force_falls_to_where_the_displacement_increases_again() -> None:
    way = np.array([0.0, 1.0, 2.0, 1.5, 1.0, 2.5, 3.0])
    force = np.array([0.0, 4.0, 6.0, 5.0, 1.0, 2.0, 1.0])
    at = np.array([0.0, 0.5, 2.0, 2.25, 2.5, 3.0, 9.0])
    assert force_at_displacements(at, way, force).tolist() == [0, 2, 6, 4, 2, 1, 1]
    assert goes_on(way).tolist() == [True, True, True, False, False, True, True]


def test_a_curve_that_begins_later_begins_at_the_origin() -> None:
    force = force_at_displacements(np.array([0.0, 0.5, 1.0]), np.array([1.0, 2.0]), np.array([4.0, 6.0]))
    assert force.tolist() == [0, 2, 4]


def test_a_misfit_is_the_root_mean_square_at_the_points_within_the_curve() -> None:
    at, load = np.array([0.0, 1.0, 0.5, 2.0, 9.0]), np.array([0.0, 10.0, 7.0, 4.0, 1.0])
    measured = MeasuredCurve("curve.csv", at, load, np.ones(5), True)
    share, number = misfit(measured, -np.array([0.0, 1.0, 2.0]), np.array([0.0, 11.0, 4.0]))
    assert number == 3
    assert share == pytest.approx(np.sqrt(1 / 3) / 10)
