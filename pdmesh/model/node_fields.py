"""Constants of materials that differ from node to node: which can, and their arrays in the grid file.

A file holds the values, not the recipe that made them: runs repeat exactly wherever the recipe's files are, and the
recipe is named beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args

import msgspec

from pdmesh.model.base_structs import PlainStruct
from pdmesh.model.orthotropic import ORTHOTROPIC

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pdmesh.model.material import Material

Quantity = Literal["E", "rho", "G0", "nu", "f_t", "strength", "yield_stress", "hardening", "alpha", "angle"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
LEAST, MOST = 1e-30, 1e30  # of E, rho and G0 too: products of a few of them stay numbers
SIGNED = ("hardening", "alpha", "angle")  # may be 0 or negative
RATIOS = -1.0, 0.5  # of nu, neither included
RATIOS_OF_PLIES = -1.0, 1.0  # likewise, where all materials are plies; their energy is checked with E / E2


class NodeField(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A constant of the material by node, in place of that of the node's material."""

    quantity: Quantity
    values: tuple[float | None, ...]  # of the nodes, in their order; none: that of the node's material
    source: Annotated[str, msgspec.Meta(max_length=1000)] = ""  # where the values come from, with the seed of random
    # ones


class FieldColumn(NamedTuple):
    """A constant of the material of n nodes."""

    quantity: Quantity
    values: NDArray[np.float64]  # (n,) SI; NaN: that of the node's material
    source: str = ""


def columns_of(records: Sequence[NodeField], nodes: int, materials: Sequence[Material] = ()) -> tuple[FieldColumn, ...]:
    """The fields of a file with these materials as arrays. Raises ValueError, beginning with the place in the file."""
    import numpy as np

    columns: list[FieldColumn] = []
    for number, record in enumerate(records):
        place = f"$.fields[{number}]"
        if len(record.values) != nodes:
            raise ValueError(f"{place}.values has {len(record.values)} numbers; give {nodes}, one for each node")
        if any(column.quantity == record.quantity for column in columns):
            raise ValueError(f"{place}.quantity: {record.quantity} is there twice; use one field for it")
        values = np.array([np.nan if value is None else value for value in record.values], dtype=float)
        wrong = wrong_values(record.quantity, values, materials)
        if wrong is not None:
            raise ValueError(f"{place}.values[{wrong[0]}] is {values[wrong[0]]:g}; use {wrong[1]}")
        columns.append(FieldColumn(record.quantity, values, record.source))
    return tuple(columns)


def records_of(columns: Sequence[FieldColumn]) -> tuple[NodeField, ...]:
    """The fields as the file has them."""
    return tuple(
        NodeField(quantity, tuple(None if value != value else value for value in values.tolist()), source)
        for quantity, values, source in columns
    )


def wrong_values(
    quantity: str, values: NDArray[np.float64], materials: Sequence[Material] = ()
) -> tuple[int, str] | None:
    """The first value (n,) that a constant of these materials cannot have, and what to use; None without one.

    NaN stands for none.
    """
    import numpy as np

    if quantity == "nu":
        plies = bool(materials) and all(material.solid == ORTHOTROPIC for material in materials)
        least, most = RATIOS_OF_PLIES if plies else RATIOS
        bad, use = (values <= least) | (values >= most), f"more than {least:g} and less than {most:g}"
    elif quantity in SIGNED:
        bad, use = np.abs(values) > MOST, f"at most {MOST:g}"
    else:
        bad, use = (values < LEAST) | (values > MOST), f"{LEAST:g} to {MOST:g} in SI units"
    return (int(bad.argmax()), use) if bad.any() else None


def with_field(
    columns: Sequence[FieldColumn],
    quantity: str,
    values: NDArray[np.float64],
    rows: NDArray[np.int64] | slice = slice(None),
) -> NDArray[np.float64]:
    """The values (k,) that nodes in `rows` have of their materials, replaced by those of the quantity's field."""
    import numpy as np

    for column in columns:
        if column.quantity == quantity:
            own = column.values[rows]
            return np.where(np.isnan(own), values, own)
    return values


def unused(quantity: str, material: Material, physics: str) -> str | None:
    """What a material needs so that this constant can differ by node; None if it can."""
    needs = {
        # the limits of stretch and energy depend on nu by sums over a lattice for each value
        "nu": (
            material.model in ("ordinary", "correspondence") and material.failure in ("stress", "none"),
            "model 'ordinary' or 'correspondence', with failure 'stress' or 'none'",
        ),
        "f_t": (material.law == "cohesive", "law 'cohesive'"),
        "strength": (material.failure == "stress", "failure 'stress'"),
        "angle": (material.solid == ORTHOTROPIC, "solid 'orthotropic'"),
        "alpha": (physics == "thermoelastic", "physics 'thermoelastic'"),
        **dict.fromkeys(("yield_stress", "hardening"), (material.solid == "j2", "solid 'j2'")),
    }
    used, needed = needs.get(quantity, (True, ""))
    return None if used else needed
