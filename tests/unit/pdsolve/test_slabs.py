"""Slabs of listed nodes, of about as many bonds each; and operators that sum the bonds of some nodes alone."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, two_cubes

from pdmesh.model.document import Lattice
from pdmesh.model.node_grid import Grid, whole_lattice
from pdsolve.lattice.operator import TileLattice
from pdsolve.operators.bond_list import BondList
from pdsolve.options import Options
from pdsolve.ranks.slabs import costs_of, cuts_of, slabs_of
from pdsolve.run.prepare import prepare
from pdsolve.schemes import SCHEMES

SPACE = msgspec.structs.replace(GLASS, plane="space")


@pytest.mark.slow
def test_slabs_of_two_spacings_have_as_many_bonds() -> None:
    """The most bonds of a slab over the mean, where slabs have as many rows, and as they are cut."""
    model = plate(two_cubes(16), material=SPACE)
    bonds = np.diff(SCHEMES["conservative"].fill(model).whole().bonds.start)
    for ranks, even, cut in ((5, 1.0759, 1.016), (16, 1.2024, 1.0537)):  # measured
        rows = [64 * (-(-len(bonds) // 64) * rank // ranks) for rank in range(ranks)]
        found = [slab.first for slab in slabs_of(model, ranks)]
        for firsts, known in ((rows, even), (found, cut)):
            most = np.add.reduceat(bonds, firsts).max() * ranks / bonds.sum()
            assert most == pytest.approx(known, abs=1e-3), (ranks, firsts)


def test_every_rank_has_a_unit_and_a_lattice_is_cut_evenly() -> None:
    assert cuts_of(np.array([100.0, 1.0, 1.0, 1.0]), 3) == [0, 1, 2, 4]
    assert cuts_of(np.array([1.0, 1.0, 1.0, 100.0]), 4) == [0, 1, 2, 3, 4]
    model = plate(whole_lattice(Lattice((0.0, 0.0), 1e-3, 40, 21), cracks=np.empty((0, 4))))
    assert costs_of(model, 64).tolist() == [64.0] * 13 + [8.0]


CUBE = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 16, 8, 20), cracks=np.empty((0, 9)))
KINDS: dict[str, tuple[Grid, type]] = {"listed": (two_cubes(5), BondList), "blocks": (CUBE, TileLattice)}


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", KINDS)
def test_the_bonds_of_some_nodes_are_summed_alone(name: str) -> None:
    """To the same bits as those of all; others break no bond and have no force."""
    grid, kind = KINDS[name]
    whole, part = (prepare(plate(grid, material=SPACE), Options(threads=1, kernel=name)) for _ in range(2))
    own = slice(128, 192)
    operator = part.system.operator
    assert isinstance(operator, kind)
    assert isinstance(operator, BondList | TileLattice)
    operator.only(own.start, own.stop)
    u = np.random.default_rng(1).uniform(-1e-6, 1e-6, whole.state.value.shape)
    found = []
    for one in (whole, part):
        one.state.value[:] = u
        out = np.zeros_like(u)
        one.system.operator.accumulate_force(one.state, out, 1, 1e-8)
        broken = one.system.operator.broken()
        mine = (broken.source >= own.start) & (broken.source < own.stop)
        energies = one.system.operator.energies(one.state)
        found.append([out[own], broken.target[mine], one.state.dissipated[own], *(values[own] for values in energies)])
        some = len(broken.source) == mine.sum(), bool(out[own.stop + 64 :].any())
        assert some == ((False, True) if one is whole else (True, False))
    assert len(found[0][1]) > 50
    for known, values in zip(*found, strict=True):
        assert values.tobytes() == known.tobytes()
