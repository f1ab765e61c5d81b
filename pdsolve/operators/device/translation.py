"""The functions of a law of bonds as OpenCL C, written from their Python: a law says what it is once.

A function computes with numbers alone: it assigns, adds, multiplies, divides, compares, calls the law's other
functions, and returns. Numbers are typed as numba types them: of two precisions the wider, a literal is of double
precision. What it cannot write raises ModelError, and such a law runs on the processor.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np

from pdsolve.codegen.fused import fused
from pdsolve.laws.law import Function
from pdsolve.model import ModelError

DOUBLE, REAL = "double", "REAL"
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
TESTS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
SAME_BITS = {np.sqrt: "sqrt", np.maximum: "fmax", np.minimum: "fmin"}  # exponentials of libraries differ


class Translation:
    """Functions of a law in OpenCL C, each once for the types that it is called with."""

    def __init__(self, functions: Mapping[str, Function]) -> None:
        """`functions` are those of the law by the names that they call each other by."""
        self._functions = functions
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
        return inspect.getclosurevars(function).globals[name]


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
        body = [line for statement in self._tree.body for line in self._statement(statement)]
        declared = [f"  {self._types[name]} {name};" for name in self._assigned]
        return declared + body

    def _statement(self, node: ast.stmt) -> list[str]:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return []
        if isinstance(node, ast.Return) and node.value is not None:
            text, kind = self._value(node.value)
            self.kind = _wider(self.kind, kind)
            return [f"  return {text};"]
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            text, kind = self._value(ast.BinOp(node.target, node.op, node.value))
            return self._assign(node.target.id, text, kind)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            return self._assign(node.targets[0].id, *self._value(node.value))
        if isinstance(node, ast.If) and not node.orelse:
            inner = [line for child in node.body for line in self._statement(child)]
            return [f"  if ({self._value(node.test)[0]}) {{", *inner, "  }"]
        raise self._unknown(node)

    def _assign(self, name: str, text: str, kind: str) -> list[str]:
        if name not in self._types:
            self._types[name] = kind
            self._assigned.append(name)
        elif _wider(self._types[name], kind) != self._types[name]:
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
        if isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
            (left_text, one), (right_text, right_kind) = self._value(node.left), self._value(node.right)
            return f"({left_text} {SIGNS[type(node.op)]} {right_text})", _wider(one, right_kind)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            text, kind = self._value(node.operand)
            return f"(-{text})", kind
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in TESTS:
            left_text, right_text = (self._value(one)[0] for one in (node.left, node.comparators[0]))
            return f"({left_text} {TESTS[type(node.ops[0])]} {right_text})", DOUBLE
        if isinstance(node, ast.BoolOp):
            sign = " && " if isinstance(node.op, ast.And) else " || "
            return f"({sign.join(self._value(one)[0] for one in node.values)})", DOUBLE
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self._unknown(node)

    def _call(self, node: ast.Call) -> tuple[str, str]:
        of_law = [argument for argument in node.args if not (isinstance(argument, ast.Name) and argument.id == "law")]
        values = [
            self._value(argument)
            for argument in of_law
            if not (isinstance(argument, ast.Constant) and argument.value is None)
        ]
        text, kinds = ", ".join(text for text, _ in values), tuple(kind for _, kind in values)
        if isinstance(node.func, ast.Attribute):
            name = SAME_BITS.get(getattr(np, node.func.attr, None))  # type: ignore[arg-type]
            if name is None:
                raise self._unknown(node.func.attr)
            kind = DOUBLE if DOUBLE in kinds else REAL
            return f"{name}({', '.join(f'({kind}){argument}' for argument, _ in values)})", kind
        assert isinstance(node.func, ast.Name)
        function = self._whole.named(node.func.id, self._function)
        if function is fused:
            kind = DOUBLE if DOUBLE in kinds else REAL
            return f"fma({', '.join(f'({kind}){argument}' for argument, _ in values)})", kind
        called, kind = self._whole.called(function, kinds)
        return f"{called}({text})", kind

    def _unknown(self, node: ast.AST | str) -> ModelError:
        what = node if isinstance(node, str) else type(node).__name__
        return ModelError(
            f"device: the law's {self._function.__name__} has {what}; use one that a device computes to the same"
            " bits (--device cpu)"
        )


def _wider(first: str, second: str) -> str:
    return DOUBLE if DOUBLE in (first, second) else REAL


def _number(value: Any) -> str:
    return f"{float(value).hex()}" if np.isfinite(value) else "INFINITY"
