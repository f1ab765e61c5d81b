"""What of a pulse comes back from the flat seam of a fine zone in space.

A pulse exp(-(x / w)^2) of pressure or shear runs upright to a seam through a lattice without ends across: of a column 8
cells thick, the middle cell alone moves by its forces, and all others as it does. Shares are those of the largest
velocity before the seam when what comes back is where the pulse began.
"""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdmesh.model.lattice_calibration import offsets
from pdmesh.model.material_constants import micromodulus
from pdmesh.model.neighbours import lengths
from pdsolve.adaptivity.hybrid.space.coarse_springs import cubic_stiffness
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.hybrid.space.prepare import (
    compute_vertex_force_ratio,
    create_full_block,
    create_operator_of_cells,
)
from pdsolve.lattice.tile_bonds import offset_table
from pdsolve.laws.pair_laws.brittle import LAW
from pdsolve.zone.cells import COARSE, FINE, VOID, lattice_coordinates, place_number_at

ACROSS = 8  # cells
AWAY = 80  # spacings from the pulse to the seam; what is sent back, and how wide it is, depends on it
STEP = 0.4  # h sqrt(rho / C11)
HEIGHT = 1e-7  # spacings: small strains


def bonds_of(ratio: float, profile: str = "constant") -> NDArray[np.float64]:
    """Bonds of a lattice of spacing 1 whose cells count in full; see `Tiles.vectors`."""
    xi = offsets(ratio, 3)
    xi = xi[np.lexsort(xi.T)]
    material = msgspec.structs.replace(Material(E=1.0, rho=1.0, G0=1.0, micromodulus=profile), plane="space")
    c = micromodulus(material, lengths(xi), np.full(len(xi), ratio))
    return offset_table(np.rint(xi[c > 1e-12]).astype(np.int64), 1.0, c[c > 1e-12])


def sent_back(ratio: float, width: int, shear: bool, backwards: bool = False, seam: bool = True) -> float:
    """The share of a pulse of this width, spacings, that a seam sends back, of pressure or of `shear`.

    It runs from fine to coarse cells, or `backwards`; without a `seam` all cells are those that it begins in.
    """
    bonds, cells = bonds_of(ratio), (3 * AWAY + 4 * width) // 2
    operator = _column(bonds, cells, (AWAY + 4 * width) // 2, backwards, seam)
    x, y, z = lattice_coordinates(operator.engine.full_body.fine_lattice.numbering.fine, operator.places)
    alike = _alike(operator, x, y, z)
    c11, c12 = cubic_stiffness(bonds)
    speed, axis, dt = float(np.sqrt(c12 if shear else c11)), 2 if shear else 0, STEP / float(np.sqrt(c11))
    u, v, middle = np.zeros((len(x), 3)), np.zeros((len(x), 3)), 2 * cells - AWAY

    def shape(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(HEIGHT * np.exp(-((at / width) ** 2)))

    u[:, axis] = shape(x - middle)
    late = x - middle + speed * dt / 2  # velocities are those half a step before
    v[:, axis] = speed * 2 * late / width**2 * shape(late)
    sent, before = float(np.abs(v).max()), (x > middle - 3 * width) & (x < 2 * cells - 3 * ratio)
    for _ in range(round(2 * AWAY / speed / dt)):
        v += dt * (operator.forces_at_displacements(u) / operator.area[:, None])[alike]
        u += dt * v
    return float(np.abs(v[before]).max()) / sent


def _column(bonds: NDArray[np.float64], cells: int, more: int, backwards: bool, seam: bool) -> HybridBodyOperator:
    """A column along x, `cells` before its seam and some more behind it."""
    whole = create_full_block(LAW, bonds, 1.0, (cells + more, ACROSS, ACROSS))
    first, last = (COARSE, FINE) if backwards else (FINE, COARSE)
    kinds = np.full((ACROSS, ACROSS, cells + more), first, dtype=np.uint8)
    if seam:
        kinds[:, :, cells:] = last
    return create_operator_of_cells(
        whole,
        np.pad(kinds, whole.fine_lattice.numbering.cells.margins[0], constant_values=VOID).ravel(),
        compute_vertex_force_ratio(LAW, bonds, 1.0),
    )


def _alike(
    operator: HybridBodyOperator, x: NDArray[np.int64], y: NDArray[np.int64], z: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Rows (n,) of the nodes in the middle that move as all nodes do."""
    numbering = operator.engine.full_body.fine_lattice.numbering
    return np.searchsorted(operator.places, place_number_at(numbering.fine, (x, ACROSS + y % 2, ACROSS + z % 2)))
