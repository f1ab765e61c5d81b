"""Bodies that bonds do not join, and how they touch: parts of the grid file."""

from __future__ import annotations

import msgspec

from pdmesh.model.timed_selection import Amount, Id, Positive, Share

REST = "plate"  # the body of the nodes that no other has


class BodyNodes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A body besides the first one, by the ids of its nodes."""

    name: str
    nodes: tuple[Id, ...]


class Contact(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How bodies, and the faces of cracks, push each other apart."""

    stiffness: Positive = 15.0  # of a pair of nodes, in micromoduli over their horizon
    distance: Share = 1.0  # at which pairs begin to touch, in spacings
    friction: Amount = 0.0  # Coulomb's coefficient
