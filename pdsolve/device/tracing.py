"""Functions of a law on lanes as OpenCL C: they are run on expressions, and what they compute is written down.

Such a function assigns, adds, subtracts, multiplies and divides numbers of a bond or a node, of the run's precision,
and may ask what the law's constants are. Each result is rounded, as that of lanes is (see
`pdsolve.codegen.lanes`).
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from pdsolve.codegen.fused import fused
from pdsolve.laws.calls import bound_functions
from pdsolve.laws.law import Function
from pdsolve.model import ModelError


class Code:
    """Statements in OpenCL C, one for each result."""

    def __init__(self) -> None:
        self.lines: list[str] = []  # that `statements` has not returned yet

    def named(self, pattern: str, count: int) -> tuple[Traced, ...]:
        """So many numbers, whose names in C are a pattern with their number in it."""
        return tuple(Traced(self, pattern.format(k)) for k in range(count))

    def write(self, expression: str) -> Traced:
        """The number that an expression is."""
        name = f"t{len(self.lines)}"
        self.lines.append(f"REAL {name} = {expression};")
        return Traced(self, name)

    def statements(self, form: str, values: tuple[Traced, ...]) -> str:
        """What is written since the last time, and a statement of this form for each value: its number, what it is."""
        lines, self.lines = self.lines, []
        return " ".join([*lines, *(form.format(k, value.text) for k, value in enumerate(values))])

    def call(self, name: str, law: Any, *values: Any) -> tuple[Any, ...]:
        """What a law's function of this name returns, given traced numbers. Raises ModelError for what it cannot
        write."""
        function = bound_functions(law)[name]
        try:
            outputs: tuple[Any, ...] = plain(function)(law, *values)
        except TypeError:
            raise ModelError(
                f"device: the law's {function.__name__} does more than add, multiply and divide; use one that a"
                " device computes to the same bits (--device cpu)"
            ) from None
        return outputs


class Traced:
    """A number whose value is known on the device."""

    def __init__(self, code: Code, text: str) -> None:
        self._code, self.text = code, text

    def fused(self, factor: Traced, summand: Traced) -> Traced:
        """This number times a factor and a summand more, in one rounding."""
        return self._code.write(f"fma({self.text}, {factor.text}, {summand.text})")

    def __bool__(self) -> bool:
        raise TypeError("a choice between numbers of a device")


def _binary(sign: str, swapped: bool) -> Callable[[Traced, Any], Traced]:
    def both(self: Traced, operand: Any) -> Traced:
        text = operand.text if isinstance(operand, Traced) else f"(REAL){float(operand).hex()}"
        left_side, right_side = (text, self.text) if swapped else (self.text, text)
        return self._code.write(f"{left_side} {sign} {right_side}")

    return both


for _name, _sign in (("add", "+"), ("sub", "-"), ("mul", "*"), ("truediv", "/")):
    setattr(Traced, f"__{_name}__", _binary(_sign, False))
    setattr(Traced, f"__r{_name}__", _binary(_sign, True))


def plain(function: Function) -> Function:
    """A function, and those of its file that it calls, as Python has them and not as compiled."""
    python_function: Any = getattr(function, "py_func", function)
    scope = dict(python_function.__globals__)
    for name in python_function.__code__.co_names:
        if scope.get(name) is fused:
            scope[name] = Traced.fused
        elif getattr(scope.get(name), "py_func", None) is not None:
            scope[name] = plain(scope[name])
    return FunctionType(
        python_function.__code__,
        scope,
        python_function.__name__,
        python_function.__defaults__,
        python_function.__closure__,
    )
