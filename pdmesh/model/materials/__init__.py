"""The kinds of materials, one a file, by the names users give them (`Material.model`)."""

from __future__ import annotations

from functools import cache

from pdmesh.model.material import DECLARED, Material
from pdmesh.model.materials.bond import BOND
from pdmesh.model.materials.correspondence import CORRESPONDENCE
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals
from pdmesh.model.materials.micropolar import MICROPOLAR
from pdmesh.model.materials.ordinary import ORDINARY

KINDS: dict[str, MaterialKind] = {kind.name: kind for kind in (ORDINARY, CORRESPONDENCE, MICROPOLAR, BOND)}


@cache
def refused_by(kind: str) -> tuple[tuple[str, object], ...]:
    """Parameters that a kind refuses, as only others have them, and their values where they are left out."""
    kind_parameters, usual = KINDS[kind].parameters, Material(E=1.0, rho=1.0, G0=1.0)
    others = (
        name for material_kind in KINDS.values() for name in material_kind.parameters if name not in kind_parameters
    )
    return tuple((name, getattr(usual, name)) for name in others if DECLARED[name].refused)


__all__ = ["KINDS", "MaterialKind", "Refusal", "Refusals", "refused_by"]
