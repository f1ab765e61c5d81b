"""How far the bonds of softening materials have separated, from the stretches in the frames of a run in load steps.

A cohesive crack ends where its faces transmit no more stress, and its process zone reaches ahead of this place to where
the stress is the strength; A. Hillerborg, M. Modeer, P.-E. Petersson, Cem. Concr. Res. 6 (1976) 773-781. A bond has
separated by the share of its energy that it has dissipated, 1 once it is broken, as a brittle bond is at once. The
separation of a node is the mean over its bonds. A node is cracked where bonds that lie across a crack have dissipated
nearly all of their energy.

The stretches are those of the frames, so that a load step between two frames does not count. In motion the frames are
too far apart for that, and broken bonds alone count there.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.cohesive_softening import AREA, DECAYS, critical_opening, first_stretch
from pdmesh.model.document import Horizon
from pdmesh.model.lattice_calibration import calibration, has_partial_cells
from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.node_fields import NodeField
from pdsolve.measures.embedded_model import at_rest, physics_of, read
from pdsolve.measures.frame_steps import vector
from pdsolve.measures.strain import materials_of_nodes
from pdsolve.results import Results

KINK = 2 / 9  # opening over w_c at which the bilinear curve bends
LAWS = ("cohesive", "bilinear")


class SeparationHistory(NamedTuple):
    """The separation of nodes in frames."""

    step: NDArray[np.int64]  # (t,) of the frames
    separation: NDArray[np.float32]  # (t, n), which never decreases

    def at(self, step: int) -> NDArray[np.float64]:
        """The separation (n,) in the last frame until `step`."""
        row = int(np.searchsorted(self.step, step, side="right")) - 1
        return np.asarray(self.separation[max(row, 0)], dtype=np.float64)


class _SofteningGridFileKeys(msgspec.Struct):
    """The keys of the grid file that softening needs."""

    horizon: Horizon = Horizon()
    fields: tuple[NodeField, ...] = ()


def separation_history(results: Results) -> SeparationHistory | None:
    """The separation of the nodes in all frames; None where broken bonds tell as much, or frames lack displacements.

    This is so of materials that do not soften, in motion, and where strengths are given by node.
    """
    if results.dimension != 2 or physics_of(results) != "mechanics" or not at_rest(results):
        return None
    if len(results.epochs()) > 1:
        return None
    model, steps = read(results, _SofteningGridFileKeys), results.frames()[0]
    if model.fields or not len(steps) or not all({"ux", "uy"} <= set(results.stored(step)) for step in steps.tolist()):
        return None
    _, materials, number = materials_of_nodes(results, 0)
    if not any(_softens(material) for material in materials):
        return None
    known_history = results.decoded.get(SeparationHistory)
    if isinstance(known_history, SeparationHistory) and np.array_equal(known_history.step, steps):
        return known_history
    history = SeparationHistory(steps, _separations(results, steps, materials, number, model.horizon.ratio))
    results.decoded[SeparationHistory] = history
    return history


def _softens(material: Material) -> bool:
    return material.model == "bond" and material.law in LAWS and not (material.law == "bilinear" and material.kr == 1)


def _separations(
    results: Results,
    steps: NDArray[np.int64],
    materials: tuple[Material, ...],
    number: NDArray[np.int64],
    ratio: float,
) -> NDArray[np.float32]:
    """The separation (t, n) of the nodes, pre-cracks included."""
    families, nodes = results.families(0), results.nodes(0)
    source = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    xi = nodes.position[families.neighbour] - nodes.position[source]
    length = np.hypot(*xi.T)
    stretch, count = np.zeros(len(source)), np.maximum(nodes.family, 1)
    limits = [_limits(material, ratio, ratio * nodes.delta) for material in materials]
    separation = np.empty((len(steps), len(nodes.ids)), dtype=np.float32)
    for row, step in enumerate(steps.tolist()):
        u = vector(results, "displacement", step)
        np.maximum(stretch, np.hypot(*(xi + u[families.neighbour] - u[source]).T) / length - 1, out=stretch)
        share = np.zeros(len(source))
        for at, (material, (peak, end)) in enumerate(zip(materials, limits, strict=True)):
            own = np.flatnonzero(number[source] == at)
            if _softens(material):
                first, last = peak[source[own]], end[source[own]]
                if material.law == "cohesive":
                    last = first + last / length[own]
                share[own] = dissipated_share(material, stretch[own], first, last)
        separation[row] = (nodes.cut + np.bincount(source, share, minlength=len(nodes.ids))) / count
    return separation


def _limits(material: Material, ratio: float, horizon: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """The stretch (n,) at which bonds begin to soften, and the opening, m, or stretch at which they are gone."""
    if material.law == "cohesive":
        return np.full(len(horizon), first_stretch(material)), critical_opening(material, ratio, horizon)
    factor = calibration(ratio, material, has_partial_cells(material)).stretch
    critical = factor * critical_stretch(material, horizon)
    if material.keep_G0:
        return critical / np.sqrt(material.kr), critical * np.sqrt(material.kr)
    return critical / material.kr, critical


def dissipated_share(
    material: Material, stretch: NDArray[np.float64], peak: NDArray[np.float64], limit: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share (b,) of its energy that a bond has dissipated whose largest stretch is `stretch`; 1 where it is gone."""
    t = np.clip((stretch - peak) / (limit - peak), 0.0, 1.0)
    if material.law == "bilinear" or material.shape == "linear":
        return t
    if material.shape == "bilinear":
        steep = np.minimum(t, KINK)
        curve = np.maximum(1 - 3 * t, 3 / 7 * (1 - t))
        area = steep - 1.5 * steep**2 + 3 / 14 * ((1 - steep) ** 2 - (1 - t) ** 2)
    else:
        left = np.exp(-DECAYS)
        curve = (np.exp(-DECAYS * t) - left) / (1 - left)
        area = ((1 - np.exp(-DECAYS * t)) / DECAYS - left * t) / (1 - left)
    largest_stretch = peak + t * (limit - peak)
    total = peak + 2 * (limit - peak) * AREA[material.shape]
    return np.asarray((peak + 2 * (limit - peak) * area - curve * largest_stretch) / total)
