"""The functions of a law of bonds as OpenCL C, written from their Python: a law says what it is once.

A function computes with numbers alone: it assigns, adds, multiplies, divides, compares, calls the law's other
functions, and returns. Numbers are typed as numba types them: of two precisions the wider, a literal is of double
precision. What it cannot write raises ModelError, and such a law runs on the processor.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pdsolve.codegen.fused import fused
from pdsolve.laws.law import Function
from pdsolve.model import ModelError

DOUBLE, REAL = "double", "REAL"
SIGNS: dict[Any, str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.USub: "-",
    ast.Not: "!",
    ast.And: "&&",
    ast.Or: "||",
}
SIGNS |= {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
CHOSEN = {"true": True, "(!false)": True, "false": False, "(!true)": False}  # tests of what the law has chosen
SAME_BITS: dict[Any, str] = {np.sqrt: "sqrt", np.maximum: "fmax", np.minimum: "fmin", max: "fmax", fused: "fma"}
# but no exponential: those of libraries differ


class Translation:
    """Functions of a law in OpenCL C, each once for the types that it is called with."""

    def __init__(self, functions: Mapping[str, Function], **choices: bool) -> None:
        """`functions` are those of the law by the names that they call each other by, `choices` its attributes."""
        self._functions, self.choices = functions, choices
        self._written: dict[tuple[str, tuple[str, ...]], tuple[str, str]] = {}  # name and type of what it returns
        self._texts: list[str] = []

    def add(self, name: str, types: tuple[str, ...]) -> str:
        """Write a function of these types of its parameters, without the law; returns its name in C."""
        return self.called(self._functions[name], types)[0]

    @property
    def source(self) -> str:
        """All that is written."""
        return "\n".join(self._texts)

    def called(self, function: Function, types: tuple[str, ...]) -> tuple[str, str]:
        """The name in C of a function called with these types, and what it returns."""
        plain = getattr(function, "py_func", function)
        key = f"{plain.__module__}.{plain.__qualname__}".replace(".", "_"), types
        if key not in self._written:
            name = f"{key[0]}_{len(self._written)}"
            body = _Body(self, plain, types)
            lines, kind = body.lines(), body.kind
            parameters = ", ".join(f"{c_type} {name}" for name, c_type in zip(body.parameters, types, strict=True))
            self._texts.append(f"inline {kind} {name}({parameters}) {{\n" + "\n".join(lines) + "\n}")
            self._written[key] = name, kind
        return self._written[key]

    def named(self, name: str, function: Function) -> Any:
        """What a name means in a function: a function of the law, or a global of the function's file."""
        if name in self._functions:
            return self._functions[name]
        return {"max": max, **inspect.getclosurevars(function).globals}[name]


class _Body:
    """The statements of one function."""

    def __init__(self, translation: Translation, function: Function, types: tuple[str, ...]) -> None:
        self._whole, self._function = translation, function
        (self._tree,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
        assert isinstance(self._tree, ast.FunctionDef)
        argument_names = [argument.arg for argument in self._tree.args.args]
        self.parameters = argument_names[-len(types) :]  # the law comes first, where it comes at all
        self._types = dict(zip(self.parameters, types, strict=True))
        self._assigned: list[str] = []
        self.kind = REAL

    def lines(self) -> list[str]:
        """The statements in C, with declarations; sets what is returned."""
        assert isinstance(self._tree, ast.FunctionDef)
        body: list[str] = []
        for statement in self._tree.body:
            body += self._statement(statement)
            if body and body[-1].startswith("  return"):  # what follows a choice of the law that returns is no part
                break
        declared = [f"  {self._types[name]} {name};" for name in self._assigned]
        return declared + body

    def _statement(self, node: ast.stmt) -> list[str]:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return []
        if isinstance(node, ast.Return) and node.value is not None:
            text, kind = self._value(node.value)
            self.kind = _widest((self.kind, kind))
            return [f"  return {text};"]
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            text, kind = self._value(ast.BinOp(node.target, node.op, node.value))
            return self._assign(node.target.id, text, kind)
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Name):
            return self._assign(target.id, *self._value(node.value))
        if isinstance(node, ast.Assign) and isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = zip(target.elts, node.value.elts, strict=True)  # of which no value is another's target
            return [line for name, value in pairs for line in self._statement(ast.Assign([name], value))]
        if isinstance(node, ast.If) and not node.orelse:
            test = self._value(node.test)[0]
            inner = [line for child in node.body if CHOSEN.get(test, True) for line in self._statement(child)]
            return inner if test in CHOSEN else [f"  if ({test}) {{", *inner, "  }"]
        raise self._unknown(node)

    def _assign(self, name: str, text: str, kind: str) -> list[str]:
        if name not in self._types:
            self._types[name] = kind
            self._assigned.append(name)
        elif _widest((self._types[name], kind)) != self._types[name]:
            raise self._unknown(name)
        return [f"  {name} = {text};"]

    def _value(self, node: ast.expr) -> tuple[str, str]:
        """An expression in C and its type."""
        if isinstance(node, ast.Constant):
            return _number(node.value), DOUBLE
        if isinstance(node, ast.Name):
            if node.id in self._types:
                return node.id, self._types[node.id]
            return _number(self._whole.named(node.id, self._function)), DOUBLE
        if isinstance(node, ast.Attribute) and node.attr in self._whole.choices:
            return str(self._whole.choices[node.attr]).lower(), DOUBLE
        if isinstance(node, ast.Call):
            return self._call(node)
        operation = node.ops[0] if isinstance(node, ast.Compare) and len(node.ops) == 1 else getattr(node, "op", None)
        sign = SIGNS.get(type(operation))
        if sign is None and not isinstance(node, ast.IfExp):
            raise self._unknown(node)
        values = [self._value(child) for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
        texts, kinds = [text for text, _ in values], [kind for _, kind in values]
        if sign is None:
            return "({} ? {} : {})".format(*texts), _widest(kinds[1:])
        return f"({sign}{texts[0]})" if len(texts) == 1 else f"({f' {sign} '.join(texts)})", _widest(kinds)

    def _call(self, node: ast.Call) -> tuple[str, str]:
        nothing = ("law", None)  # what is no number
        numbers = (one for one in node.args if getattr(one, "id", getattr(one, "value", 0)) not in nothing)
        values = [self._value(number) for number in numbers]
        kinds = tuple(kind for _, kind in values)
        function: Any
        if isinstance(node.func, ast.Attribute):
            function = getattr(np, node.func.attr, None)
        else:
            assert isinstance(node.func, ast.Name)
            function = self._whole.named(node.func.id, self._function)
        if function in SAME_BITS:
            kind = _widest(kinds)
            return f"{SAME_BITS[function]}({', '.join(f'({kind}){text}' for text, _ in values)})", kind
        if isinstance(node.func, ast.Attribute):
            raise self._unknown(node.func.attr)
        called, kind = self._whole.called(function, kinds)
        return f"{called}({', '.join(text for text, _ in values)})", kind

    def _unknown(self, node: ast.AST | str) -> ModelError:
        what = node if isinstance(node, str) else type(node).__name__
        return ModelError(
            f"device: the law's {self._function.__name__} has {what}; use one that a device computes to the same"
            " bits (--device cpu)"
        )


def _widest(kinds: Sequence[str]) -> str:
    return DOUBLE if DOUBLE in kinds else REAL


def _number(value: Any) -> str:
    return f"{float(value).hex()}" if np.isfinite(value) else "INFINITY"
