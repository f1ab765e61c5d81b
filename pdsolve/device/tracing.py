"""Functions of a law on lanes as OpenCL C: they are run on expressions, and what they compute is written down.

Such a function assigns, adds, subtracts, multiplies and divides numbers of a bond or a node, of the run's precision,
and may ask what the law's constants are. Each result is rounded, as that of lanes is (see
`pdsolve.codegen.lanes`).
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from pdsolve.laws.law import Function
from pdsolve.model import ModelError


class Code:
    """Statements in OpenCL C, one for each result."""

    def __init__(self) -> None:
        self.lines: list[str] = []  # of the last call

    def named(self, pattern: str, count: int) -> tuple[Traced, ...]:
        """So many numbers, whose names in C are a pattern with their number in it."""
        return tuple(Traced(self, pattern.format(k)) for k in range(count))

    def write(self, expression: str) -> Traced:
        """The number that an expression is."""
        name = f"t{len(self.lines)}"
        self.lines.append(f"REAL {name} = {expression};")
        return Traced(self, name)

    def call(self, function: Function, *values: Any) -> tuple[Any, ...]:
        """What a function returns, given traced numbers and constants. Raises ModelError for what it cannot write."""
        self.lines = []
        try:
            outputs: tuple[Any, ...] = plain(function)(*values)
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
        if getattr(scope.get(name), "py_func", None) is not None:
            scope[name] = plain(scope[name])
    return FunctionType(
        python_function.__code__,
        scope,
        python_function.__name__,
        python_function.__defaults__,
        python_function.__closure__,
    )
