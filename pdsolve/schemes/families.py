"""Families of state-based models: the neighbours of a node, and the weight of each.

Two nodes interact within the mean of their horizons, with one influence for both. A neighbour's weight is its influence
times its cell. The whole cell counts where the influence is 0 at the horizon, or where stress follows a gradient that
is exact for any weights (correspondence). Otherwise the share within the horizon counts (Hu's beta), in a family that
extends half a spacing further. Neighbours behind a pre-crack have weight 0 or, by diffraction, that of the distance
round its tip (`pdmesh.model.visibility`).

The failure limit of bonds is set so that a crack along a row costs G0 when one half of a lattice is moved away from the
other (`pdsolve.schemes.separation_energy`).

The cubic spline, with q = |xi| / horizon, is 2/3 - 4 q^2 + 4 q^3 up to q = 1/2 and 4/3 (1 - q)^3 beyond, times 3/2.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import NO_SHELLS, Shells, hu_beta, offsets, shells
from pdmesh.model.material import Material
from pdmesh.model.material_constants import dimension_of
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, Pairs, chosen, lengths
from pdmesh.model.visibility import sight_of
from pdsolve.bonds.assembly import BondSource, Paired, Part, areas, part_of
from pdsolve.bonds.interfaces import Crossings, Cut, Interfaces
from pdsolve.conditions import unbreakable
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.schemes.balanced_families import NO_FACTORS, BorderFactors, border_factors
from pdsolve.schemes.coarse_strength import is_unbreakable, strength_reach
from pdsolve.schemes.separation_energy import bonds_in_space, cost, patch, patch_in_space

SPENT = ("stretch", "energy")  # failures whose limit follows from what a crack costs
USUAL = {"ordinary": "constant", "correspondence": "cubic spline", "micropolar": "constant"}


def influence(material: Material, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Influence of neighbours at q = |xi| / horizon: 1 at the node or, for the inverse function, at the horizon."""
    kind = material.influence or USUAL[material.model]
    if kind == "constant":
        return np.ones_like(q)
    if kind == "inverse":
        return np.asarray(1 / q)
    near, far = 1 - 6 * q**2 + 6 * q**3, 2 * (1 - q) ** 3
    return np.where(q <= 0.5, near, np.where(q <= 1 - ROUND_OFF, far, 0.0))


def whole_cells(material: Material) -> bool:
    """Whether a neighbour's cell counts in full."""
    return material.model == "correspondence" or (material.influence or USUAL[material.model]) == "cubic spline"


def _weights(
    material: Material,
    length: NDArray[np.float64],
    reach: NDArray[np.float64],
    source_spacing: NDArray[np.float64],
    target_spacing: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Weights (b,) of neighbours at these distances, for ends with these spacings, m, in a lattice as it is."""
    if whole_cells(material):
        beta = np.where(length <= reach * (1 + ROUND_OFF), 1.0, 0.0)
    else:
        beta = (hu_beta(length, reach, source_spacing) + hu_beta(length, reach, target_spacing)) / 2
    return beta * influence(material, length / reach)


@lru_cache
def _shells(material: Material, ratio: float) -> Shells:
    """Factors of weights that make a lattice of ordinary bonds isotropic; others are not in need of them."""
    if material.model != "ordinary":
        return NO_SHELLS
    xi = offsets(ratio + 0.5, dimension_of(material.plane))
    length, ones = lengths(xi), np.ones(len(xi))
    weight = _weights(material, length, ratio * ones, ones, ones)
    return shells(xi, weight * length**2, material.calibration)


def _counts(
    material: Material,
    ratio: float,
    length: NDArray[np.float64],
    reach: NDArray[np.float64],
    source_spacing: NDArray[np.float64],
    target_spacing: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Weights (b,) of neighbours at these distances, for ends with these spacings, m."""
    weights = _weights(material, length, reach, source_spacing, target_spacing)
    return weights * _shells(material, ratio).at(length / reach * ratio)


# Of the rows at one end of pairs (b,), their horizons (b,), m, and the interfaces that they cross
Limit = Callable[[NDArray[np.int64], NDArray[np.float64], Crossings | None], NDArray[np.float64]]


def fill(model: Model) -> BondSource:
    """The families of the model. Raises ModelError, GridError."""
    law_of(model)
    ratio = model.settings.horizon.ratio
    cost_of = np.array(
        [
            _cost(_unit(model_material), ratio) if model_material.failure in SPENT else np.nan
            for model_material in model.materials
        ]
    )

    def limits(rows: NDArray[np.int64], reach: NDArray[np.float64], crossings: Crossings | None) -> NDArray[np.float64]:
        limit, numbers = np.full_like(reach, np.inf), model.material_of[rows]
        for material_rows, material_of_end in model.materials_at(rows):
            material = material_of_end
            if crossings is not None:
                cut = _cut(_unit(model.materials[numbers[material_rows][0]]), ratio)
                material = crossings.material(material, material_rows, cut)
            spent, far = cost_of[numbers[material_rows]], reach[material_rows]
            near = strength_reach(model, material, rows[material_rows], far)
            if material.failure == "stress":
                limit[material_rows] = material.strength
            elif material.failure == "stretch":
                limit[material_rows] = np.sqrt(material.G0 / (spent * material.E * near))
            elif material.failure == "energy":
                d = dimension_of(material.plane)  # of one stretch, it falls with the square or the cube of the horizon
                limit[material_rows] = material.G0 / (spent * near ** (d + 1)) * (near / far) ** d
            unbreakable_bonds = is_unbreakable(model, material, rows[material_rows], far)
            limit[material_rows] = np.where(unbreakable_bonds, np.inf, limit[material_rows])
        return limit

    return filled(model, limits)


def filled(model: Model, limits: Limit) -> BondSource:
    """The families of a model, whose bonds fail at the mean of the `limits` of the materials of both ends."""
    grid, horizon, area, unbreakable_nodes = model.grid, model.horizons, areas(model, "cells"), unbreakable(model)
    first, full_cells = model.materials[0], whole_cells(model.materials[0])
    margin = 0.0 if full_cells else grid.delta / 2
    neighbours = Neighbours(grid.position, grid.delta, horizon + margin, mutual=True)
    sight, farthest = sight_of(grid, model.name), float((horizon + margin).max())
    interfaces = Interfaces(model) if model.settings.interfaces else None
    has_balanced_influences = first.model == "correspondence"  # that make K alike at all spacings
    largest, d = float(horizon.max()), grid.dimension

    def counts(pairs: Pairs) -> NDArray[np.float64]:
        """Weights (b,) of neighbours at the distances of `pairs`, over their cells."""
        i, j, length = pairs
        reach = (horizon[i] + horizon[j]) / 2
        return _counts(first, model.settings.horizon.ratio, length, reach, grid.delta[i], grid.delta[j])

    def paired_before_balance(rows: NDArray[np.int64]) -> Paired:
        pairs = neighbours.pairs(rows)
        pairs = chosen(pairs, counts(pairs) > ROUND_OFF)
        pairs = chosen(pairs, sight.inside(pairs))
        reach = (horizon[pairs.source] + horizon[pairs.target]) / 2
        crossings = None if interfaces is None else interfaces.crossed(pairs)
        source_limit, target_limit = (limits(end, reach, crossings) for end in (pairs.source, pairs.target))
        limit = source_limit / 2 + target_limit / 2
        weight = counts(pairs._replace(length=sight.apart(pairs, first.detour, farthest)))
        nothing, balance = np.zeros(len(limit)), (largest / reach) ** (d + 2) if has_balanced_influences else 1.0
        return Paired(pairs, weight > ROUND_OFF, nothing, limit, limit, weight * balance * area[pairs.target])

    def is_cut(rows: NDArray[np.int64]) -> NDArray[np.int64]:
        pairs = neighbours.pairs(rows)
        pairs = chosen(pairs, counts(pairs) > ROUND_OFF)
        return pairs.source[~sight.inside(pairs)]

    @cache
    def factors() -> BorderFactors:
        return (
            border_factors(grid, horizon, paired_before_balance, is_cut, area)
            if has_balanced_influences
            else NO_FACTORS
        )

    def paired_of(rows: NDArray[np.int64]) -> Paired:
        paired = paired_before_balance(rows)
        factor = factors().of(paired.pairs.source, paired.pairs.target, len(grid))
        return paired._replace(weight=paired.weight * factor)

    def part(rows: NDArray[np.int64]) -> Part:
        return part_of(grid.position, unbreakable_nodes, rows, paired_of(rows))

    return BondSource(area, part, paired_of, counts)


def _unit(material: Material) -> Material:
    """The material on which the cost of a crack in units of its constants depends."""
    return msgspec.structs.replace(
        material, E=1.0, rho=1.0, G0=1.0, solid="linear", form="total", yield_stress=None, hardening=0.0, alpha=None,
        T0=None, angle=0.0, E2=None, G12=None, E3=None, nu13=None, nu23=None, G13=None, G23=None,
        strength_across=None, shear_strength=None,
    )  # fmt: skip


@lru_cache
def _cut(material: Material, ratio: float) -> Cut:
    """Cuts of a lattice of the material, over the cost of one along a row: the energy of bonds is one number, or grows
    with the square of their length."""
    xi = offsets(ratio + 0.5, dimension_of(material.plane))
    length, ones = lengths(xi), np.ones(len(xi))
    energy = _counts(material, ratio, length, ratio * ones, ones, ones)
    if material.failure == "stretch":
        energy = energy * length**2
    return Cut(xi, energy / (energy * np.abs(xi[:, -1])).sum())


@lru_cache
def _cost(material: Material, ratio: float) -> float:
    """Cost of a crack in units of E horizon s^2, for a failure stretch s.

    For a failure energy w, in units of w horizon^3, in space of w horizon^4.
    """
    size = 1e-6 if material.failure == "stretch" else 1e-12
    dimension = dimension_of(material.plane)
    if dimension == 3:
        model = patch_in_space(material, ratio)
        xi = offsets(ratio + 0.5, 3)
        ones = np.ones(len(xi))
        weight = _counts(material, ratio, lengths(xi), ratio * ones, ones, ones)
        in_family = weight > ROUND_OFF
        bonds = bonds_in_space(model, xi[in_family], weight[in_family], size)
    else:
        model = patch(material, ratio)
        bonds = filled(model, lambda _, reach, __: np.full_like(reach, size)).whole().bonds
    spent = cost(law_of(model), model, bonds)
    return spent / (ratio * size**2) if material.failure == "stretch" else spent / (ratio ** (dimension + 1) * size)
