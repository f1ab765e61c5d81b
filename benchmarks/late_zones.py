"""How often fine zones come too late, and when the first bond breaks: python -m benchmarks.late_zones.

Shipped scenes in motion at four spacings: with a fine zone, and with fine nodes everywhere in steps of several lengths,
by which their first bonds scatter. Writes a table of docs/verification/adaptivity.md.
"""

from __future__ import annotations

import sys
import warnings
from typing import NamedTuple

from benchmarks.adaptivity import PAGE, STEPS, hybrid_model
from benchmarks.models import GEOMETRIES, with_run
from benchmarks.pages import markdown_table, write_block
from pdmesh.drawing.file_reading import file_parameters
from pdsolve import Options, simulate
from pdsolve.adaptivity.hybrid.adaptivity_choice import with_fine_nodes_everywhere
from pdsolve.model import Model

SCENES = (
    *("duran50.geo", "duran50_one_scale.py", "duran_metre.py", "figure_18.geo", "kalthoff_winkler.geo"),
    *("kalthoff_winkler_steel.py", "oblique_crack.geo", "plate_with_hole.geo", "soda_lime.geo", "v_notch.geo"),
)
FACTORS = (2.83, 2.0, 1.41, 1.0)  # times the spacings of the scene
US = 1e6  # in a second


class Run(NamedTuple):
    """What a run comes to."""

    late: int  # how often its zone came too late
    first: float  # s, when the first bond breaks; 0: none does
    step: float  # s, its time step


def solved(plate: Model) -> Run:
    """A run of a plate."""
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always")
        with simulate(plate, None, Options(threads=1)) as results:
            dt, broken = float(results.meta()["time_step"]), results.breaks().step
    late = sum("too late" in str(warning.message) for warning in issued)
    return Run(late, dt * float(broken.min()) if len(broken) else 0.0, dt)


def scaled(file: str, factor: float) -> Model:
    """A scene for a fine zone, with its spacings times a factor."""
    parameters = file_parameters(GEOMETRIES / file, trust=True)
    spacings = [parameter for parameter in parameters if parameter.name.lower().endswith("spacing")]
    return hybrid_model(file, tuple((spacing.name, str(factor * float(spacing.value))) for spacing in spacings))


def row(file: str, factor: float) -> list[str | int]:
    """A line of the table; its fourth cell is how often the zone came too late: the run goes back or begins anew."""
    plate = scaled(file, factor)
    hybrid = solved(plate)
    first = uniform = "none"
    if hybrid.first > 0:
        steps = int(1.5 * hybrid.first / hybrid.step / min(STEPS)) + 20
        firsts = []
        for share in STEPS:
            shorter = with_run(plate, time_step=share * hybrid.step, steps=steps, until=None, every=steps)
            firsts.append(US * solved(with_fine_nodes_everywhere(shorter)).first)
        first, uniform = f"{US * hybrid.first:.3f}", f"{min(firsts):.3f} to {max(firsts):.3f}"
    return [file, f"{factor:g}", len(plate.grid), hybrid.late, first, uniform, f"{US * hybrid.step:.3f}"]


def block(rows: list[list[str | int]]) -> str:
    """The table of the page, and how many zones came too late."""
    header = ["scene", "spacings, times its own", "nodes", "too late", "zone, us", "fine everywhere, us", "step, us"]
    return (
        f"Of {len(rows)} runs of {len(SCENES)} shipped scenes at {len(FACTORS)} spacings, zones came too late in"
        f" {sum(row[3] != 0 for row in rows)}.\nThe first bond breaks as below, in us; with fine nodes everywhere in"
        f" time steps of\n{', '.join(f'{share:g}' for share in STEPS)} times that of the zone"
        f" (`python -m benchmarks.late_zones`).\n\n{markdown_table(header, rows)}"
    )


def main() -> int:
    """Solve, write; returns 1 where any zone came too late."""
    rows = [row(file, factor) for file in SCENES for factor in FACTORS]
    write_block(PAGE, "late zones", block(rows))
    print(block(rows))
    return int(any(row[3] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
