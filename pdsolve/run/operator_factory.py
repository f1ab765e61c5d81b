"""Chooses the operator for a model's bonds."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Filling, listed
from pdsolve.bonds.statistics import BondStatistics
from pdsolve.conditions import unbreakable
from pdsolve.laws import law_of
from pdsolve.laws.law import Law
from pdsolve.model import Model, ModelError
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import Operator
from pdsolve.operators.simd_lattice import families
from pdsolve.operators.simd_lattice.layout import blocks_of
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.operators.space_lattice.kernel import Tiles
from pdsolve.operators.space_lattice.layout import Sites, sites_of, tiles_of
from pdsolve.operators.space_lattice.operator import SpaceLattice
from pdsolve.options import Options, threads_of
from pdsolve.schemes.scheme import Scheme


def operator_of(model: Model, options: Options, scheme: Scheme, filling: Filling) -> tuple[Operator, BondStatistics]:
    """The operator of the bonds: in blocks if possible and not excluded by options; and statistics of the bonds."""
    law, kind = law_of(model), np.dtype(options.precision).type
    blocked = not numba.config.DISABLE_JIT and model.grid.dimension == 2  # blocks are compiled code, of the plane
    if law.pair is not None and options.kernel != "listed" and blocked:
        survey = BondStatistics(filling, scheme.symmetric)
        blocks = blocks_of(law, survey.parts(), len(model.grid), kind, threads_of(options, len(model.grid), True))
        if blocks is not None:
            return SimdLattice(law, blocks, survey.stiffness_bound, scheme.symmetric, survey.softens), survey
    if options.kernel != "listed" and not numba.config.DISABLE_JIT and is_straight(law):
        survey = BondStatistics(filling, scheme.symmetric)
        tiled = _in_tiles(model, filling, survey, kind)
        if tiled is not None:
            threads = threads_of(options, len(model.grid), True)
            return SpaceLattice(*tiled, survey.stiffness_bound, scheme.symmetric, threads), survey
    survey, threads = BondStatistics(filling, scheme.symmetric), threads_of(options, len(model.grid), False)
    bonds = listed(survey.parts(), filling.area).bonds
    where = families.placed(law, bonds) if options.kernel != "listed" and blocked else None
    if where is not None:
        of = law, model, bonds, scheme.symmetric, options.precision, threads
        return families.Families(*of, where), survey
    if options.kernel == "blocks":
        raise ModelError(
            "kernel: found blocks, expected listed: blocks need nodes on a lattice, a law that is written for them, and"
            " compiled code"
        )
    return BondList(law, model, bonds, scheme.symmetric, options.precision, threads), survey


def in_tiles(model: Model) -> bool:
    """Whether the bonds of a body are such as tiles have, as far as can be told without them."""
    return is_straight(law_of(model)) and _sites(model) is not None


def _sites(model: Model) -> Sites | None:
    """The sites of a body's nodes, whose families reach half a spacing beyond the horizon; None for no lattice."""
    return sites_of(model.grid, model.settings.horizon.ratio + 0.5)


def is_straight(law: Law) -> bool:
    """Whether the bonds of a law are linear until they break."""
    pair = law.pair
    return pair is not None and pair.secant is None and pair.softening is None and pair.held is None


def _in_tiles(
    model: Model, filling: Filling, survey: BondStatistics, kind: type[np.floating]
) -> tuple[Tiles, Sites] | None:
    """The bonds of a body in tiles, where they can be."""
    sites = None if filling.correction is None else _sites(model)
    if sites is None or filling.correction is None:
        return None
    of_nodes = filling.correction, filling.area, unbreakable(model)
    tiles = tiles_of(survey.parts(), sites, of_nodes, kind)
    return None if tiles is None else (tiles, sites)


def stable(resistance: NDArray[np.float64], rho: NDArray[np.float64]) -> float:
    """The longest surely stable step, s, for an operator's `stiffness_bound` (n,); infinite without bonds."""
    largest = float((resistance / rho).max(initial=0.0))
    return float(np.sqrt(2 / largest)) if largest > 0 else float("inf")
