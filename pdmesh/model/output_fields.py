"""Fields of a result frame and their units: the only list of them."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

Usual = Literal["ux", "uy", "vx", "vy", "ax", "ay", "energy", "damage"]  # of every model
Along = Literal["uz", "vz", "az"]  # of every model in space
Own = Literal["sxx", "syy", "sxy", "szz", "sxz", "syz", "plastic", "rotation", "J", "c", "h", "solid", "T"]  # of some
Column = Usual | Along | Own
USUAL: tuple[Column, ...] = get_args(Usual)
ALONG: tuple[Column, ...] = get_args(Along)
OF_CONTENT: tuple[Column, ...] = ("c", "h", "solid", "T")  # of what diffuses


class Field(NamedTuple):
    """A quantity at the nodes and its stored columns, one for each component."""

    unit: str  # SI; "1" for none
    columns: tuple[Column, ...]

    @property
    def symbol(self) -> str:
        """Symbol of a vector: u for ux and uy."""
        return self.columns[0][0]


FIELDS = {
    "displacement": Field("m", ("ux", "uy")),
    "velocity": Field("m/s", ("vx", "vy")),
    "acceleration": Field("m/s^2", ("ax", "ay")),
    "energy": Field("J/m^3", ("energy",)),
    "damage": Field("1", ("damage",)),
    "stress": Field("Pa", ("sxx", "syy", "sxy", "szz")),
    "plastic": Field("1", ("plastic",)),  # equivalent plastic strain
    "rotation": Field("rad", ("rotation",)),
    "volume": Field("1", ("J",)),  # over that of the start
    "concentration": Field("mol/m^3", ("c",)),  # of what is dissolved
    "content": Field("mol/m^3", ("h",)),  # the same, with what is solid
    "solid": Field("1", ("solid",)),  # share of the node
    "temperature": Field("K", ("T",)),
}
IN_SPACE: dict[str, tuple[Column, ...]] = {  # columns that fields have besides in bodies
    "displacement": ("uz",),
    "velocity": ("vz",),
    "acceleration": ("az",),
    "stress": ("sxz", "syz"),
}
UNITS: dict[str, str] = {  # in order
    column: field.unit for name, field in FIELDS.items() for column in (*field.columns, *IN_SPACE.get(name, ()))
}


def of_dimension(name: str, dimension: int) -> tuple[Column, ...]:
    """Columns of the field called `name`, in 2 or 3 dimensions."""
    return (*FIELDS[name].columns, *(IN_SPACE.get(name, ()) if dimension == 3 else ()))


def usual(dimension: int) -> tuple[Column, ...]:
    """Default fields of a frame, in 2 or 3 dimensions."""
    return USUAL if dimension == 2 else (*USUAL, *ALONG)
