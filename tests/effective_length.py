"""The effective length of laws: how far they act, by how long waves slow down.

omega^2 = (E' / rho) k^2 (1 - (k l)^2 / 12 + ...): a chain of springs between next neighbours l apart does the same.
With T_ij the entries of a law's own tangent along x for a wave along x, l^2 = sum T_ij x^4 / sum T_ij x^2.
"""

from __future__ import annotations

import msgspec
import numpy as np
from plates import square_grid

from pdmesh.model.document import Horizon, Material, Settings
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.state import State

UNIT = Material(E=1.0, rho=1.0, G0=1e9, nu=1 / 3, plane="stress")  # the Poisson's ratio that bonds have
SOLID = msgspec.structs.replace(UNIT, failure="none")
STRIP, OVER = (60, 24), 1.2  # nodes; times G0
LAWS = {
    "bonds, conical": msgspec.structs.replace(UNIT, micromodulus="conical"),
    "bonds, constant": msgspec.structs.replace(UNIT, micromodulus="constant"),
    **{
        f"ordinary, {influence}": msgspec.structs.replace(SOLID, model="ordinary", influence=influence)
        for influence in ("constant", "inverse", "cubic spline")
    },
    **{
        f"correspondence, {influence}": msgspec.structs.replace(SOLID, model="correspondence", influence=influence)
        for influence in ("constant", "cubic spline")
    },
    "Breitzman-Dayal, cubic spline": msgspec.structs.replace(
        SOLID, model="correspondence", control="breitzman-dayal", influence="cubic spline"
    ),
}


def length_of(material: Material, ratio: float) -> float:
    """The effective length, in spacings, of a law deep inside a plate."""
    side = 2 * int(2 * ratio + 3) + 1
    model = Model(square_grid(side, side, 1.0), Settings(material=material, horizon=Horizon(ratio)))
    system, _ = prepare(model, Options(kernel="listed", threads=1))
    nodes, middle = side**2, side**2 // 2
    rest = State(*np.zeros((3, nodes, 2)), *np.zeros((3, nodes)))
    row = system.operator.tangent(rest)[[2 * middle]].toarray()[0, ::2]
    x = system.model.grid.position[:, 0] - system.model.grid.position[middle, 0]
    return float(np.sqrt((row * x**4).sum() / (row * x**2).sum()))
