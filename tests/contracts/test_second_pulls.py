"""Bonds that pull once more in the step after they broke: how much, and that a checkpoint in between has them."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from system_checks import broken, kept

import pdmesh
from benchmarks.tear import GLASS, plate
from pdmesh.model.document import Material, Run
from pdsolve.laws import law_of
from pdsolve.laws.calls import added_force, bind, second_force, total_dissipated_energy
from pdsolve.laws.pair import no_bonds
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Breaks
from pdsolve.run.prepare import prepare
from pdsolve.run.subdomain import restore_state
from pdsolve.run.system import PreparedRun

ORDINARY = Material(E=65e9, rho=2235.0, G0=204.0, nu=0.2, model="ordinary")
BILINEAR = Material(E=65e9, rho=2235.0, G0=204.0, law="bilinear", kr=2.0)
COHESIVE = Material(E=65e9, rho=2235.0, G0=204.0, law="cohesive", shape="exponential", f_t=60e6)


@pytest.mark.parametrize("slowing", [0.0, 0.1, 0.3, 0.49])
@pytest.mark.parametrize("material", [GLASS, BILINEAR, COHESIVE], ids=["brittle", "bilinear", "cohesive"])
def test_both_pulls_take_the_energy_of_a_bond(material: Material, slowing: float) -> None:
    """A bond without stretch is torn in one step; in the two next ones it grows less, in proportion to its pulls."""
    pair = law_of(plate(material, None))
    bind(pair)
    columns, peak, limit = no_bonds(pair), 1e-3, 1e-3 if material is GLASS else 3e-3
    growth = 2 * limit
    next_growth = growth * (1 - slowing)
    first = added_force(columns, growth, 0.0, 0.0, peak, limit)
    second = second_force(columns, growth + next_growth, growth, 0.0, 0.0, peak, limit)
    last_growth = next_growth - (growth - next_growth) * second / first
    taken = first * (growth + next_growth) / 2 + second * (next_growth + last_growth) / 2
    assert taken == pytest.approx(total_dissipated_energy(columns, 0.5, peak, limit), rel=1e-12)


def test_a_bond_that_closes_or_stops_pulls_no_more() -> None:
    pair = law_of(plate(GLASS, None))
    bind(pair)
    columns = no_bonds(pair)
    assert second_force(columns, 2e-3, 2e-3, 0.0, 0.0, 1e-3, 1e-3) == 0
    assert second_force(columns, 1e-3, 2e-3, 0.0, 0.0, 1e-3, 1e-3) == 0
    first = added_force(columns, 2e-3, 0.0, 0.0, 1e-3, 1e-3)
    assert second_force(columns, 2.1e-3, 2e-3, 0.0, 0.0, 1e-3, 1e-3) == pytest.approx(first)  # as much at most
    thesis = no_bonds(law_of(plate(GLASS, None), matches_work=False))
    assert second_force(thesis, 4e-3, 2e-3, 0.0, 0.0, 1e-3, 1e-3) == 0


def leaving(material: Material, dimension: int, options: Options) -> PreparedRun:
    """A plate or a block, half of which leaves at 40 m/s."""
    if dimension == 2:
        model = plate(material, None)
    else:
        built = pdmesh.build(pdmesh.Body(pdmesh.Box((0, 0, 0), (0.016, 0.009, 0.009)), 1e-3, material))
        model = Model(built.grid, msgspec.structs.replace(built.settings, run=Run()))
    problem = prepare(model, options)
    x = model.grid.position[:, 0]
    problem.state.rate[x < (x.min() + x.max()) / 2, 0] = -40.0
    return problem


@pytest.mark.parametrize("kernel", ["listed", "blocks"])
@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("material", [GLASS, BILINEAR, ORDINARY], ids=["brittle", "bilinear", "ordinary"])
def test_a_checkpoint_between_both_pulls_has_what_is_left(material: Material, dimension: int, kernel: str) -> None:
    """Bonds break in step 1 and pull again in step 2; who goes on from between has the bits of who did not stop."""
    options = Options(kernel=kernel, threads=1)
    straight, before, after = (leaving(material, dimension, options) for _ in range(3))
    straight.advance(1, 5)
    before.advance(1, 2)
    past, ids, stored = broken(before), before.system.model.grid.ids, kept(before)
    assert any(name.startswith(("pending", "torn")) for name in stored)
    restore_state(*after, 1, stored, Breaks(past.step, ids[past.source], ids[past.target]))
    again = kept(after)
    assert again.keys() == stored.keys()
    assert all(np.array_equal(again[name], stored[name]) for name in stored if "worst" not in name)
    after.advance(2, 5)
    assert all(map(np.array_equal, after.state, straight.state))
    assert all(map(np.array_equal, broken(after), broken(straight)))
