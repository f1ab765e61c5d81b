"""How bonds are filled from a model: a scheme a file, the names users give them in one table."""

from __future__ import annotations

from pdsolve.schemes import average_horizon, one_sided
from pdsolve.schemes.scheme import Scheme

SCHEMES: dict[str, Scheme] = {
    scheme.name: scheme
    for scheme in (
        Scheme("thesis", one_sided.fill, symmetric=False, partial_cells=False, exact_load=False),
        Scheme("conservative", average_horizon.fill, symmetric=True, partial_cells=True, exact_load=True),
    )
}
