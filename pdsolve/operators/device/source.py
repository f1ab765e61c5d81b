"""The OpenCL C of a run: what its law says, its precision, its bonds and its steps."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources

import numpy as np

from pdsolve.laws.law import Function
from pdsolve.operators.device.translation import DOUBLE, REAL, Translation
from pdsolve.operators.simd_lattice.pull import NARROW, WIDE, coefficients
from pdsolve.operators.simd_lattice.vectors import FAR


def text_of(name: str) -> str:
    """A file of OpenCL C beside this one."""
    return (resources.files("pdsolve.operators.device") / name).read_text(encoding="utf-8")


def pair_functions(functions: Mapping[str, Function], remembers: bool, one_sided: bool, file: str) -> str:
    """A pair law, and the file that sums its bonds; `remembers`: whether some bonds soften, `one_sided`: in tension
    alone. Raises ModelError."""
    law = Translation(functions)
    defined = {"RELEASED": law.add("released", (DOUBLE, DOUBLE, DOUBLE, REAL, REAL))}
    if remembers:
        defined |= {"SOFTENS": "", "SECANT": law.add("secant", (DOUBLE, DOUBLE, DOUBLE, DOUBLE))}
    if one_sided:
        defined["ONE_SIDED"] = ""
    lines = [f"#define {name} {value}" for name, value in defined.items()]
    return "\n".join([law.source, *lines, text_of(file)])


def body_functions(functions: Mapping[str, Function], numbers: Mapping[str, int | str], remembers: bool) -> str:
    """A pair law whose bonds break in double precision, constants, and what sums bonds in space; `remembers` as above.
    Raises ModelError."""
    law, file = Translation(functions), "space.cl"
    defined = {"RELEASED": law.add("released", (DOUBLE,) * 5), **numbers}
    if remembers:
        defined |= {"SOFTENS": "", "SECANT": law.add("secant", (DOUBLE,) * 4)}
    return "\n".join([law.source, *(f"#define {name} {value}" for name, value in defined.items()), text_of(file)])


def preamble(precision: str, dimension: int) -> str:
    """Types, constants and polynomials of a run; no product and sum is rounded once unless it is written so."""
    kind = np.dtype(precision).type
    real = "double" if kind is np.float64 else "float"
    lines = [
        "#pragma OPENCL EXTENSION cl_khr_fp64 : enable",
        "#pragma OPENCL FP_CONTRACT OFF",
        f"#define REAL {real}",
        f"#define DIM {dimension}",
        f"#define FAR {FAR}",
        f"#define NARROW {NARROW.hex()}",
        f"#define WIDE {WIDE.hex()}",
    ]
    for name, factors in zip(("narrow", "wide"), coefficients(precision), strict=True):
        exact = [f"(REAL){float(kind(factor)).hex()}" for factor in factors]
        value = exact[-1]
        for factor in exact[-2::-1]:
            value = f"fma({value}, e, {factor})"
        lines.append(f"inline REAL polynomial_{name}(REAL e) {{ return {value}; }}")
    return "\n".join(lines)
