"""Structs of numbers: in Python, in compiled code, and in the order in which checkpoints have them."""

from __future__ import annotations

import numpy as np
from numba import njit

from pdsolve.adaptivity.collocation import zone
from pdsolve.adaptivity.hybrid import arrays
from pdsolve.codegen.record import Record


class Tally(Record):
    """Two numbers of one type and one of another."""

    first: int
    second: int


class Share(Record):
    """Fields of both types."""

    place: int
    value: float


@njit
def _count(tally, shares):  # type: ignore[no-untyped-def]
    tally.second += 3
    share = shares[1]
    share.value = share.place / 4
    return tally.first


def test_compiled_code_changes_it_in_place() -> None:
    tally, shares = Tally.of([5, 6]), np.zeros(2, Share.fields())
    shares["place"] = 1, 2
    assert _count(tally, shares) == 5
    assert (tally.first, tally.second) == (5, 9)
    assert tally.values().tolist() == [5, 9]
    assert tally.values().dtype == np.int64
    assert shares[1].value == 0.5
    assert shares["value"].tolist() == [0.0, 0.5]


def test_values_that_are_not_given_are_zero() -> None:
    assert Tally.of([7]).values().tolist() == [7, 0]
    assert Tally.of().values().tolist() == [0, 0]


def test_checkpoints_have_the_order_that_they_had() -> None:
    """Files hold these numbers without names."""
    stored = (
        "active_fine_rows active_coarse_rows clipped_pieces border_nodes broken_bonds node_loads"
        " prescribed_components damaged_nodes cell_changes refined_damaged_nodes"
    )
    assert list(arrays.ZoneCounts.__annotations__)[: arrays.STORED] == stored.split()
    assert list(arrays.EnergyTotals.__annotations__) == [
        "work",
        "dissipated_energy",
        "refinement_energy",
        "clipped_strain",
        "largest_clipped_strain",
    ]
    assert list(zone.EnergyTotals.__annotations__) == [
        "dissipated_energy",
        "refinement_energy",
        "largest_double_green_strain",
        "damped_energy",
    ]
    assert list(zone.ZoneCounts.__annotations__) == ["broken_bonds", "refinement_due", "refinements"]


def test_no_field_is_hidden_by_an_attribute_of_numpy() -> None:
    for kind in (
        arrays.ZoneCounts,
        arrays.EnergyTotals,
        arrays.LoadOrPrescribedMotion,
        zone.ZoneCounts,
        zone.EnergyTotals,
    ):
        assert not set(kind.__annotations__) & set(dir(np.record)), kind
