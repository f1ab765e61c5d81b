"""When the bonds of a material soften and break, so that a crack costs its fracture energy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material


class Limits(NamedTuple):
    """Stretches at which a bond changes."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone


def limits(material: Material, critical: NDArray[np.float64]) -> Limits:
    """Peak and limit of a material's bonds, given the critical stretch they would have if brittle.

    A bond spends c xi s_p s_0 / 2, so s_p = s_c / sqrt(kr) and s_0 = s_c sqrt(kr) keep G0. Without `keep_G0` it
    is the thesis's s_0 = s_c, s_p = s_c / kr, which spends G0 / kr.
    """
    if material.law == "brittle":
        return Limits(critical, critical)
    if material.keep_G0:
        return Limits(critical / np.sqrt(material.kr), critical * np.sqrt(material.kr))
    return Limits(critical / material.kr, critical)
