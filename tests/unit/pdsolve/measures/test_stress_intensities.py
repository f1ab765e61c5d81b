"""What `pdpost sif` sums over: which nodes, and how large the rings are."""

from __future__ import annotations

import numpy as np
import pytest
from prescribed_results import MODEL, plate, results_of

from pdsolve.measures.cracked_nodes import damage_without_pre_cracks_at
from pdsolve.measures.stress_intensities import CachedFrameFields, _choose_rings
from pdsolve.measures.tip_surroundings import TipPosition, UndisturbedRoom

REST = {**MODEL, "run": {"solver": "static", "time_step": 1.0}, "horizon": {"ratio": 3.0}}


def test_nodes_that_have_lost_more_than_six_tenths_of_their_bonds_do_not_count() -> None:
    """Of nodes with 28 bonds: 16 broken (0.57) and 17 (0.607)."""
    nodes, families = plate()
    inner = np.flatnonzero(nodes.family == 28)[[3, 20, 30]]
    broken = [
        (5, int(nodes.ids[row]), int(nodes.ids[other]))
        for row, count in zip(inner, (0, 16, 17), strict=True)
        for other in families.neighbour[families.start[row] : families.start[row + 1]][:count]
    ]
    results = results_of(nodes, families, 1e-6 * nodes.position, broken, REST)
    damage = damage_without_pre_cracks_at(results, 10)
    assert damage[inner] == pytest.approx([0.0, 16 / 28, 17 / 28])
    there = np.isfinite(CachedFrameFields(results)._sample_fields(10).gradient).all(axis=(1, 2))
    assert there[inner].tolist() == [True, True, False]


@pytest.mark.parametrize(("room", "least"), [(12e-3, 6e-3), (50e-3, 10e-3), (100e-3, 20e-3)])
def test_rings_begin_two_horizons_out_or_a_fifth_of_the_room(room: float, least: float) -> None:
    """A horizon is 3 mm; the middle one of three begins a quarter of the way on and ends at 0.8 of the room."""
    results = results_of(*plate(), np.zeros((169, 2)), [], REST)
    tip = TipPosition(np.array([6e-3, 6e-3]), np.array([1.0, 0.0]))
    inner, middle, outer = _choose_rings(results, 10, tip, UndisturbedRoom(room, "another tip"), None)
    span = 0.8 * room - least
    assert inner == pytest.approx((least, 0.8 * room))
    assert middle == pytest.approx((least + span / 4, 0.8 * room))
    assert outer == pytest.approx((least + span / 2, 0.95 * room))
