"""The fields of results."""

from __future__ import annotations

from typing import get_args

from pdmesh.model.document import Run
from pdmesh.model.output_fields import FIELDS, IN_SPACE, UNITS, Column
from pdmesh.model.output_fields import usual as usual_of


def test_every_column_is_of_one_field_and_the_usual_ones_are_stored() -> None:
    """In the order of the view `node_state`, which is that of the fields; those along z behind their field's."""
    usual, along, own = (get_args(some) for some in get_args(Column))
    assert [name for name in UNITS if name not in along] == [*usual, *own]
    assert usual == Run().fields
    assert usual_of(2) == usual
    assert usual_of(3) == (*usual, *along)
    in_space = sum(len(columns) for columns in IN_SPACE.values())
    assert sum(len(field.columns) for field in FIELDS.values()) + in_space == len(UNITS)


def test_the_letters_of_vectors() -> None:
    vectors = {name: field.symbol for name, field in FIELDS.items() if len(field.columns) == 2}
    assert vectors == {"displacement": "u", "velocity": "v", "acceleration": "a"}
