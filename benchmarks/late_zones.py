"""How often fine zones come too late, and when the first bond breaks: python -m benchmarks.late_zones.

Shipped scenes in motion at four spacings: with a fine zone, and with fine nodes everywhere in steps of several lengths,
by which their first bonds scatter. Writes a section of docs/verification/adaptivity.md.
"""

from __future__ import annotations

import sys
import warnings
from typing import NamedTuple

from benchmarks import pages
from benchmarks.adaptivity import GEOMETRIES, PAGE, STEPS, model, with_run
from pdmesh.drawing.file_reading import file_parameters
from pdsolve import Options, simulate
from pdsolve.adaptivity.hybrid.adaptivity_choice import with_fine_nodes_everywhere
from pdsolve.model import Model

SCENES = (
    "duran50.geo",
    "duran50_one_scale.py",
    "duran_metre.py",
    "figure_18.geo",
    "kalthoff_winkler.geo",
    "kalthoff_winkler_steel.py",
    "oblique_crack.geo",
    "plate_with_hole.geo",
    "soda_lime.geo",
    "v_notch.geo",
)
FACTORS = (2.83, 2.0, 1.41, 1.0)  # times the spacings of the scene
TITLE = "## Zones that come too late"
US = 1e6  # in a second


class Run(NamedTuple):
    """What a run comes to."""

    late: int  # how often its zone came too late
    first: float  # s, when the first bond breaks; 0: none does
    step: float  # s, its time step


def solved(plate: Model) -> Run:
    """A run of a plate."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with simulate(plate, None, Options(threads=1)) as results:
            dt, broken = float(results.meta()["time_step"]), results.breaks().step
    late = sum("too late" in str(warning.message) for warning in said)
    return Run(late, dt * float(broken.min()) if len(broken) else 0.0, dt)


def scaled(file: str, factor: float) -> Model:
    """A scene for a fine zone, with its spacings times a factor."""
    spacings = [one for one in file_parameters(GEOMETRIES / file, trust=True) if one.name.lower().endswith("spacing")]
    return model(file, tuple((one.name, str(factor * float(one.value))) for one in spacings))


def row(file: str, factor: float) -> tuple[str, int]:
    """A line of the table, and how often the zone came too late: each time the run goes back or begins anew."""
    plate = scaled(file, factor)
    hybrid = solved(plate)
    if hybrid.first > 0:
        steps = int(1.5 * hybrid.first / hybrid.step / min(STEPS)) + 20
        firsts = []
        for share in STEPS:
            shorter = with_run(plate, time_step=share * hybrid.step, steps=steps, until=None, every=steps)
            firsts.append(US * solved(with_fine_nodes_everywhere(shorter)).first)
        first = f"{US * hybrid.first:.3f} | {min(firsts):.3f} to {max(firsts):.3f}"
    else:
        first = "none | none"
    return (
        f"| {file} | {factor:g} | {len(plate.grid)} | {hybrid.late} | {first} | {US * hybrid.step:.3f} |",
        hybrid.late,
    )


def main() -> int:
    """Solve, write, say how often; returns 1 where any zone came too late."""
    found = [row(file, factor) for file in SCENES for factor in FACTORS]
    late = sum(count > 0 for _, count in found)
    lines = [
        TITLE,
        "",
        f"Of {len(found)} runs of {len(SCENES)} shipped scenes at {len(FACTORS)} spacings, zones came too late in"
        f" {late}.",
        "The first bond breaks as below, in us; with fine nodes everywhere in time steps of",
        f"{', '.join(f'{share:g}' for share in STEPS)} times that of the zone (`python -m benchmarks.late_zones`).",
        "",
        "| scene | spacings, times its own | nodes | too late | zone, us | fine everywhere, us | step, us |",
        "|---|---|---|---|---|---|---|",
        *(line for line, _ in found),
    ]
    pages.put_section(PAGE, "\n".join(lines))
    print("\n".join(lines))
    return int(late > 0)


if __name__ == "__main__":
    sys.exit(main())
