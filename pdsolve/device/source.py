"""The OpenCL C of a run: what its law says, its precision, its bonds and its steps."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.device.tracing import Code, Functions
from pdsolve.lattice.force_polynomials import NARROW, WIDE, coefficients, stretch_coefficients
from pdsolve.lattice.layout import FAR
from pdsolve.laws.calls import added_force, broken_energy, secant, second_force
from pdsolve.laws.law import Function, Law
from pdsolve.laws.pair import no_bonds

KINDS = {"float64": "double", "float32": "float", "int64": "long", "int32": "int"}  # in OpenCL C
KINDS |= {"uint32": "uint", "uint16": "ushort", "uint8": "uchar"}


def text_of(name: str) -> str:
    """A file of OpenCL C beside this one."""
    return (resources.files("pdsolve.device") / name).read_text(encoding="utf-8")


def pair_functions(law: Law, remembers: bool, **numbers: Any) -> str:
    """A pair law, constants by their names, and the sums of its bonds; `remembers`: whether bonds soften.

    Raises ModelError.
    """
    assert law.pair is not None
    columns = no_bonds(law)
    written, curve = Functions(columns), []
    functions: list[tuple[Function, int]] = [(added_force, 5), (second_force, 6), (broken_energy, 5)]
    if law.pair.is_curved:
        numbers["CURVED"] = ""
        lanes = Code("REALS")
        share = lanes.call("secant", columns, *lanes.named("p{}", 4))
        parameters = ", ".join(f"REALS p{k}" for k in range(4))
        curve = [f"inline REALS secant_of_lanes({parameters}) {{", *lanes.lines, f"return {lanes.text(share)};", "}"]
    if remembers:
        functions.append((secant, 4))
        numbers["SOFTENS"] = ""
    named = {each.__name__.upper(): written.write(each, columns, *(0.0,) * count) for each, count in functions}
    lines = [f"#define {name} {value}" for name, value in {**named, **numbers}.items()]
    return "\n".join([*written.texts, *curve, *lines, text_of("tiles.cl")])


def declare(name: str, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Macros of the parameters and arguments that arrays on the device are."""
    parameters = ", ".join(f"__global {KINDS[array.dtype.name]} *{each}" for each, array in arrays.items())
    return f"#define {name}_PARAMETERS {parameters}\n#define {name}_ARGUMENTS {', '.join(arrays)}"


def together(kind: str, precision: np.dtype[Any]) -> int:
    """How many nodes a work item of a kind of device sums: a processor in vectors of 32 bytes, a GPU one a lane.

    PoCL 3.0 does not compile vectors of 64 bytes where the processor has registers for them.
    """
    return 32 // precision.itemsize if kind == "CPU" else 1


def vectors(real: str, integer: str, nodes: int) -> dict[str, str]:
    """Types and functions of vectors with a number for each of the nodes that a work item sums, of one node numbers."""
    wide, each = (f"{nodes}", "(a).s{}") if nodes > 1 else ("", "(a)")

    def join(number: str, joint: str) -> str:
        return f"({joint.join(number.format(k) for k in range(nodes))})"

    return {
        "REALS": real + wide,
        "INTEGERS": integer + wide,
        "BITS": "uint" + wide,
        "LOAD(from)": f"vload{wide}(0, from)" if wide else "(*(from))",
        "STORE(a, to)": f"vstore{wide}(a, 0, to)" if wide else "*(to) = a",
        "GATHER(from, at)": f"(REALS){join('(from)[(at)[{}]]', ', ')}",
        "ANY(a)": join(each, " | "),
        "AS_WIDE(a)": f"convert_{integer}{wide}(a)",
        "ALL_OF(a)": join(each, " & "),
    }


def preamble(precision: str, dimension: int, nodes: int = 1) -> str:
    """Types, constants and polynomials of numbers or vectors; no product and sum is rounded once unless written so.

    `nodes` are those that a work item sums.
    """
    kind = np.dtype(precision).type
    real = "double" if kind is np.float64 else "float"
    integer = "long" if real == "double" else "int"  # as wide
    defined = {"REAL": real, "DIM": dimension, "FAR": FAR, "NARROW": NARROW.hex(), "WIDE": WIDE.hex()}
    defined |= {"TOGETHER": nodes, **vectors(real, integer, nodes)}
    lines = ["#pragma OPENCL EXTENSION cl_khr_fp64 : enable", "#pragma OPENCL FP_CONTRACT OFF"]
    before = ", ".join(f"__global const REAL *{name}" for name in ("before", "u", "rate"))
    defined |= {"STEP_PARAMETERS": f"{before}, double dt, int m, int step"}
    defined |= {"STEP_ARGUMENTS": "before, u, rate, dt, m, step"}
    lines += [f"#define {name} {value}" for name, value in defined.items()]
    polynomials = *coefficients(precision), stretch_coefficients(precision)
    for name, factors in zip(("NARROW", "WIDE", "STRETCH"), polynomials, strict=True):
        exact = [f"(KIND)({float(kind(factor)).hex()})" for factor in factors]
        value = exact[-1]
        for factor in exact[-2::-1]:
            value = f"fma({value}, e, {factor})"
        lines.append(f"#define POLYNOMIAL_{name}(KIND, e) {value}")
    return "\n".join(lines)
