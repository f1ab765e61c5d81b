"""What a plate with a moving fine zone takes of memory for fine nodes that do not exist."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from plates import plate
from zoned_plates import rectangle

from pdmesh.model.document import Absorb, Lattice, Run
from pdmesh.model.node_grid import whole_lattice
from pdsolve.adaptivity.hybrid import irregular_bonds
from pdsolve.adaptivity.hybrid.coarse_cells import create_hybrid_plate
from pdsolve.adaptivity.hybrid.irregular_bonds import compute_irregular_bonds
from pdsolve.adaptivity.hybrid.node_constants import node_constants_at_places
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.zone.springs import create_fine_springs

PROGRAM = """
import sys
import numpy as np
from pathlib import Path
from pdmesh.model.document import Horizon, Lattice, Load, Material, Run, Settings
from pdmesh.model.node_grid import whole_lattice
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

def resident(name):
    return next(int(line.split()[1]) for line in Path("/proc/self/status").read_text().splitlines() if name in line)

def prepared(columns, rows):
    crack, ring = [[0, 60.5, 20, 60.5]], [[0, 0], [columns - 1, 0], [columns - 1, rows - 1], [0, rows - 1]]
    lattice = Lattice((0.0, 0.0), 1.0, columns, rows)
    grid = whole_lattice(lattice, cracks=np.array(crack, float), outline=(np.array(ring, float),))
    load = Load(box=(0.0, rows - 1.0, columns - 1.0, rows - 1.0), traction=(0.0, 1.0), rows=1, length=columns - 1.0)
    settings = Settings(
        material=Material(E=65e9, rho=2235.0, G0=1e9),
        horizon=Horizon(ratio=4.0),
        conditions=(load,),
        run=Run(adapt="hybrid", steps=1),
    )
    return prepare(Model(grid, settings, "plate"), Options(threads=1))

prepared(301, 201)  # what is loaded once
before = resident("VmRSS")
kept = prepared(1601, 1201)
print(1024 * (resident("VmHWM") - before) / (1601 * 1201))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the system counts memory differently")
def test_preparing_takes_few_bytes_for_each_fine_node_that_is_not() -> None:
    """Of 1.9 million nodes, all but some hundred in coarse cells; the coarse lattice has a quarter of them."""
    found = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert float(found.stdout) < 115  # bytes; measured: 97 to 102, and 163 to 174 with arrays of constants of all nodes


@pytest.mark.slow
def test_rows_that_are_alike_have_the_constants_of_each_node() -> None:
    """Masses, damping and bonds of all nodes, by one entry for most rows; the same if nodes are listed one by one."""
    lattice, crack = Lattice((0.0, 0.0), 1e-3, 201, 101), 1e-3 * np.array([[0, 50.5, 60.5, 50.5]])
    ring = 1e-3 * np.array([[0, 0], [200, 0], [200, 100], [0, 100]])
    absorb = Absorb(box=(0.18, 0.0, 0.2, 0.1))
    found = []
    for grid in (whole_lattice(lattice, cracks=crack, outline=(ring,)), rectangle(200, 100, 1e-3, crack / 1e-3)):
        model = plate(grid, 3.0, run=Run(adapt="hybrid", steps=1), conditions=(absorb,))
        hybrid = prepare(model, Options(threads=1)).system.operator.engine  # type: ignore[attr-defined]
        rows, place = hybrid.lattice.node_constants, hybrid.plate.fine_places
        own = node_constants_at_places(rows, rows.irregular_bond_row, place)
        springs = (
            np.where(own[:, None] >= 0, hybrid.lattice.irregular_bond_stiffness[own], 0.0)
            / hybrid.lattice.spring_table[0, 5]
        )
        found.append(
            [
                springs,
                *(
                    node_constants_at_places(rows, values, place)
                    for values in rows[1:]
                    if values is not rows.irregular_bond_row
                ),
            ]
        )
        assert len(rows.mass) < 0.4 * len(rows.constants_row)  # measured: 0.36, most of it of the layer that absorbs
        assert node_constants_at_places(rows, rows.mass, place) == pytest.approx(
            2235.0 * hybrid.plate.area_shares_of_grid_rows(np.arange(len(place))) * 1e-6, rel=1e-14
        )
    (springs, *one), (others, *other) = found
    np.testing.assert_allclose(springs, others, atol=1e-12)  # 6e-14: nodes listed one by one have bonds of their own
    assert all(map(np.array_equal, one, other))


def test_nodes_that_lie_in_the_same_way_to_edges_and_cracks_share_their_bonds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bonds, families and bounds are those that each node has by itself; a crack askew has nodes of its own."""
    lattice = Lattice((0.0, 0.0), 1e-3, 181, 101)
    cracks = 1e-3 * np.array([[0, 50.5, 60.5, 50.5], [90.5, 100, 90.5, 60.3], [110.2, 8.1, 170.3, 52.7]])
    ring = 1e-3 * np.array([[0, 0], [180, 0], [180, 100], [0, 100]])
    model = plate(whole_lattice(lattice, cracks=cracks, outline=(ring,)), 3.0, run=Run(adapt="hybrid", steps=1))
    board = create_hybrid_plate(model)
    springs = (create_fine_springs(model.materials[0], 3.0, board.spacing),)
    found = compute_irregular_bonds(board, springs)
    monkeypatch.setattr(
        irregular_bonds, "find_first_row_with_equal_bonds", lambda plate, rows, reach: np.arange(len(rows))
    )
    alone, which = compute_irregular_bonds(board, springs), found.bond_row_of_node
    assert len(found.stiffness) < 0.5 * len(alone.stiffness)  # measured: 0.42
    np.testing.assert_allclose(found.stiffness[which], alone.stiffness, rtol=1e-12, atol=0.0)  # measured: 1e-13
    np.testing.assert_allclose(found.stiffness_bound[which], alone.stiffness_bound, rtol=1e-12)
    assert np.array_equal(found.family_size[which], alone.family_size)
    for mine, theirs in ((found.peak_strain, alone.peak_strain), (found.limit_strain, alone.limit_strain)):
        np.testing.assert_allclose(
            mine[found.limit_row_of_bond_row[which]], theirs[alone.limit_row_of_bond_row], rtol=1e-12
        )
