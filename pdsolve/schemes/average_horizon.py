"""Symmetric bonds: two nodes interact within the mean of their horizons, with the constants of that mean.

Each pair has one modulus, c_ij = c_ji, so that linear and angular momentum are conserved. Compared with the dual
horizon of H. Ren, X. Zhuang, Y. Cai, T. Rabczuk, Int. J. Numer. Methods Eng. 108 (2016) 1451-1476, which is also
symmetric, waves are reflected less where spacings differ.

- Areas are exact cells, unless the model says otherwise.
- With a constant micromodulus a neighbour's cell counts by its share within the horizon (Hu's beta, the mean of both
  ends' to stay symmetric), in a family that reaches half a spacing beyond the horizon. With a conical one, which is
  0 at the horizon, it counts in full: less is reflected, and displacements are better (docs/developers/benchmarks.md).
- The lattice is calibrated: its mean stiffness and fracture energy are those of the material, and small families are
  made isotropic (`pdmesh.model.lattice_calibration`).
- Surfaces, the faces of pre-cracks and interfaces are corrected by the energy method. In the plane, each bond has a
  factor such that, in uniform stretching along x and along y, its two nodes have on average the energy of a node in a
  full lattice (Q. V. Le, F. Bobaru, Comput. Mech. 61 (2018) 499-518, section "energy method"). In space, where families
  lack more, the factor is sum_a n_a^2 (c_ia + c_ja) / 2, n = xi / |xi|. The three numbers c of a node are those with
  which it would have the energy of a full lattice if its neighbours were like it, in stretching along each axis with
  the lateral contraction of a free bar. A bar four nodes thick is then 0.3 % softer than its lattice, one of eight
  0.4 %. Bonds cut by a pre-crack have no energy, around its tip as well: exempting the tip makes displacements around
  it worse (tests/verification/test_crack_faces.py). Cracks that grow during a run are not corrected.
- A bond round the tip of a pre-crack (`pdmesh.model.visibility`) has the modulus of the path's length.
- At a material interface, each end contributes half the stiffness and half the fracture energy of a bond, which an
  interface of the model replaces by its own (`pdsolve.bonds.interfaces`).
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import (
    NO_SHELLS,
    Calibration,
    calibration,
    has_partial_cells,
    hu_beta,
    lattice_ratios,
)
from pdmesh.model.material import Material
from pdmesh.model.material_constants import BONDS_NU, C11, C66, STIFFNESS, critical_stretch, micromodulus
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, Pairs, chosen, row_chunks, tree_of
from pdmesh.model.visibility import sight_of
from pdsolve.bonds.assembly import BondSource, Paired, Part, areas, part_of
from pdsolve.bonds.interfaces import Crossings, Interfaces, cut_of_springs
from pdsolve.conditions import unbreakable
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.model import Model
from pdsolve.schemes.coarse_strength import is_unbreakable, strength_reach
from pdsolve.schemes.gripped_edges import inside_edges

NU = BONDS_NU["space"]
LEAST, MOST = 0.2, 8.0  # of the corrections of a node in space; those of a cube are 0.59 to 5.2
SAME = 1e-12  # relative: a limit this near to its peak is that of a brittle bond, but for round-off


class Corrections(NamedTuple):
    """Optional corrections beyond the bare sums; all are on, except to measure their effect."""

    partial_cells: bool = True  # Hu's beta, with a constant micromodulus
    calibration: bool = True  # of the lattice's stiffness and fracture energy
    surfaces: bool = True  # the energy method


ALL = Corrections()


class Rule:
    """Makes the bonds of a model from pairs and from nodal corrections; see `ByPairs`."""

    def __init__(self, model: Model, corrections: Corrections = ALL) -> None:
        """Raises GridError for an outline that encloses nothing."""
        grid = model.grid
        self.area, self._model, self._corrections = areas(model, "cells"), model, corrections
        self._interfaces = Interfaces(model) if model.settings.interfaces else None
        self._margin = 0.5 if corrections.partial_cells else 0.0  # spacings
        self.sight, self.held = sight_of(grid, model.name), unbreakable(model)
        self.farthest = float((model.horizons + self._margin * grid.delta).max())
        stiffness = max(STIFFNESS[material.plane, material.micromodulus] for material in model.materials)
        self._nothing = ROUND_OFF * stiffness * float(model.node_values("E").max())

    @cached_property
    def neighbours(self) -> Neighbours:
        """The search for pairs."""
        grid = self._model.grid
        return Neighbours(grid.position, grid.delta, self._model.horizons + self._margin * grid.delta, mutual=True)

    def constants(self, pairs: Pairs) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Modulus, peak and limit (b,) of pairs; the modulus of those that do not interact is 0."""
        reach = self._reach(pairs)
        modulus, peak, limit = self._mean_of_ends(pairs, reach)
        return np.where(self._strong(modulus, reach), modulus, 0.0), peak, limit

    def strength(self, pairs: Pairs) -> NDArray[np.float64]:
        """Modulus (b,) of interacting pairs."""
        return self._mean_of_ends(pairs, self._reach(pairs))[0]

    def beside(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of these nodes and of all nodes that may have them in their families."""
        if not len(rows):
            return rows
        position = self._model.grid.position
        far, _ = tree_of(position[rows]).query(position, distance_upper_bound=self.farthest * (1 + ROUND_OFF))
        return np.flatnonzero(np.isfinite(far))

    def _mean_of_ends(
        self, pairs: Pairs, reach: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        crossings = None if self._interfaces is None else self._interfaces.crossed(pairs)
        return _mean_of_ends(self._model, pairs, reach, self._corrections, crossings)

    def _reach(self, pairs: Pairs) -> NDArray[np.float64]:
        return np.asarray((self._model.horizons[pairs.source] + self._model.horizons[pairs.target]) / 2)

    def _strong(self, modulus: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(modulus * reach ** (self._model.grid.dimension + 1) > self._nothing)

    def looked(self, pairs: Pairs) -> Paired:
        """Pairs that no hole or edge separates; their stiffness is the modulus, N/m^5, in space N/m^6."""
        reach = self._reach(pairs)
        modulus, peak, limit = self._mean_of_ends(pairs, reach)
        pair_numbers = np.flatnonzero(self._strong(modulus, reach))
        pair_numbers = pair_numbers[self.sight.inside(chosen(pairs, pair_numbers))]
        pairs = chosen(pairs, pair_numbers)
        modulus = modulus[pair_numbers]
        peak = peak[pair_numbers]
        limit = limit[pair_numbers]
        reach = reach[pair_numbers]
        far = self.sight.apart(pairs, self._model.materials[0].detour, self.farthest)
        round_a_tip = (far > pairs.length) & (far < 2 * self.farthest)
        if round_a_tip.any():
            modulus[round_a_tip] = self.strength(chosen(pairs._replace(length=far), round_a_tip))
        intact = (far < 2 * self.farthest) & self._strong(modulus, reach)
        return Paired(pairs, intact, modulus, peak, limit, self.area[pairs.target])

    def lack(self, rows: NDArray[np.int64], paired: Paired) -> NDArray[np.float64]:
        """Surface correction (k, d) of rows, which increase, with these pairs.

        In the plane, the energy of the rows in a full lattice over that of their intact pairs, in uniform stretching
        along each axis; 1 without energy. In space, the factors c for which the two energies are equal.
        """
        pairs, position = paired.pairs, self._model.grid.position
        n = (position[pairs.target] - position[pairs.source]) / pairs.length[:, None]
        full = _full_energy(self._model, rows, self._corrections)
        lack: list[NDArray[np.float64]] = []
        together = int(rows[-1] - rows[0]) + 1 == len(rows)
        place = pairs.source - rows[0] if together else np.searchsorted(rows, pairs.source)
        stiffness = np.where(paired.intact, paired.stiffness * pairs.length * self.area[pairs.target] / 2, 0.0)
        if n.shape[1] == 3:
            sums = [np.bincount(place, stiffness * share, minlength=len(rows)) for share in shares(n).T]
            return _corrections_in_space(full, np.array(sums, dtype=np.float64).T.reshape(-1, 3, 3))
        for axis in range(2):
            bond_energy = np.bincount(place, stiffness * n[:, axis] ** 4, minlength=len(rows))
            with np.errstate(divide="ignore"):
                lack.append(np.where(bond_energy > 0, full / bond_energy, 1.0))
        return np.column_stack(lack)

    def lack_in_space(self, rows: NDArray[np.int64], bond_energy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Surface correction of rows (k, 3) whose bonds hold `bond_energy` (k, 3, 3), Pa; see `shares`."""
        return _corrections_in_space(_full_energy(self._model, rows, self._corrections), bond_energy)

    def part(self, rows: NDArray[np.int64], paired: Paired, lack: NDArray[np.float64]) -> Part:
        """Bonds of consecutive rows with these pairs and the nodes' surface corrections (n, d)."""
        pairs, position = paired.pairs, self._model.grid.position
        n = (position[pairs.target] - position[pairs.source]) / pairs.length[:, None]
        total = np.zeros(len(n))
        for axis, correction in enumerate(lack.T):
            mean = (correction[pairs.source] + correction[pairs.target]) / 2
            total += n[:, axis] ** 2 * mean if n.shape[1] == 3 else (n[:, axis] / mean) ** 2
        factor = total if n.shape[1] == 3 else total**-0.5  # equal for both directions; 1 inside a uniform grid
        if self._interfaces is not None:
            factor = factor * self._interfaces.stiffness(pairs)  # which is no lack that surfaces make up for
        paired = paired._replace(stiffness=paired.stiffness * factor * paired.weight)
        return part_of(position, self.held, rows, paired)


def fill(model: Model, corrections: Corrections = ALL) -> BondSource:
    """Average-horizon bonds of the model. Raises GridError for an outline that encloses nothing."""
    rule, nodes, d = Rule(model, corrections), len(model.grid), model.grid.dimension

    def paired_of(rows: NDArray[np.int64]) -> Paired:
        return rule.looked(rule.neighbours.pairs(rows))

    @cache
    def surfaces() -> tuple[NDArray[np.float64], Paired | None]:
        """Corrections of all nodes, and all pairs where they are so few as to be found in one go."""
        lack, together = np.ones((nodes, d)), None
        for rows in row_chunks(nodes) if corrections.surfaces else ():
            paired = paired_of(rows)
            lack[rows] = rule.lack(rows, paired)
            together = paired if len(rows) == nodes else None
        return inside_edges(lack, model, rule.farthest), together

    def part(rows: NDArray[np.int64]) -> Part:
        lack, together = surfaces()
        paired = together if len(rows) == nodes else None
        return rule.part(rows, paired or paired_of(rows), lack)

    return BondSource(rule.area, part, paired_of, rule.strength)


def _mean_of_ends(
    model: Model,
    pairs: Pairs,
    reach: NDArray[np.float64],
    corrections: Corrections,
    crossings: Crossings | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Modulus, peak and limit of each pair (b,): half from the material of each end, including partial cells.

    The peak keeps the mean energy up to it, the limit the mean total energy; equal ends keep their own values.
    """
    if not model.varies:
        modulus, peak, limit, no_fail = _of_end(model, pairs, reach, pairs.source, corrections, crossings)
        return modulus, np.where(no_fail, np.inf, peak), np.where(no_fail, np.inf, limit)
    modulus, up_to_peak, total_energy = (np.zeros(len(pairs.length)) for _ in range(3))
    widest_peak, widest = np.zeros(len(pairs.length)), np.zeros(len(pairs.length))
    unbreakable = np.zeros(len(pairs.length), dtype=bool)
    for end in (pairs.source, pairs.target):
        c, peak, limit, no_fail = _of_end(model, pairs, reach, end, corrections, crossings)
        unbreakable |= no_fail
        modulus += 0.5 * c
        up_to_peak += 0.5 * c * peak**2
        total_energy += 0.5 * c * peak * limit
        widest_peak += 0.5 * peak
        widest += 0.5 * limit
    with np.errstate(invalid="ignore", divide="ignore"):
        peak = np.where(modulus > 0, np.sqrt(up_to_peak / modulus), widest_peak)
        limit = np.where(modulus > 0, total_energy / (modulus * peak), widest)
    peak[unbreakable] = limit[unbreakable] = np.inf
    return modulus, peak, np.where(limit <= peak * (1 + SAME), peak, limit)


def _of_end(
    model: Model,
    pairs: Pairs,
    reach: NDArray[np.float64],
    end: NDArray[np.int64],
    corrections: Corrections,
    crossings: Crossings | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Modulus, peak and limit of each pair (b,), with the material of its node `end` (b,), and whether that keeps it
    from breaking."""
    modulus, peak, limit = (np.zeros(len(pairs.length)) for _ in range(3))
    no_fail = np.zeros(len(pairs.length), dtype=np.bool_)
    ratio, delta = model.settings.horizon.ratio, model.grid.delta
    for material_rows, material_of_end in model.materials_at(end):
        material = material_of_end
        if crossings is not None:
            material = crossings.material(material, material_rows, cut_of_springs(material, ratio))
        length, far, rows = pairs.length[material_rows], reach[material_rows], end[material_rows]
        calibrated = _calibration(model, material, corrections)
        if _has_partial_cells(material, corrections):
            source_spacing, target_spacing = delta[pairs.source[material_rows]], delta[pairs.target[material_rows]]
            counted = (hu_beta(length, far, source_spacing) + hu_beta(length, far, target_spacing)) / 2
        else:
            counted = np.where(length <= far * (1 + ROUND_OFF), 1.0, 0.0)
        c = counted * calibrated.stiffness * micromodulus(material, length, far)
        modulus[material_rows] = c * calibrated.shells.at(length / far * ratio)
        critical = calibrated.stretch * critical_stretch(material, strength_reach(model, material, rows, far))
        peak[material_rows], limit[material_rows] = limits(material, Sizes(critical, length, far, ratio))
        no_fail[material_rows] = is_unbreakable(model, material, rows, far)
    return modulus, peak, limit, no_fail


def _has_partial_cells(material: Material, corrections: Corrections) -> bool:
    return corrections.partial_cells and has_partial_cells(material)


def _calibration(model: Model, material: Material, corrections: Corrections) -> Calibration:
    ratio, partial = model.settings.horizon.ratio, _has_partial_cells(material, corrections)
    if not corrections.calibration:
        return Calibration(1.0, 1.0, NO_SHELLS, lattice_ratios(ratio, material.micromodulus, material.plane, partial))
    return calibration(ratio, material, partial)


def shares(n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (b, 9) of bonds along n (b, 3) in what a node holds in stretching along a by what c_b multiplies."""
    squares = n**2
    stretched = (squares * (1 + NU) - NU) ** 2
    return np.asarray((stretched[:, :, None] * squares[:, None, :]).reshape(-1, 9))


def _corrections_in_space(full: NDArray[np.float64], bond_energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Factors c (k, 3) that give nodes of `bond_energy` (k, 3, 3) the energy `full` (k,), Pa; see `shares`."""
    lacks = full[:, None] - bond_energy.sum(axis=2)  # before what follows, so that nodes inside lack nothing
    scale = bond_energy.trace(axis1=1, axis2=2)
    # Bonds may all lie in a plane
    bond_energy += ROUND_OFF * np.where(scale > 0, scale, 1.0)[:, None, None] * np.eye(3)
    factors = 1 + np.linalg.solve(bond_energy, lacks[..., None])[..., 0]
    factors = np.where(scale[:, None] > 0, np.clip(factors, LEAST, MOST), 1.0)
    factors[np.abs(factors - 1).max(axis=1) <= ROUND_OFF] = 1
    return factors


def _full_energy(model: Model, rows: NDArray[np.int64], corrections: Corrections) -> NDArray[np.float64]:
    """Twice the energy density (k,) of the rows in a full lattice of their material, at unit stretch, Pa."""
    full = np.zeros(len(rows))
    for material_rows, material in model.materials_at(rows):
        calibrated = _calibration(model, material, corrections)
        modulus = C11[material.plane] * calibrated.ratios.c11
        if model.grid.dimension == 3:
            modulus = (1 + 2 * NU**2) * modulus + 2 * (NU**2 - 2 * NU) * C66[material.plane] * calibrated.ratios.c12
        full[material_rows] = modulus * material.E * calibrated.stiffness
    return full
