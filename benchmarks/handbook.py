"""Stress intensities of cracked plates against the handbook's: python -m benchmarks.handbook

Solves the plates of `specimens.py` and writes the tables of `docs/verification/stress_intensity.md`, ours over theirs.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import msgspec
import numpy as np

from benchmarks import ties
from benchmarks.pages import DOCS, markdown_table, write_block
from benchmarks.specimens import HORIZON, SPECIMENS, UNIT, WIDE, Specimen
from pdmesh.model.document import Horizon
from pdsolve.measures.stress_intensities import TipIntensityHistory, follow_tip_intensities
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

SHORT = 3.0  # spacings: the horizon that is shown beside
PAGE = DOCS / "verification" / "stress_intensity.md"


class Row(NamedTuple):
    """A plate, ours over the handbook's."""

    specimen: Specimen
    nodes: int
    K1: float
    ends: tuple[float, float]  # of three rings
    K2: float | None
    from_J: float

    @property
    def intensities(self) -> str:
        """Over those of the formula, as text."""
        return f"{self.K1:.4f}" if self.K2 is None else f"{self.K1:.4f}, {self.K2:.4f}"


def row(specimen: Specimen, wide: int = WIDE, horizon: float = HORIZON) -> Row:
    """Solve a plate; of several tips, the one that is furthest off."""
    case = specimen.case(wide)
    settings = msgspec.structs.replace(case.model.settings, horizon=Horizon(horizon))
    with simulate(Model(case.model.grid, settings), None, Options(threads=1)) as results:
        tips = follow_tip_intensities(results, [1])

    def off(tip: TipIntensityHistory) -> float:
        return float(abs(tip.value["K1"][0] / case.K1 - 1))

    tip = max(tips, key=off)
    first, low, high = (float(side["K1"][0]) / case.K1 for side in (tip.value, tip.low, tip.high))
    second = float(tip.value["K2"][0]) / case.K2 if case.K2 else None
    whole = float(np.sqrt(tip.value["J"][0] * UNIT.E) / np.hypot(case.K1, case.K2))
    return Row(specimen, len(case.model.grid), first, (low, high), second, whole)


def cells(measured: Row, shorter: Row) -> list[str]:
    """A line of the table, with the row of a shorter horizon."""
    specimen, (low, high) = measured.specimen, measured.ends
    kinds = "K1" if measured.K2 is None else "K1, K2"
    ours = [f"**{measured.intensities}**", f"{low:.4f} to {high:.4f}", f"{measured.from_J:.4f}", shorter.intensities]
    return [specimen.name, specimen.source, str(measured.nodes), kinds, *ours]


def main() -> int:
    """Write the tables."""
    rows = []
    for specimen in SPECIMENS:
        rows.append(cells(row(specimen), row(specimen, horizon=SHORT)))
        print(rows[-1], file=sys.stderr)
    header = ["plate", "formula", "nodes", "K", "ours", "rings", "from J", f"horizon {SHORT:g}"]
    write_block(PAGE, "plates", markdown_table(header, rows))
    write_block(PAGE, "ties", ties.table())
    return 0


if __name__ == "__main__":
    sys.exit(main())
