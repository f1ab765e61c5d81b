"""Bodies that bonds do not join, and how they touch: parts of the grid file."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.timed_selection import Amount, Id, Positive

REST = "plate"  # the body of the nodes that no other has


class BodyNodes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A body besides the first one, by the ids of its nodes."""

    name: str
    nodes: tuple[Id, ...]


class Contact(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How bodies, and the faces of cracks, push each other apart."""

    stiffness: Positive = 15.0  # of a pair of nodes, in micromoduli over their horizon
    distance: Annotated[float, msgspec.Meta(gt=0, le=1)] = 1.0  # at which pairs begin to touch, in spacings
    friction: Amount = 0.0  # Coulomb's coefficient


class Bodies(NamedTuple):
    """The bodies of n nodes."""

    number: NDArray[np.int64]  # (n,) 0: of the first body
    names: tuple[str, ...]  # from number 0 on

    def parted(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (b,) of pairs of rows that are in different bodies."""
        return np.asarray(self.number[source] != self.number[target])


def bodies_of(records: tuple[BodyNodes, ...], ids: NDArray[np.int64]) -> Bodies | None:
    """The bodies of nodes with these ids (n,); None if there is one. Raises ValueError naming place and id."""
    if not records:
        return None
    number, order = np.zeros(len(ids), dtype=np.int64), np.argsort(ids)
    for at, record in enumerate(records):
        asked = np.array(record.nodes, dtype=np.int64)
        if not len(asked):
            raise ValueError(f"$.bodies[{at}].nodes: found none, expected at least one")
        rows = order[np.searchsorted(ids, asked, sorter=order).clip(max=len(ids) - 1)]
        for wrong, said in (
            (ids[rows] != asked, "one of the grid's nodes"),
            (number[rows] > 0, "one of no other body"),
        ):
            if wrong.any():
                raise ValueError(f"$.bodies[{at}].nodes: found id {asked[wrong.argmax()]}, expected {said}")
        number[rows] = at + 1
    return Bodies(number, (REST, *(record.name for record in records)))


def records_of(bodies: Bodies | None, ids: NDArray[np.int64]) -> tuple[BodyNodes, ...]:
    """The bodies as the grid file has them."""
    if bodies is None:
        return ()
    rest = enumerate(bodies.names[1:], start=1)
    return tuple(BodyNodes(name, tuple(ids[bodies.number == number].tolist())) for number, name in rest)
