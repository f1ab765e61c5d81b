"""Strain and stress at the nodes: the gradient of the displacement fitted to each family's intact bonds.

The gradient H of a node is the weighted least-squares fit of eta = H xi to its bonds: xi is the bond, eta the
difference of the displacements, the weight the neighbour's area (in a body its volume) over |xi|. The fit is exact for
affine displacements, at edges too; of bodies that heat for quadratic ones, as these bend most at edges. Strain is
Green's, 1/2 (H + H^T + H^T H), which is zero for a rotated piece. Stress follows from it, less the strain of heat, by
Hooke's law with the model's Poisson's ratio. Cut and broken bonds do not count. A node without bonds, or with bonds
along one line (in a body in one plane) only, has strain NaN.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material, Region
from pdmesh.model.material_constants import poisson
from pdmesh.model.neighbours import tree_of
from pdmesh.model.node_arrays import selected
from pdmesh.model.node_fields import NodeField, columns_of, with_field
from pdmesh.model.orthotropic import ORTHOTROPIC, WIDTH, engineering_constants, stiffness
from pdsolve.fracture.gradients import Stiffness, curved_gradients_of, gradients_of
from pdsolve.measures.embedded_model import physics_of, read
from pdsolve.measures.frame_steps import scalar, vector
from pdsolve.results import Families, Results, ResultsError


class _MaterialGridFileKeys(msgspec.Struct):
    """The keys of the grid file that stress needs."""

    material: Material
    regions: tuple[Region, ...] = ()
    fields: tuple[NodeField, ...] = ()


def displacement_gradients(results: Results, step: int) -> NDArray[np.float64]:
    """The displacement gradient (n, d, d) of a frame, H[i, a, b] = du_a / dx_b; NaN where it is undefined.

    Raises ResultsError if the frame does not hold the displacement.
    """
    families = families_without_broken_bonds(results, results.families(step), step)
    nodes, u = results.nodes(step), vector(results, "displacement", step)
    if physics_of(results) == "thermoelastic":
        return curved_gradients_of(nodes.position, nodes.area, u, *families)
    return gradients_of(nodes.position, nodes.area, u, *families)


def families_without_broken_bonds(results: Results, families: Families, step: int) -> Families:
    """The bonds of `families` that are not broken after `step`."""
    unbroken = ~bonds_are_broken(results, families, step)
    count = len(families.start) - 1
    row = np.repeat(np.arange(count), np.diff(families.start))
    start = np.concatenate([[0], np.cumsum(np.bincount(row[unbroken], minlength=count))])
    return Families(start, families.neighbour[unbroken])


def bonds_are_broken(results: Results, families: Families, step: int) -> NDArray[np.bool_]:
    """Whether each bond (b,) of `families` is broken after `step`; its two directions are separate entries."""
    node, neighbour, _ = broken_bond_ends_and_steps(results, step)
    count = len(families.start) - 1
    torn = np.zeros(count, dtype=bool)
    torn[node] = True
    bonds = np.flatnonzero(np.repeat(torn, np.diff(families.start)))
    bond_node = np.searchsorted(families.start, bonds, side="right") - 1
    broken_mask = np.zeros(len(families.neighbour), dtype=bool)
    broken_mask[bonds] = np.isin(bond_node * count + families.neighbour[bonds], node * count + neighbour)
    return broken_mask


def broken_bond_ends_and_steps(
    results: Results, step: int, with_bonds_before_birth: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Rows (b,) of both end nodes at `step` of the bonds broken until then, and the steps in which they broke.

    Bonds that broke before one of their nodes was born belong to no present family: left out, unless
    `with_bonds_before_birth`.
    """
    breaks, lives, rows = results.breaks(), results.lives(), results.rows(step)
    node_rows = lives.at(breaks.node, step)
    neighbour_rows = lives.at(breaks.neighbour, step)
    present = (breaks.step <= step) & (node_rows >= 0) & (neighbour_rows >= 0)
    if not with_bonds_before_birth:
        present &= breaks.step >= lives.birth[node_rows]
    return (
        np.searchsorted(rows, node_rows[present]),
        np.searchsorted(rows, neighbour_rows[present]),
        breaks.step[present],
    )


def elastic_constants_of_nodes(results: Results, step: int) -> Stiffness:
    """Elastic constants of the nodes at `step`. Raises ResultsError.

    A node that was born later has the material of the nearest initial node.
    """
    of_nodes, materials, number = materials_of_nodes(results, step)
    elastic = Stiffness(of_nodes("E"), of_nodes("nu"), materials[0].plane)
    if all(material.solid != ORTHOTROPIC for material in materials):
        return elastic
    C = np.full((len(number), WIDTH), np.nan)
    for at, material in enumerate(materials):
        if material.solid == ORTHOTROPIC:
            own = number == at
            constants = engineering_constants(material)._replace(E1=elastic.E[own], nu12=elastic.nu[own])
            C[own] = stiffness(constants, of_nodes("angle")[own])
    return elastic._replace(C=C)


def thermal_strain_of_nodes(results: Results, step: int) -> NDArray[np.float64]:
    """The strain (n,) of free nodes at `step`, alpha (T - T0); 0 in a model of mechanics alone.

    Raises ResultsError if the frame holds neither the temperature, T, nor the concentration, c.
    """
    if physics_of(results) != "thermoelastic":
        return np.zeros(len(results.rows(step)))
    content = next((name for name in ("T", "c") if name in results.stored(step)), None)
    if content is None:
        raise ResultsError(
            f"{results.name} has no field 'T' or 'c' at step {step}; solve it with one (pdsolve --fields +T, or +c)"
        )
    of_nodes, _ = constants_of_nodes(results, step)
    return np.asarray(of_nodes("alpha") * (results.field(content, step).astype(float) - of_nodes("T0")))


def stress_work_if_yielded(results: Results, step: int) -> NDArray[np.float64] | None:
    """Work of the stress on the nodes (n,) until `step`, J/m^3, where some have flowed; else None.

    It is the elastic energy of the stress, and the yield stress times the plastic strain. Raises ResultsError if the
    frame lacks the plastic strain of a plastic solid, or the stress.
    """
    of_nodes, materials = constants_of_nodes(results, step)
    if not any(material.solid == "j2" for material in materials):
        return None
    alpha = scalar(results, "plastic", step)
    if not (alpha > 0).any():
        return None
    E, yields, hardening = (of_nodes(name) for name in ("E", "yield_stress", "hardening"))
    nu = of_nodes("nu")
    names = ("sxx", "syy", "szz", "sxy", "sxz", "syz")[: 6 if results.dimension == 3 else 4]
    s = np.array([results.field(name, step).astype(float) for name in names])
    squared = (s[:3] ** 2).sum(axis=0) + 2 * (s[3:] ** 2).sum(axis=0)
    elastic = ((1 + nu) * squared - nu * s[:3].sum(axis=0) ** 2) / (2 * E)
    return np.asarray(elastic + alpha * (yields + hardening * alpha / 2))


def constants_of_nodes(
    results: Results, step: int
) -> tuple[Callable[[str], NDArray[np.float64]], tuple[Material, ...]]:
    """The function that returns a constant (n,) of the nodes at `step`, by its name, and the materials.

    It is that of the node's material or of the field in its place. Raises ResultsError.
    """
    of_nodes, materials, _ = materials_of_nodes(results, step)
    return of_nodes, materials


def is_orthotropic(results: Results) -> bool:
    """Whether a material of the run is orthotropic, so that stress intensities of isotropic fields have no meaning."""
    model = read(results, _MaterialGridFileKeys)
    return any(one.solid == ORTHOTROPIC for one in (model.material, *(region.material for region in model.regions)))


def materials_of_nodes(
    results: Results, step: int
) -> tuple[Callable[[str], NDArray[np.float64]], tuple[Material, ...], NDArray[np.int64]]:
    """As `constants_of_nodes`, and the number of the material of each node (n,)."""
    model, nodes = read(results, _MaterialGridFileKeys), results.nodes(0)
    varies = bool(model.regions or model.fields)
    which = np.zeros(len(nodes.ids if varies else results.rows(step)), dtype=np.int64)
    for number, region in enumerate(model.regions):
        which[selected(nodes, region.nodes, region.box)] = number + 1
    rows = np.arange(len(which))
    if varies and results.epoch(step):
        rows = np.asarray(tree_of(nodes.position).query(results.nodes(step).position)[1])
    materials, fields = (model.material, *(region.material for region in model.regions)), model.fields

    def of_nodes(name: str) -> NDArray[np.float64]:
        values = np.array([poisson(m) if name == "nu" else getattr(m, name) or 0.0 for m in materials])[which[rows]]
        return with_field(columns_of(fields, len(which)), name, values, rows) if fields else values

    return of_nodes, materials, which[rows]
