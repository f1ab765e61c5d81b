"""How the bonds of a material soften, for `pdmesh info`."""

from __future__ import annotations

import msgspec
import numpy as np

from pdmesh.model import cohesive_softening
from pdmesh.model.lattice_calibration import has_partial_cells, lattice_ratios
from pdmesh.model.material import Material


def softening(material: Material | None, ratio: float, spacing: float, dimension: int) -> dict[str, float]:
    """Numbers in SI units, of the conservative mode at a spacing, m; none where bonds do not soften or pull at all.

    Of bilinear bonds `f_t` is the tensile strength that their `kr` amounts to.
    """
    if material is None or material.model not in ("bond", "micropolar"):
        return {}
    material = msgspec.structs.replace(material, plane="space") if dimension == 3 else material
    horizon = ratio * spacing
    if not lattice_ratios(ratio, material.micromodulus, material.plane, has_partial_cells(material)).c11 > 0:
        return {}
    if material.law == "bilinear" and material.kr > 1:
        return {"f_t": cohesive_softening.strength_of_peak(material, ratio, horizon)}
    if material.law != "cohesive" or material.f_t is None:
        return {}
    return {
        "l_ch": cohesive_softening.characteristic_length(material),
        "horizon": horizon,
        "largest_horizon": cohesive_softening.largest_horizon(material, ratio),
        "w_c": float(cohesive_softening.critical_opening(material, ratio, np.array([horizon]))[0]),
        "first_stretch": cohesive_softening.first_stretch(material),
    }
