"""How a database of results came to be: by what, and in which units."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from pdmesh import VERSION


def made_by(provenance: str, dimension: int) -> dict[str, Any]:
    """What results of any physics say of themselves, of a plate or, in three dimensions, a body."""
    return {
        "program": f"pdsolve {VERSION}",
        "provenance": provenance,
        "units": "SI, per unit thickness" if dimension == 2 else "SI",
        "dimension": dimension,
        "numpy": np.__version__,
        "numba": numba.__version__,
    }
