"""Jumps of cycles, beside one cycle after the other."""

from __future__ import annotations

import numpy as np
import pytest

from pdmesh.model.document import Fatigue
from pdsolve.bonds.fatigue_life import Place, jump, wear

EPS = np.array([1e-3, 5e-4, 2e-3, 0.0])
GROWS = np.array([True, False, False, True])


def test_bonds_tire_along_the_line_of_their_phase() -> None:
    law = Fatigue(A=1e6, m=2.0, A1=1e3, m1=1.0, endurance=6e-4)
    assert wear(law, EPS, GROWS) == pytest.approx([1.0, 0.0, 2.0, 0.0])
    assert wear(Fatigue(A=1e6, m=2.0), EPS, GROWS) == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert wear(Fatigue(A1=1e3, m1=1.0), EPS, GROWS) == pytest.approx([1.0, 0.5, 2.0, 0.0])
    assert wear(Fatigue(A=1e6, m=2.0, threshold=1e-3), EPS, GROWS) == pytest.approx(0)


def test_a_jump_ends_where_the_first_bond_breaks() -> None:
    life, law = np.array([1.0, 0.01, 0.7, 0.5]), Fatigue(A1=1e-3, m1=1.0)
    cycles, at = jump(life, law, EPS, GROWS, Place(0, 0.0), 1e15)
    assert cycles == pytest.approx(0.01 / 5e-7)
    assert life == pytest.approx([0.98, 0.0, 0.66, 0.5])
    assert at == Place(0, 0.0)
    cycles, _ = jump(life, law, EPS, GROWS, at, 1000.0)
    assert cycles == 1000
    cycles, _ = jump(life, law, np.zeros(4), GROWS, at, np.inf)
    assert cycles == np.inf
    assert life[0] == pytest.approx(0.979)


def test_blocks_are_what_their_cycles_are() -> None:
    """Beside one cycle after the other, which ends within a cycle of the first break."""
    law = Fatigue(A1=2.0, m1=1.5, endurance=3e-4, blocks=((7.0, 1.0), (3.0, 0.25), (40.0, 0.5)))
    shares = np.concatenate([np.full(int(cycles), share) for cycles, share in law.blocks])
    for start in (0.9, 0.001, 0.0102):
        life, slow = np.full(4, start), np.full(4, start)
        cycles, at = jump(life, law, EPS, GROWS, Place(0, 0.0), 1e15)
        count = 0
        while (slow > 0).all():
            slow -= wear(law, shares[count % 50] * EPS, GROWS)
            count += 1
        assert count - 1 <= cycles <= count
        assert at.block == np.searchsorted([7, 10, 50], (count - 1) % 50, side="right")
        assert (life >= slow - 1e-12).all()
        assert life.min() == pytest.approx(0, abs=1e-12)


def test_blocks_end_with_the_cycles() -> None:
    law, life = Fatigue(A1=1.0, m1=1.0, blocks=((10.0, 1.0), (5.0, 0.5))), np.ones(4)
    cycles, at = jump(life, law, EPS, GROWS, Place(0, 0.0), 42.0)
    assert (cycles, at) == (42.0, Place(1, 2.0))
    assert life[2] == pytest.approx(1 - 2e-3 * (30 + 6))
