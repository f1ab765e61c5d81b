"""Places near marked ones on a lattice, without SciPy, whose image functions take long to import."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def in_square(marked: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Mask (rows, columns) of places at most `reach` rows and columns from a marked one."""
    return _along(_along(marked, reach).T, reach).T


def in_disc(marked: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Mask (rows, columns) of places at most `radius` lattice spacings from a marked one."""
    mask = np.zeros_like(marked)
    if radius < 0 or not marked.any():
        return mask
    for row in range(min(int(radius) + 1, len(mask))):
        wide = _along(marked, int(np.sqrt(radius**2 - row**2)))
        mask[row:] |= wide[: len(wide) - row]
        mask[: len(mask) - row] |= wide[row:]
    return mask


def _along(marked: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Mask of places at most `reach` columns from a marked one."""
    mask, done = marked.copy(), 0
    while done < reach:
        step = min(done + 1, reach - done)
        before = mask.copy()
        mask[:, step:] |= before[:, :-step]
        mask[:, :-step] |= before[:, step:]
        done += step
    return mask
