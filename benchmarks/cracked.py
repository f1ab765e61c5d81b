"""Shipped scenes with cracks, each solved in many ways against uniform runs, cost against error.

Kalthoff and Winkler's experiment against half the spacing, with the steel's own fracture energy against a quarter of
it, and the Duran plate against a quarter. Cracks scatter, so all are medians of several runs, each against a
reference of its own.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.claims import Case
from benchmarks.runs import built
from benchmarks.variants import CRACKED, SIDE_BY_SIDE, Variant
from pdmesh.drawing.additions import ADAPT
from pdpost.measures import tradeoff
from pdsolve.errors import UnstableError
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import run
from pdsolve.run.system import Prepared

RUNS = 5  # of each variant and of the reference
SHORTER = 0.01  # of a step: by so much that of each further run is


class Row(NamedTuple):
    """What a variant cost, and how wrong it is."""

    problem: str
    variant: str
    nodes: int
    bonds: int
    updates: float  # bonds times steps
    wall: float  # s of marching, on all threads
    error: float  # what the chart shows
    errors: dict[str, float]  # all of them
    least: float  # error of the runs that `error` is the median of
    most: float


class Stopped(NamedTuple):
    """A variant one of whose runs had to be stopped."""

    problem: str
    variant: str
    said: str


class Plate(NamedTuple):
    """A shipped scene with cracks, and what it is measured by."""

    name: str
    scene: str
    variants: tuple[Variant, ...]
    finest: float  # m: the spacing that `Variant.fine` is a share of
    reference: float  # share of it that uniform runs with m = 4 have, which errors are against
    mean: Callable[[tradeoff.Errors], float]  # the error that the chart shows

    def model(self, variant: Variant, folder: Path) -> Model:
        """Its model for a variant."""
        fine = variant.fine * self.finest
        parameters: tuple[tuple[str, str], ...] = (("spacing", f"{fine:g}"),)
        if self.scene.endswith(".geo"):
            coarse = variant.ratio * fine
            parameters = (("Zones/fine/Spacing", f"{fine:g}"), ("Zones/coarse/Spacing", f"{coarse:g}"))
        if self.scene == "duran50.geo":  # the same strip of the edge carries the load
            rows = str(round(8e-3 / (variant.ratio * fine)))
            parameters += (("Loads/top/Rows", rows), ("Loads/bottom/Rows", rows))
        if variant.adapt != "none":
            parameters += ((ADAPT, variant.adapt),)
        of = f"{self.name} {variant.ratio} {variant.fine} {variant.m} {variant.adapt}"
        return built(Case(of, "", self.scene, (), parameters=parameters), folder)

    def solved(self, variant: Variant, number: int, folder: Path) -> tuple[Path, Prepared]:
        """The results of a further run by its number, of somewhat shorter steps."""
        shorter = variant._replace(step=variant.step * (1 - SHORTER * number))
        problem = shorter.prepared(self.model(variant, folder))
        path = folder / f"{variant.name} {number}.sqlite"
        run(*problem, path).close()
        return path, problem


def cracks(plate: Plate) -> Iterator[Row | Stopped]:
    """A shipped scene against uniform runs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        finer = Variant("reference", ratio=1, fine=plate.reference, m=4.0)
        references = [plate.solved(finer, number, folder)[0] for number in range(RUNS)]
        for variant in plate.variants:
            try:
                yield _median(plate, variant, references, folder)
            except UnstableError as error:
                yield Stopped(plate.name, variant.name, str(error))


def _median(plate: Plate, variant: Variant, references: list[Path], folder: Path) -> Row:
    """A variant, as often as there are references. Raises UnstableError if one of its runs has to be stopped."""
    costs, found = [], []
    for number, reference in enumerate(references):
        path, problem = plate.solved(variant, number, folder)
        with Results.open(path) as results, Results.open(reference) as expected:
            costs.append(tradeoff.cost(results, path))
            found.append(tradeoff.errors(results, expected))
            nodes = len(results.nodes().ids)
        path.unlink()
    shown = [plate.mean(errors) for errors in found]
    medians = {
        what: float(np.median([getattr(errors, what) for errors in found]))
        for what in tradeoff.Errors._fields
        if all(getattr(errors, what) is not None for errors in found)
    }
    return Row(
        plate.name,
        variant.name,
        nodes,
        problem.system.bonds,
        float(np.median([cost.bond_updates for cost in costs])),
        min(cost.wall_time for cost in costs),
        float(np.median(shown)),
        medians,
        min(shown),
        max(shown),
    )


def of_path(errors: tradeoff.Errors) -> float:
    """How far the crack's path is off."""
    return errors.path or np.nan


PLATES = {
    "kalthoff": Plate("Kalthoff-Winkler", "kalthoff_winkler.geo", CRACKED, 1e-3, 0.5, of_path),
    "steel": Plate("Kalthoff-Winkler, steel", "kalthoff_winkler_steel.py", SIDE_BY_SIDE, 1e-3, 0.25, of_path),
    "duran": Plate("Duran plate", "duran50.geo", CRACKED, 1e-3, 0.25, lambda errors: errors.branching or np.nan),
}
