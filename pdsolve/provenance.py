"""Origin of a database of results: program versions and units."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from pdmesh import VERSION


def made_by(provenance: str, dimension: int) -> dict[str, Any]:
    """Metadata common to results of any physics, for a plate or, with `dimension` 3, a body."""
    return {
        "program": f"pdsolve {VERSION}",
        "provenance": provenance,
        "units": "SI, per unit thickness" if dimension == 2 else "SI",
        "dimension": dimension,
        "numpy": np.__version__,
        "numba": numba.__version__,
    }
