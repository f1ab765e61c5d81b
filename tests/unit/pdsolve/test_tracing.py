"""Functions of a law as OpenCL C, without a device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from pdsolve.device.tracing import Code, Functions
from pdsolve.model import ModelError


def guarded(a: Any, b: Any) -> Any:
    """A quotient where there is one."""
    if a != 0:
        return b / a
    return b


def one_if_equal(a: Any, b: Any) -> Any:
    """A choice by equality."""
    if a == b:
        return a
    return a + b


def nothing(a: Any, b: Any) -> Any:
    """No number."""


@pytest.mark.parametrize(
    ("function", "parts"),
    [(guarded, ("if (p0 != (double)0x0.0p+0)", "p1 / p0", "return p1;")), (one_if_equal, ("if (p0 == p1)", "p0 + p1"))],
)
def test_each_comparison_is_written(function: Callable[..., Any], parts: tuple[str, ...]) -> None:
    functions = Functions()
    functions.write(function, 0.0, 0.0)
    assert all(part in functions.texts[0] for part in parts)


def test_what_returns_no_number_is_refused_in_a_line() -> None:
    with pytest.raises(ModelError, match="nothing does more than"):
        Functions().write(nothing, 0.0, 0.0)


@pytest.mark.parametrize("function", [guarded, one_if_equal])
def test_numbers_of_many_bonds_are_not_compared(function: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match="choice between numbers"):
        function(*Code().named("t{}", 2))
