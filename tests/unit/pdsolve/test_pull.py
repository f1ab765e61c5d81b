"""The polynomials that stand for a root and a division."""

from __future__ import annotations

import dataclasses
from decimal import Decimal, getcontext

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import broken, forces

from pdsolve.lattice.force_polynomials import NARROW, WIDE, coefficients
from pdsolve.options import Options
from pdsolve.run.prepare import prepare


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("reach", [NARROW, WIDE])
def test_they_are_as_exact_as_what_they_stand_for(reach: float, precision: str) -> None:
    """By Horner's rule in the run's precision, against fifty digits: to 1.5 units in the last place."""
    getcontext().prec = 50
    factors = coefficients(precision)[0 if reach == NARROW else 1]
    kind = np.dtype(precision).type
    e = np.linspace(-reach, reach, 4001).astype(kind)
    value = np.full_like(e, factors[-1])
    for factor in factors[-2::-1]:
        value = value * e + kind(factor)
    exact = np.array([float(1 / (1 + at + (1 + at).sqrt())) for at in map(Decimal, e.tolist())])
    off = np.abs(value - exact).max() / (0.5 * float(np.finfo(kind).eps))
    assert off <= 1.5  # measured 1.2, 1.3 in double, 1.1, 1.2 in single precision; a root and a division: 1.4


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_bond_pulls_both_ends_alike(precision: str) -> None:
    """To the bit, whichever polynomial it takes: that depends on the bond's own e, which both ends find alike."""
    pairs = dataclasses.replace(square_grid(2, 40), cracks=np.array([[-1, y, 1, y] for y in 1e-3 * np.arange(0.5, 39)]))
    no_fail = plate(pairs, 1.4, material=msgspec.structs.replace(GLASS, G0=1e12))
    problem = prepare(no_fail, Options(precision=precision, threads=1))
    assert problem.system.operator.name == "blocks"
    assert problem.system.initial_bond_counts.tolist() == [1] * 80
    random = np.random.default_rng(0)
    for size in np.geomspace(1e-9, 0.3e-3, 60):  # e from 1e-6 to 0.6
        problem.state.value[:] = size * random.standard_normal((80, 2))
        force = forces(problem)
        assert np.array_equal(force[::2], -force[1::2])
        assert force.any(axis=1).all()
    assert not len(broken(problem).step)
