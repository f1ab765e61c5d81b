"""What a frame of results holds of the nodes, and in which units: known here and nowhere else."""

from __future__ import annotations

from typing import Literal, NamedTuple

Column = Literal["ux", "uy", "vx", "vy", "ax", "ay", "energy", "damage"]

CRACKED = 0.35  # damage above which a node belongs to a crack


class Field(NamedTuple):
    """A quantity of the nodes and the columns of numbers that it is stored as, one for each component."""

    unit: str  # SI; "1" for none
    columns: tuple[Column, ...]

    @property
    def symbol(self) -> str:
        """The letter of a vector: u of ux and uy."""
        return self.columns[0][0]


FIELDS = {
    "displacement": Field("m", ("ux", "uy")),
    "velocity": Field("m/s", ("vx", "vy")),
    "acceleration": Field("m/s^2", ("ax", "ay")),
    "energy": Field("J/m^3", ("energy",)),
    "damage": Field("1", ("damage",)),
}
UNITS: dict[str, str] = {column: field.unit for field in FIELDS.values() for column in field.columns}  # in order
