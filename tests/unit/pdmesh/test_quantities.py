"""Numbers with units become SI values, to the last bit of the same decimal in metres."""

from __future__ import annotations

import pytest

from pdmesh.quantities import STRESSES, TIMES, UNITS, Unit, number_in, quantities, quantity


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


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("0.5mm", "m", 5e-4),
        ("0.7mm", "mm", 0.7),
        ("5e-4", "mm", 5e-4),
        ("5cm", "mm", 50.0),
        ("1in", "cm", 2.54),
        ("65 GPa", "Pa", 65e9),
        ("-25ns", "s", -25e-9),
        ("2.2g/cm^3", "kg/m^3", 2200.0),
        ("0.2N/mm", "J/m^2", 200.0),
        ("300K", "K", 300.0),
        ("4", "", 4.0),
    ],
)
def test_a_number_in_the_unit_of_a_parameter(text: str, unit: str, number: float) -> None:
    assert number_in(text, unit) == number


@pytest.mark.parametrize(
    ("text", "unit", "use"),
    [
        ("5MPa", "m", "a number, in m, or with one of the units m, cm, mm, um, in, ft"),
        ("5mm", "", "a number"),
        ("5mm", "degree", "a number, in degree"),
        ("fine", "s", "a number, in s, or with one of the units s, ms, us, ns, min, h"),
    ],
)
def test_another_unit_is_refused(text: str, unit: str, use: str) -> None:
    with pytest.raises(ValueError, match=f"^{use}$"):
        number_in(text, unit)
