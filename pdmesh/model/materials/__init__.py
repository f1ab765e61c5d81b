"""The kinds of materials, one a file, by the names users give them (`Material.model`)."""

from __future__ import annotations

from pdmesh.model.materials.bond import BOND
from pdmesh.model.materials.correspondence import CORRESPONDENCE
from pdmesh.model.materials.kind import Kind, Refusal, Refusals
from pdmesh.model.materials.micropolar import MICROPOLAR
from pdmesh.model.materials.ordinary import ORDINARY

KINDS: dict[str, Kind] = {kind.name: kind for kind in (ORDINARY, CORRESPONDENCE, MICROPOLAR, BOND)}

__all__ = ["KINDS", "Kind", "Refusal", "Refusals"]
