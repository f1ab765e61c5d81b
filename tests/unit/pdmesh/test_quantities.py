"""Numbers with units become SI values, to the last bit of the same decimal in metres."""

from __future__ import annotations

import pytest

from pdmesh.quantities import STRESSES, TIMES, UNITS, Unit, quantities, quantity


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0,0,50,20mm", (0.0, 0.0, 0.05, 0.02)),
        ("0,0,0.05,0.02", (0.0, 0.0, 0.05, 0.02)),
        ("5cm,20mm", (0.05, 0.02)),
        ("1,2cm,3,4mm", (0.01, 0.02, 0.003, 0.004)),
        ("-1e-3, 2.5um", (-1e-9, 2.5e-6)),
        ("1in", (0.0254,)),
        ("3 mm", (0.003,)),
        ("7\N{MICRO SIGN}m", (7e-6,)),
    ],
)
def test_a_unit_counts_for_the_numbers_before_it(text: str, values: tuple[float, ...]) -> None:
    assert quantities(text, UNITS) == values


def test_numbers_without_a_unit_are_in_the_usual_one() -> None:
    assert quantities("50,20", UNITS, Unit(1, 1000)) == (0.05, 0.02)
    assert quantities("50,20m", UNITS, Unit(1, 1000)) == (50.0, 20.0)


@pytest.mark.parametrize("text", ["", "a", "1,", "1mm2", "5kg", "nan", "inf", "1e999", "1 2", "3MPa"])
def test_what_is_no_length_is_refused(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        quantities(text, UNITS)


def test_times_and_stresses() -> None:
    assert quantity("20us", TIMES) == 2e-5
    assert quantity("10min", TIMES) == 600.0
    assert quantity("65GPa", STRESSES) == 65e9
    with pytest.raises(ValueError):  # noqa: PT011
        quantity("20mm", TIMES)
