"""Prepares a plate of a linear peridynamic solid for a moving fine zone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material_constants import bulk_modulus
from pdsolve.adaptivity.hybrid.alike_nodes import distance
from pdsolve.adaptivity.hybrid.arrays import RING
from pdsolve.adaptivity.hybrid.coarse_cells import Plate, cells_of, plate_of, refused
from pdsolve.adaptivity.hybrid.history import NOTHING
from pdsolve.adaptivity.hybrid.lattice import AROUND, COARSE, FINE
from pdsolve.adaptivity.hybrid.state_based.operator import StateBasedHybrid
from pdsolve.adaptivity.hybrid.state_based.plate import Whole, bonds_of, corners_of, divisions_of, places_on
from pdsolve.conditions import drive, unbreakable
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.options import Options
from pdsolve.schemes import families

SEAM = 0.9  # of the squared sure step of the fine lattice: what short, stiff pieces leave
SHARED = 0.65  # of the fine lattice's bound, which nodes on the border may have beside that of coarse cells


def plate_with_zone(model: Model, options: Options) -> StateBasedHybrid:
    """The operator at the start. Raises ModelError for a plate that the method does not support."""
    if options.precision != "float64":
        raise refused(model, "precision", options.precision, "float64 with model 'ordinary'")
    plate = plate_of(model, options.mode)
    whole = whole_of(model, plate)
    cells = cells_of(plate, int(np.abs(whole.ways).max()))
    _around_cracks(cells, plate, int(np.abs(whole.ways).max()) + RING)
    return StateBasedHybrid(whole, cells, NOTHING)


def whole_of(model: Model, plate: Plate) -> Whole:
    """What does not change of a plate. Raises ModelError for several materials, which the method does not support."""
    if len(model.materials) > 1:
        raise refused(model, "$.regions", f"{len(model.materials)} materials", "one with model 'ordinary'")
    filled = families.fill(model).whole()
    listed = BondList(law_of(model), model, filled.bonds, True)
    xy, row = places_on(plate)
    ways, bonds = bonds_of(filled.bonds, listed.columns, xy)
    material = model.materials[0]
    if material.failure == "none":
        bonds.limit[:] = np.inf
    assert material.nu is not None  # see `Kind.wrong`
    bulk, shear = bulk_modulus(material.E, material.nu, material.plane), material.E / (1 + material.nu)
    bound, coarse = float(listed.stiffness_bound().max()), (bulk + shear / 2) / (2 * plate.h**2)
    return Whole(
        model=model,
        plate=plate,
        xy=xy,
        row=row,
        area=filled.area,
        cut=filled.family - np.diff(filled.bonds.start),
        corners=corners_of(xy, row),
        ways=ways,
        bonds=bonds,
        divisions=divisions_of(ways),
        bulk=bulk,
        shear=shear,
        lasts=unbreakable(model),
        hot=model.settings.run.hybrid.kappa * float(bonds.limit.min(initial=np.inf)),
        resistance=max(bound / SEAM, coarse + SHARED * bound) / material.rho,
        driven=drive(model, filled.area, True, np.float64),
    )


def _around_cracks(cells: NDArray[np.uint8], plate: Plate, reach: int) -> None:
    """Make coarse cells (c,) within `reach` spacings of pre-cracks fine: none of their bonds is cut."""
    at = plate.at
    y, x = np.divmod(np.flatnonzero(cells == COARSE), at.cell_stride)
    middle = 2.0 * np.column_stack([x - AROUND, y - AROUND]) + 1
    found = np.zeros(len(middle), dtype=np.bool_)
    for crack in plate.cracks:
        found |= distance(middle, crack) < reach + np.sqrt(2)
    cells[np.flatnonzero(cells == COARSE)[found]] = FINE
