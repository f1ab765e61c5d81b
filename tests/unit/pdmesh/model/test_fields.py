"""The fields of results."""

from __future__ import annotations

from typing import get_args

from pdmesh.model.document import Run
from pdmesh.model.fields import FIELDS, UNITS, Column


def test_every_column_is_of_one_field_and_the_usual_ones_are_stored() -> None:
    """In the order of the view `node_state`, which is that of the fields."""
    usual, own = (get_args(some) for some in get_args(Column))
    assert (*usual, *own) == tuple(UNITS)
    assert usual == Run().fields
    assert sum(len(field.columns) for field in FIELDS.values()) == len(UNITS)


def test_the_letters_of_vectors() -> None:
    vectors = {name: field.symbol for name, field in FIELDS.items() if len(field.columns) == 2}
    assert vectors == {"displacement": "u", "velocity": "v", "acceleration": "a"}
