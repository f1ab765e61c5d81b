"""Functions of a law as OpenCL C: they are run on expressions, and what they compute is written down.

Such a function assigns, adds, subtracts, multiplies, divides, takes roots, and may ask what the law's constants are.
Each result is rounded, unless `fused` says otherwise. Functions of many bonds (`Code`) are of the run's precision, as
lanes are (see `pdsolve.codegen.lanes`), and are written where they are called. Those of one bond (`Functions`) are of
double precision, compare numbers too, and become functions of C, which are run once for each way through them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np

from pdsolve.codegen.fused import fused
from pdsolve.laws import calls
from pdsolve.laws.calls import bound_functions
from pdsolve.laws.law import Function
from pdsolve.model import ModelError


class Code:
    """Statements in OpenCL C, one for each result."""

    def __init__(self, kind: str = "REAL", decisions: list[bool] | None = None) -> None:
        """Numbers are of this kind; None: what is run may not compare them."""
        self.kind, self._decisions = kind, decisions
        self.lines: list[str] = []  # that `statements` has not returned yet

    def named(self, pattern: str, count: int) -> tuple[Traced, ...]:
        """So many numbers, whose names in C are a pattern with their number in it."""
        return tuple(Traced(self, pattern.format(k)) for k in range(count))

    def write(self, expression: str) -> Traced:
        """The number that an expression is."""
        name = f"t{len(self.lines)}"
        self.lines.append(f"{self.kind} {name} = {expression};")
        return Traced(self, name)

    def text(self, number: Any) -> str:
        """A number in C."""
        if isinstance(number, Traced):
            return number.text
        return f"({self.kind}){float(number).hex() if np.isfinite(number) else 'INFINITY'}"

    def decide(self, comparison: str) -> bool:
        """What a comparison is taken to be."""
        if self._decisions is None:
            raise TypeError("a choice between numbers of many bonds")
        if not self._decisions:
            raise UndecidedError(comparison)
        return self._decisions.pop(0)

    def statements(self, form: str, values: tuple[Traced, ...]) -> str:
        """What is written since the last time, and a statement of this form for each value: its number, what it is."""
        lines, self.lines = self.lines, []
        return " ".join([*lines, *(form.format(k, value.text) for k, value in enumerate(values))])

    def call(self, name: str, law: Any, *values: Any) -> Any:
        """What a law's function of this name returns, given traced numbers. Raises ModelError for what it cannot
        write."""
        return run(in_line(bound_functions(law)[name]), law, *values)


class UndecidedError(Exception):
    """A comparison of numbers of a device, by its text, of which it is not said how it is taken."""


class Traced:
    """A number whose value is known on the device."""

    __hash__ = object.__hash__  # as equality is a comparison on the device

    def __init__(self, code: Code, text: str) -> None:
        self._code, self.text = code, text

    def sqrt(self) -> Traced:
        """The root, which numpy asks for."""
        return self._code.write(f"sqrt({self.text})")

    def fused(self, factor: Traced, summand: Traced) -> Traced:
        """This number times a factor and a summand more, in one rounding."""
        return self._code.write(f"fma({self.text}, {factor.text}, {summand.text})")

    def __neg__(self) -> Traced:
        return self._code.write(f"-{self.text}")

    def __bool__(self) -> bool:
        return self._code.decide(self.text)


def _binary(sign: str, swapped: bool) -> Callable[[Traced, Any], Traced]:
    def both(self: Traced, operand: Any) -> Traced:
        sides = self.text, self._code.text(operand)
        left_side, right_side = sides[::-1] if swapped else sides
        return self._code.write(f"{left_side} {sign} {right_side}")

    return both


def _comparison(sign: str) -> Callable[[Traced, Any], Traced]:
    return lambda self, operand: Traced(self._code, f"{self.text} {sign} {self._code.text(operand)}")


for _name, _sign in (("add", "+"), ("sub", "-"), ("mul", "*"), ("truediv", "/")):
    setattr(Traced, f"__{_name}__", _binary(_sign, False))
    setattr(Traced, f"__r{_name}__", _binary(_sign, True))
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!=")):
    setattr(Traced, f"__{_name}__", _comparison(_sign))


class Functions:
    """Functions of one bond in OpenCL C, each once."""

    def __init__(self, columns: Any = None) -> None:
        """`columns` are those of the law whose functions they are."""
        self._bound = {} if columns is None else bound_functions(columns)
        self._names: dict[Function, str] = {}
        self.texts: list[str] = []  # of all that is written

    def write(self, function: Function, *arguments: Any) -> str:
        """Write a function of such arguments, of which numbers are its parameters in C; returns its name there."""
        called = function.__name__
        if function.__module__ == calls.__name__:  # where the law's own may be called by the same name
            function = self._bound.get(called, function)
        if function not in self._names:
            body = "\n".join(self._statements(function, arguments, []))
            name = f"{called}_{len(self.texts)}"
            parameters = ", ".join(f"double p{k}" for k in range(sum(map(_is_number, arguments))))
            self.texts.append(f"inline double {name}({parameters}) {{\n{body}\n}}")
            self._names[function] = name
        return self._names[function]

    def _statements(self, function: Function, arguments: tuple[Any, ...], decisions: list[bool]) -> list[str]:
        """What a function computes where its comparisons have turned out so, and what it asks then."""
        code = Code("double", list(decisions))
        parameters = iter(code.named("p{}", len(arguments)))
        values = [next(parameters) if _is_number(argument) else argument for argument in arguments]
        try:
            output = run(plain(function, partial(partial, self._call, code)), *values)
        except UndecidedError as question:
            either = (self._statements(function, arguments, [*decisions, answer]) for answer in (True, False))
            yes, no = (lines[len(code.lines) :] for lines in either)
            return [*code.lines, f"if ({question}) {{", *yes, "}", *no]
        if not _is_number(output):
            raise _untraceable(function)
        return [*code.lines, f"return {code.text(output)};"]

    def _call(self, code: Code, function: Function, *arguments: Any) -> Traced:
        """Write a call of a function."""
        numbers = ", ".join(code.text(argument) for argument in arguments if _is_number(argument))
        return code.write(f"{self.write(function, *arguments)}({numbers})")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | Traced)


def run(function: Function, *values: Any) -> Any:
    """What a plain function returns, given traced numbers. Raises ModelError for what cannot be written."""
    try:
        return function(*values)
    except (AttributeError, TypeError):
        raise _untraceable(function) from None


def _untraceable(function: Function) -> ModelError:
    return ModelError(
        f"device: the law's {function.__name__} does more than add, multiply, divide and compare; use one that a"
        " device computes to the same bits (--device cpu)"
    )


def plain(function: Function, replace: Callable[[Any], Function]) -> Function:
    """A function as Python has it and not as compiled, in which others of this package are replaced."""
    python_function: Any = getattr(function, "py_func", function)
    scope = dict(python_function.__globals__)
    for name in python_function.__code__.co_names:
        value = scope.get(name)
        if value is fused:
            scope[name] = Traced.fused
        elif isinstance(value, FunctionType) or hasattr(value, "py_func"):
            scope[name] = replace(value)
    return FunctionType(
        python_function.__code__,
        scope,
        python_function.__name__,
        python_function.__defaults__,
        python_function.__closure__,
    )


def in_line(function: Function) -> Function:
    """A function, and all that it calls, as Python has them."""
    return plain(function, in_line)
