"""The OpenCL C of a run: what its law says, its precision, its bonds and its steps."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np

from pdsolve.codegen.block_slots import FAR
from pdsolve.codegen.pull import NARROW, WIDE, coefficients, stretch_coefficients
from pdsolve.laws.calls import GROWTH
from pdsolve.laws.law import Function
from pdsolve.operators.device.translation import DOUBLE, Translation


def text_of(name: str) -> str:
    """A file of OpenCL C beside this one."""
    return (resources.files("pdsolve.operators.device") / name).read_text(encoding="utf-8")


def pair_functions(
    functions: Mapping[str, Function], remembers: bool, one_sided: bool, matches_work: bool, file: str
) -> str:
    """A pair law, and the file that sums its bonds; `remembers`: whether some bonds soften, `one_sided`: in tension
    alone, `matches_work`: whether bonds that soften or break add a pull. Raises ModelError."""
    law = Translation(functions)
    defined = {"DISSIPATED_AT_BREAK": law.add("dissipated_at_break", (DOUBLE,) * 5)}
    if matches_work:
        defined |= {
            "TOTAL_DISSIPATED": law.add("total_dissipated_energy", (DOUBLE,) * 3),
            "MATCHING_FORCE": law.add("matching_force", (DOUBLE,) * 5),
        }
    if remembers:
        defined |= {"SOFTENS": "", "SECANT": law.add("secant", (DOUBLE, DOUBLE, DOUBLE, DOUBLE))}
    if one_sided:
        defined["ONE_SIDED"] = ""
    lines = [f"#define {name} {value}" for name, value in defined.items()]
    return "\n".join([law.source, *lines, text_of("second_force.cl"), text_of(file)])


def body_functions(functions: Mapping[str, Function], numbers: Mapping[str, int | str], remembers: bool) -> str:
    """A pair law whose bonds break in double precision, constants, and what sums bonds in space; `remembers` as above.
    Raises ModelError."""
    law, file = Translation(functions), "space.cl"
    ruptures = {
        "DISSIPATED_AT_BREAK": ("dissipated_at_break", 5),
        "TOTAL_DISSIPATED": ("total_dissipated_energy", 3),
        "MATCHING_FORCE": ("matching_force", 5),
    }
    defined = {name: law.add(function, (DOUBLE,) * count) for name, (function, count) in ruptures.items()}
    defined |= {name: str(value) for name, value in numbers.items()}
    if remembers:
        defined |= {"SOFTENS": "", "SECANT": law.add("secant", (DOUBLE,) * 4)}
    lines = [f"#define {name} {value}" for name, value in defined.items()]
    return "\n".join([law.source, *lines, text_of("second_force.cl"), text_of(file)])


def together(kind: str, precision: np.dtype[Any]) -> int:
    """How many nodes a work item of a kind of device sums: a processor in vectors of 32 bytes, a GPU one a lane.

    PoCL 3.0 does not compile vectors of 64 bytes where the processor has registers for them.
    """
    return 32 // precision.itemsize if kind == "CPU" else 1


def vectors(nodes: int) -> list[str]:
    """Types and functions of vectors with a number for each of the nodes that a work item sums."""

    def each(number: str, joined: str) -> str:
        return joined.join(number.format(k) for k in range(nodes))

    return [
        f"#define TOGETHER {nodes}",
        "#define JOINED(a, b) a##b",
        f"#define WIDENED(a) JOINED(a, {nodes})",
        "#define REALS WIDENED(REAL)",
        "#define INTEGERS WIDENED(INTEGER)",
        "#define BITS WIDENED(uint)",
        "#define LOAD(from) WIDENED(vload)(0, from)",
        f"#define GATHER(from, at) (REALS)({each('(from)[(at)[{}]]', ', ')})",
        f"#define ANY_OF(a) ({each('(a).s{}', ' | ')})",
        f"#define ALL_OF(a) ({each('(a).s{}', ' & ')})",
    ]


def preamble(precision: str, dimension: int, nodes: int = 1) -> str:
    """Types, constants and polynomials of numbers or vectors; no product and sum is rounded once unless written so.

    `nodes` are those that a work item sums.
    """
    kind = np.dtype(precision).type
    real = "double" if kind is np.float64 else "float"
    lines = [
        "#pragma OPENCL EXTENSION cl_khr_fp64 : enable",
        "#pragma OPENCL FP_CONTRACT OFF",
        f"#define REAL {real}",
        f"#define DIM {dimension}",
        f"#define INTEGER {'long' if real == 'double' else 'int'}",  # as wide
        f"#define TO_INTEGER convert_{'long' if real == 'double' else 'int'}",
        f"#define FAR {FAR}",
        f"#define NARROW {NARROW.hex()}",
        f"#define WIDE {WIDE.hex()}",
        f"#define GROWTH {GROWTH.hex()}",
    ]
    if nodes > 1:
        lines += vectors(nodes)
    polynomials = *coefficients(precision), stretch_coefficients(precision)
    for name, factors in zip(("NARROW", "WIDE", "STRETCH"), polynomials, strict=True):
        exact = [f"(KIND)({float(kind(factor)).hex()})" for factor in factors]
        value = exact[-1]
        for factor in exact[-2::-1]:
            value = f"fma({value}, e, {factor})"
        lines.append(f"#define POLYNOMIAL_{name}(KIND, e) {value}")
    return "\n".join(lines)
