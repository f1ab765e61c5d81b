"""The operator of the current leaves."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree.incremental_bonds import LeafBonds
from pdsolve.adaptivity.quadtree.tree import Quadtree, QuadtreeCells
from pdsolve.bonds.assembly import Scheme
from pdsolve.checkpoint_validation import entry
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.zone.refusals import check_one_spacing, create_unsupported_error
from pdsolve.zone.summary import ZoneSummary

ON = 1e-6  # of a spacing: a pre-crack this near to a node passes through it
# Of the sure step of the grid that is there, over the times its cells are halved: what is left at borders between
# sizes, where a node's few large neighbours pull more
SURE = {"conservative": 0.9, "thesis": 0.6}


class LeafHistory(NamedTuple):
    """History of n leaves."""

    checks_below_threshold: NDArray[np.int64]  # (n,) looks that each has been calm for, the latest ones
    refinement_energy: float  # J/m: energy that splitting and merging have made so far


class QuadtreeOperator(BondList):
    """The operator of some leaves of a tree."""

    def __init__(
        self, tree: Quadtree, cells: QuadtreeCells, model: Model, leaf_bonds: LeafBonds, scheme: Scheme, threads: int
    ) -> None:
        """`model` is the model of the leaves, `leaf_bonds` are its bonds."""
        law = law_of(model, scheme.matches_work)
        super().__init__(law, model, leaf_bonds.assembly.bonds, scheme.symmetric, "float64", threads)
        self.tree, self.cells, self.leaf_bonds = tree, cells, leaf_bonds
        self.all_bonds = leaf_bonds.assembly.bonds  # including broken ones
        self.history = LeafHistory(np.zeros(len(cells.root_row), dtype=np.int64), 0.0)
        area = leaf_bonds.assembly.area
        self._fine = float(area[cells.level > 0].sum() / area.sum())

    def zone_summary(self) -> ZoneSummary:
        """Summary of the finer cells."""
        return ZoneSummary(self.history.refinement_energy, self._fine, 0.0)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Bond history for a checkpoint, and for how long each cell has been calm."""
        return {
            **super().checkpoint_arrays(),
            "calm": self.history.checks_below_threshold.copy(),
            "made": np.array([self.history.refinement_energy]),
        }


def read_leaf_history(checkpoint: CheckpointArrays, leaf_count: int) -> LeafHistory:
    """The history stored by `QuadtreeOperator.checkpoint_arrays` for so many leaves. Raises CheckpointError."""
    return LeafHistory(
        entry(checkpoint, "calm", (leaf_count,), np.int64, 0).copy(), float(entry(checkpoint, "made", (1,), float)[0])
    )


def create_quadtree(model: Model) -> Quadtree:
    """The cells of a model. Raises ModelError, in one sentence, for an unsupported model."""
    check_one_spacing(model)
    tree = Quadtree(replace_boxes_by_node_ids(model))
    _raise_if_precrack_meets_splittable_node(tree)
    return tree


def replace_boxes_by_node_ids(model: Model) -> Model:
    """The model with boxes replaced by the ids of their nodes, so that nodes created later are in none."""

    def replace_box_by_ids(selection):  # type: ignore[no-untyped-def]
        if selection.box is None:
            return selection
        return msgspec.structs.replace(
            selection, nodes=tuple(model.grid.ids[model.selected(selection)].tolist()), box=None
        )

    settings = model.settings
    conditions, regions = (tuple(map(replace_box_by_ids, every)) for every in (settings.conditions, settings.regions))
    settings = msgspec.structs.replace(settings, conditions=conditions, regions=regions)
    return Model(model.grid, settings, model.name)


def _raise_if_precrack_meets_splittable_node(tree: Quadtree) -> None:
    """Raise ModelError if a pre-crack passes through a node that splitting could create."""
    cracks = tree.model.grid.cracks.reshape(-1, 2, 2)
    if not len(cracks):
        return
    import shapely

    lines, cells = shapely.linestrings(cracks), tree.roots()
    for _ in range(tree.levels):
        cells = cells.quarters()
        near = shapely.dwithin(shapely.points(tree.centres(cells)), shapely.multilinestrings(cracks), tree.spacing)
        cells = tree.select_cells_with_area(cells.select(near))
        place = shapely.points(tree.centres(cells))
        for number, line in enumerate(lines):
            hit = shapely.dwithin(place, line, ON * tree.spacing)
            if hit.any():
                x, y = tree.centres(cells.select(hit))[0]
                raise create_unsupported_error(
                    tree.model,
                    f"$.notch[{number}]",
                    f"at ({x:.6g}, {y:.6g}) m, where splitting makes a node",
                    "a place between all nodes, as in the middle between two rows",
                )
