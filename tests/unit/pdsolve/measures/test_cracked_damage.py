"""The damage of cracked nodes follows from the share of bonds that a straight crack cuts."""

from __future__ import annotations

import json

import numpy as np
import pytest
from damaged_results import alone
from new_databases import create_writer
from scipy.spatial import cKDTree

from pdmesh.model.cracked_damage import cracked_damage, share_cut_by_crack
from pdmesh.model.document import Material
from pdsolve.measures.crack_faces import build_crack_surface, find_opened_face_neighbours
from pdsolve.measures.cracked_nodes import cracked_damage_of, first_cracked_step_of_nodes
from pdsolve.results import Breaks, FrameRecord, Nodes, Results

FACE = 10  # nodes along the edges of the cut


def cut_lattice(ratio: float, dimension: int, until: float = np.inf) -> Results:
    """A block or plate whose bonds across x = 0 break in step 3, those whose middle is below y = `until`."""
    along = np.arange(FACE) + 0.5
    axes = (along - FACE / 2, *(along,) * (dimension - 1))
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension)
    count, ones = len(position), np.ones(len(position))
    source, target = cKDTree(position).query_pairs(ratio * (1 + 1e-9), output_type="ndarray").T
    source, target = np.concatenate([source, target]), np.concatenate([target, source])
    family = np.bincount(source, minlength=count)
    nodes = Nodes(np.arange(1, count + 1), position, ones, ones, family, np.zeros(count, dtype=np.int64))
    crosses = (position[source, 0] * position[target, 0] < 0) & (
        (position[source, 1] + position[target, 1]) / 2 < until
    )
    pre_cracks = np.empty((0, 4 if dimension == 2 else 9))
    meta = {"time_step": 1.0, "model": json.dumps({"horizon": {"ratio": ratio}}), "dimension": dimension}
    writer = create_writer(None, nodes, alone, pre_cracks, meta)
    breaks = Breaks(np.full(crosses.sum(), 3), source[crosses] + 1, target[crosses] + 1)
    writer.write(FrameRecord(5, 5.0, None, breaks, [], [], {}))
    return Results(writer.connection, "memory")


@pytest.mark.parametrize(
    ("ratio", "dimension", "share", "damage"),
    [
        (2.0, 2, 4 / 12, 0.92 * 4 / 12),
        (2.0, 3, 10 / 32, 0.92 * 10 / 32),
        (3.0, 2, 11 / 28, 0.35),
        (3.0, 3, 47 / 122, 0.35),
        (4.0, 2, 20 / 48, 0.35),
    ],
)
def test_the_damage_is_less_than_what_a_crack_along_the_lattice_cuts(
    ratio: float, dimension: int, share: float, damage: float
) -> None:
    assert share_cut_by_crack(ratio, dimension) == pytest.approx(share)
    assert cracked_damage(ratio, None, dimension) == pytest.approx(damage)
    assert damage < share


def test_partial_cells_reach_half_a_spacing_further() -> None:
    constant = Material(E=1.0, rho=1.0, G0=1.0, micromodulus="constant")
    assert cracked_damage(2.0, constant) == 0.35 < share_cut_by_crack(2.5)


def test_a_run_has_the_damage_of_its_horizon_unless_another_is_given() -> None:
    results = cut_lattice(2.0, 3)
    assert cracked_damage_of(results) == cracked_damage(2.0, None, 3)
    assert cracked_damage_of(results, 0.5) == 0.5


@pytest.mark.parametrize("ratio", [2.0, 3.0])
@pytest.mark.parametrize(("until", "area"), [(np.inf, FACE**2), (FACE / 2, FACE**2 / 2)])
def test_a_planar_cut_in_space_has_its_area(ratio: float, until: float, area: float) -> None:
    """Exact for a cut through the block; of a cut half way through, the front is known to a spacing."""
    results = cut_lattice(ratio, 3, until)
    surface = build_crack_surface(results, 5, find_opened_face_neighbours(results, 5))
    assert surface.grown_area_at(np.array([2.0, 5.0])) == pytest.approx(
        [0, area], abs=0.01 if np.isinf(until) else FACE
    )


@pytest.mark.parametrize("ratio", [2.0, 3.0])
def test_a_straight_cut_in_the_plane_cracks_the_nodes_beside_it(ratio: float) -> None:
    results = cut_lattice(ratio, 2)
    beside = np.abs(results.nodes(5).position[:, 0]) < 1
    assert (first_cracked_step_of_nodes(results)[beside] == 3).all()
