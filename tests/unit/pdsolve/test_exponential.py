"""The exponential in sums and products: what it misses, and the same bits however it is computed."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numba
import numpy as np
import pytest
from devices import needs_opencl

from pdsolve.device.runtime import Session
from pdsolve.device.source import preamble
from pdsolve.device.tracing import Functions
from pdsolve.numerics.exponential import exponential

X = np.linspace(-8.0, 0.0, 2049)


def test_against_decimal_numbers() -> None:
    with localcontext() as context:
        context.prec = 40
        expected = [Decimal(x).exp() for x in X.tolist()]
        missed = [abs(Decimal(own) / one - 1) for own, one in zip(exponential(X).tolist(), expected, strict=True)]
    assert max(missed) < 5e-15  # measured 4.0e-15
    assert exponential(0.0) == 1.0


@numba.njit
def compiled(x):  # type: ignore[no-untyped-def]
    """Of each number."""
    return np.array([exponential(each) for each in x])


def test_compiled_code_has_the_same_bits() -> None:
    assert np.array_equal(compiled(X), exponential(X))


@pytest.mark.slow
@needs_opencl
def test_a_device_has_the_same_bits() -> None:
    session, written = Session("opencl"), Functions()
    name = written.write(exponential, 0.0)
    kernel = f"__kernel void each(__global double *x) {{ x[get_global_id(0)] = {name}(x[get_global_id(0)]); }}"
    program, x = session.build("\n".join([preamble("float64", 2), *written.texts, kernel])), session.put(X)
    session.launch(program.each, (len(X), 1), [x])
    found = np.empty_like(X)
    session.read(x, found)
    assert np.array_equal(found, exponential(X))
