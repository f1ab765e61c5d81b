"""What it saves and costs to make cells behind crack tips coarse again: python -m benchmarks.wake

The plates of `benchmarks.adaptivity`, with `run.hybrid.wake` `fine` and `lattice` in turn, eight steps each. Writes a
section of `docs/adaptivity.md`.
"""

from __future__ import annotations

import sys
import warnings
from typing import NamedTuple

import msgspec
import numpy as np

from benchmarks.adaptivity import CASES, PAGE, WAKE, Case, angle, model, solved, with_run
from benchmarks.pages import put_section
from pdsolve.model import ModelWarning

SHARES = np.linspace(1, 0.8875, 8)  # of the surely stable step
WAKES = ("fine", "lattice")

TEXT = """{title}

`python -m benchmarks.wake`: {count} steps from {most:g} to {least:g} of the sure one, one thread, `fine` and `lattice`
in turn; the least and the greatest of each.

| plate | wake | fine at the end, % | angle, degrees | dissipated, J/m | made by cells, J/m | CPU of the loop, s |
|---|---|---|---|---|---|---|
{rows}
"""


class Run(NamedTuple):
    """What one run came to."""

    fine: float  # %
    angle: float  # degrees
    dissipated: float  # J/m
    made: float  # J/m
    cpu: float  # s


def compared(case: Case) -> list[str]:
    """Rows of the table."""
    plate, found = model(case.file, case.assignments), {wake: [] for wake in WAKES}
    for share in SHARES:
        for wake, runs in found.items():
            hybrid = msgspec.structs.replace(plate.settings.run.hybrid, wake=wake)
            one = solved(with_run(plate, hybrid=hybrid), "hybrid", share, case.duration, case.box)
            runs.append(
                Run(100 * one.fine, angle(one) if case.turns else np.nan, one.dissipated, one.refinement, one.cpu)
            )
            print(wake, runs[-1], file=sys.stderr, flush=True)
    return [
        f"| {case.title} | {wake} | {' | '.join(map(_range, zip(*runs, strict=True)))} |\n"
        for wake, runs in found.items()
    ]


def _range(values: tuple[float, ...]) -> str:
    return "-" if np.isnan(values).any() else f"{min(values):.3g} to {max(values):.3g}"


def main() -> int:
    """Measure and write the section."""
    warnings.simplefilter("ignore", ModelWarning)
    rows = "".join(row for case in CASES for row in compared(case))
    words = {"title": WAKE, "count": len(SHARES), "most": SHARES[0], "least": SHARES[-1], "rows": rows}
    put_section(PAGE, TEXT.format(**words))
    return 0


if __name__ == "__main__":
    sys.exit(main())
