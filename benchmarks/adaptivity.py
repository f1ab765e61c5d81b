"""What a fine zone that moves costs, and what it is off by: python -m benchmarks.adaptivity [--finer] [--repeat N].

Kalthoff and Winkler's plate of steel and Duran's of glass, uniform and hybrid on one lattice, one thread each. Cost:
CPU time of the loop, both in turn, the least of N. Error: the mean distance of the crack's path from those of uniform
runs, over the length of the path, and the time of the first bond, for four steps, as a crack is known no better than
runs that differ by the step alone differ from each other. And all shipped scenes, once. Writes
docs/verification/adaptivity.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
import warnings
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks import pages, split
from benchmarks.runs import PLATES
from pdmesh.drawing.additions import ADAPT
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.possible import impossible
from pdmesh.scene.shapes import SceneError
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.measures import compute_energy_balance_row, compute_node_damage
from pdsolve.run.node_changes import find_zone_change_since_last_call
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import required_adaptation

ROOT = Path(__file__).parent.parent
GEOMETRIES = ROOT / "geometries"
PAGE = ROOT / "docs" / "verification" / "adaptivity.md"
STEPS = (1.0, 0.9625, 0.925, 0.8875)  # of the surely stable step: ratios of 0.80, 0.77, 0.74 and 0.71
OTHERS = (  # sections that stay: of another command, and measured with version 1.0.0
    split.TITLE,
    "## Fine zones of all kinds on the same scenes",
    "## The first bond",
    "## Zones that come too late",
    "## Removed after version 1.0.0",
    "## What the seam of a body sends back",
    "## What a fine zone saves in a body",
)
CRACKED = 0.35  # damage of a node on the path
LOOK = 100  # steps between two looks


class Case(NamedTuple):
    """A scene at a spacing."""

    title: str
    file: str
    assignments: tuple[tuple[str, str], ...]
    duration: float  # s
    box: tuple[float, float, float, float]  # where its path is compared, m
    turns: bool  # whether the angle of its path means something
    finer: bool  # whether it is one for which one has to wait


CASES = (
    *(
        Case(
            f"Kalthoff and Winkler's steel, {1e3 * h:g} mm between nodes",
            "kalthoff_winkler_steel.py",
            (("spacing", str(h)),),
            86e-6,
            (0.05, 0.1262, 1.0, 0.185),
            True,
            h < 5e-4,
        )
        for h in (5e-4, 2.5e-4)
    ),
    Case(
        "Duran's glass, 0.25 mm between nodes",
        "duran50.geo",
        (("Zones/fine/Spacing", "2.5e-4"), ("Zones/coarse/Spacing", "5e-4")),
        40e-6,
        (0.0505, -1.0, 0.068, 1.0),
        False,
        False,
    ),
)


class Found(NamedTuple):
    """What one run came to."""

    adapt: str
    share: float  # of the step
    cpu: float  # s, of the loop
    steps: int
    first: float  # s, of the first bond
    path: NDArray[np.float64]  # (k, 2) m, cracked nodes
    dissipated: float  # J/m
    damped: float  # J/m
    balance: float
    begins: float  # share of the plate that is fine at the start
    fine: float  # at the end
    clipped: float  # over what breaks or softens a bond
    refinement: float  # J/m, made by changes of cells


def model(file: str, assignments: tuple[tuple[str, str], ...] = ()) -> Model:
    """A shipped scene, as it is built for a fine zone that moves."""
    built = build_file(GEOMETRIES / file, [(ADAPT, "hybrid"), *assignments], trust=True)
    return Model(built.grid, built.settings, file)


def with_run(plate: Model, **changes: object) -> Model:
    """The same with other settings of the run."""
    run = msgspec.structs.replace(plate.settings.run, **changes)
    return dataclasses.replace(plate, settings=msgspec.structs.replace(plate.settings, run=run))


def solved(
    plate: Model, adapt: str, share: float | None = None, duration: float = 0.0, box: tuple[float, ...] | None = None
) -> Found:
    """One run, with its step that share of the surely stable one; None: as the scene says."""
    plate = with_run(plate, adapt=adapt)
    if share is not None:
        step = share * prepare(with_run(plate, time_step=None), Options(threads=1)).system.stable_time_step
        plate = with_run(plate, time_step=step, steps=round(duration / step))
    (system, state), steps = prepare(plate, Options(threads=1)), plate.settings.run.steps
    begins = system.zone_summary.fine_share if system.zone_summary else 1.0
    splits = required_adaptation(system)
    began, done = time.thread_time(), 0
    while done < steps:
        change = splits.change_nodes(system, state, done) if splits else None
        system, state = (system, state) if change is None else (change.system, change.state)
        last = min(done + (splits.steps_between_checks if splits else LOOK), steps)
        system.stepper.advance(state, done + 1, last + 1)
        done = last
    cpu = time.thread_time() - began
    change = find_zone_change_since_last_call(system) if system.moving_zone_operator else None
    system, state = (system, state) if change is None else (change.system, change.state)
    broken, energies = system.operator.broken(), compute_energy_balance_row(system, state, steps)
    cracked = system.model.grid.position[compute_node_damage(system, broken) > CRACKED]
    if box is not None:
        cracked = cracked[((cracked > box[:2]) & (cracked < box[2:])).all(axis=1)]
    return Found(
        adapt,
        share or 0.0,
        cpu,
        steps,
        float(broken.step.min(initial=np.iinfo(np.int64).max)) * system.time_step if len(broken.step) else np.nan,
        cracked,
        energies.dissipated,
        energies.damped,
        energies.balance_error(system.initial_energy),
        begins,
        energies.fine_share,
        energies.clipped_stretch,
        energies.refinement,
    )


def distance(one: Found, other: Found) -> float:
    """Mean two-way distance of two paths over their length."""
    apart = np.hypot(*(one.path[:, None] - other.path[None]).T)
    length = float(np.hypot(*np.ptp(other.path, axis=0)))
    return float((apart.min(axis=0).mean() + apart.min(axis=1).mean()) / 2) / length


def angle(found: Found) -> float:
    """Of the path to the notch, degrees, through its nodes."""
    x, y = found.path.T
    slope = np.polyfit(y - y.mean(), x - x.mean(), 1)[0]
    return float(np.degrees(np.arctan2(1, slope)))


def compared(case: Case, repeat: int) -> str:
    """A section of the page: one scene at one spacing."""
    plate = model(case.file, case.assignments)
    runs: dict[str, list[Found]] = {"none": [], "hybrid": []}
    for share in STEPS:
        for adapt, found in runs.items():
            found.append(solved(plate, adapt, share, case.duration, case.box))
            print(found[-1]._replace(path=found[-1].path[:0]), file=sys.stderr, flush=True)
    cpu = {adapt: [found[0].cpu] for adapt, found in runs.items()}
    for _ in range(repeat - 1):
        for adapt, times in cpu.items():
            times.append(solved(plate, adapt, STEPS[0], case.duration).cpu)
    least = {adapt: min(times) for adapt, times in cpu.items()}
    lines = [
        f"## {case.title}: {len(plate.grid)} nodes",
        "",
        f"CPU time of the loop, least of {repeat} in turn, one thread: uniform {least['none']:.2f} s, hybrid"
        f" {least['hybrid']:.2f} s, **{least['none'] / least['hybrid']:.1f} times**.",
        "",
        "| run | step / sure step | first bond, us | angle of the path, degrees | path off the uniform runs', % |"
        " dissipated, J/m | balance, % of the work | fine at the end, % | clipped bonds, of s0 |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for adapt, founds in runs.items():
        for found in founds:
            others = [other for other in runs["none"] if other is not found]
            off = np.mean([distance(found, other) for other in others])
            turned = f"{angle(found):.1f}" if case.turns else "-"
            lines.append(
                f"| {'uniform' if adapt == 'none' else adapt} | {found.share:g} | {1e6 * found.first:.2f} |"
                f" {turned} | {100 * off:.1f} | {found.dissipated:.4g} | {100 * found.balance:+.2f} |"
                f" {100 * found.fine:.1f} | {found.clipped:.2f} |"
            )
    return "\n".join([*lines, ""])


def scenes() -> str:
    """A section of the page: all shipped scenes of bonds in motion, once each, as they are drawn."""
    lines = [
        "## All shipped scenes of bonds in motion",
        "",
        "Each scene is built by `pdmesh build SCENE --adapt hybrid`, with its finest spacing. The uniform run has the"
        " same nodes.",
        "",
        "| scene | nodes | fine at the start, end, % | first bond, us: uniform, hybrid | dissipated, J/m | CPU of the"
        " loop, s | balance, % of the work | clipped bonds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for path in PLATES:
        plate = _taken(path.name)
        if plate is None:
            continue
        one, other = (solved(plate, adapt) for adapt in ("none", "hybrid"))
        print(path.name, other._replace(path=other.path[:0]), file=sys.stderr, flush=True)
        lines.append(
            f"| {path.name} | {len(plate.grid)} | {100 * other.begins:.1f}, {100 * other.fine:.1f} |"
            f" {_time(one)}, {_time(other)} | {one.dissipated:.4g}, {other.dissipated:.4g} | {one.cpu:.2f},"
            f" {other.cpu:.2f} | {100 * other.balance:+.3f} | {other.clipped:.2f} |"
        )
    return "\n".join([*lines, ""])


def _taken(file: str) -> Model | None:
    """A scene as a fine zone that moves takes it; None if it does not."""
    try:
        plate = model(file)
    except SceneError:
        return None
    with_zone, run = with_run(plate, adapt="hybrid"), plate.settings.run
    refused = plate.grid.bodies is not None or any(True for _ in impossible(with_zone.settings, 2))
    return None if refused or "static" in (run.solver, run.start) else plate


def _time(found: Found) -> str:
    return "none" if np.isnan(found.first) else f"{1e6 * found.first:.2f}"


HEAD = """# Verification of adaptive zones

**How to use it.** Run `pdmesh build plate.geo --adapt hybrid`, then `pdsolve plate.json`. A scene in Python says
`.adapt()`, a drawing `Peridynamics/Run/Adapt`. If the nodes are on one lattice already, `pdsolve --adapt hybrid` is
enough. `python -m benchmarks.adaptivity` writes this page. Its times depend on the machine; only their ratios matter.

**Cells.** The plate is divided into cells of 2 h. A fine cell has nodes of spacing h with all bonds of the horizon. A
coarse cell has four springs along its edges and two along its diagonals, which are as stiff as the fine lattice,
including its anisotropy. A coarse cell has the mean stiffness and mass of its materials. Fine nodes at edges, faces of
pre-cracks and interfaces have the same bonds as in a uniform run.

**The fine zone.** From the start, cells are fine within 12 h of the tips of pre-cracks, and within a horizon and 4 h
of places where the outline cuts cells or turns inwards, and around nodes with a prescribed motion that the coarse
nodes beside them do not have. Every 8 steps more cells become fine: those within 8 h of a node with a bond that has
broken or begun to soften, and those within 8 h of a coarse bond stretched to more than 0.7 of the stretch that breaks
or softens it. Fine cells stay fine. A broken bond never heals: it has one bit, which is set once. Arrays of fine nodes
are written only where cells become fine; what is constant of fine nodes is kept by different rows of 16.

**Far cells.** In plates of more than a million cells of 2 h (4 million nodes if uniform) and one material, in double
precision, without damping or swelling, cells farther than 32 h from outlines that cut cells, pre-cracks, fine cells and
nodes with conditions are at the start of 4 h, with nodes 4 h apart. Their springs are those of coarse cells. A coarse
node in the middle of an edge of a far cell moves with the mean of the edge's ends and passes its forces and mass to
them, so that a linear displacement field is in equilibrium there too. A far cell becomes four of 2 h when a cell within
24 h of it becomes fine, and beside far springs that are stretched as coarse ones that make cells fine; it stays so.
Momentum is conserved to round-off, and the change of energy is in the ledger's `refinement`
(`tests/verification/test_far_cells.py`). Cells of 4 h send back 46, 8 and 1.5 % of pulses that are half, one and two
times 2 m h wide and come from cells of 2 h: in such plates the waves that matter are much longer. `duran_metre` at 0.25
mm breaks its first bond in the same step with far cells as without, does the same work, and takes 2.5 times less user
time and 0.9 GB in place of 1.5. A rectangle of one material may have up to 400 million nodes: 4 x 4 m at 0.25 mm takes
200 steps in 5.8 GB.

**The first bond** of a struck plate breaks as in uniform runs to a few tenths of a per cent ([below](#the-first-bond)).

**The seam.** Bonds that leave the fine cells are clipped at the edge of the zone. Their stiffness increases by the
factor by which they are shortened, after A. V. Shapeev (Multiscale Model. Simul. 9 (2011) 905-932). A linear
displacement field is in equilibrium, at edges too, and momentum and energy are conserved
(`tests/verification/test_clipped.py`). The seam reflects 5.2, 2.1 and 0.5 % of pulses that are half, one and two times
2 m h wide.

**What it supports**: nodes on one lattice; horizons up to 6 spacings (5.5 with a constant micromodulus); the
conservative mode in double and single precision; both laws of bonds; several materials, whose micromoduli may differ;
holes, notches and any outline; pre-cracks without width in any direction; loads; held displacements and velocities;
unbreakable regions; damping and layers that absorb, which take from coarse cells what they take from fine ones.
Frames, histories and the pictures of `pdpost` contain the coarse nodes and the current fine nodes. In the results,
nodes that appear or disappear do so in the first step after the preceding ledger entry or frame. `pdmesh build` lays
nodes of the finest spacing everywhere. Where a crack would meet a node, it moves the crack by half a spacing at most,
and says so.

**What it refuses**, in one line: state-based models, imported meshes and other nodes that are on no lattice, several
spacings, the thesis mode, held accelerations and equilibrium (`--static`). By default the number of threads follows
from the number of nodes; the bits of the results do not depend on it.

**When not to use it**: where much of the plate is crushed or softens, because most of it then becomes fine; where 12 h
around a tip, or the surroundings of holes, are most of the plate; with horizons of more than 4 spacings, for which the
zone is narrow ([where methods fail](limitations.md)). `--adapt auto` takes fine nodes everywhere then. A run in
which a clipped bond would break goes back, with fine cells that come earlier from a frame on, and in the end begins
anew with fine nodes everywhere.

"Path off" is the mean two-way distance from the paths of the other uniform runs, over the length of the path. For
uniform runs it shows how far they are from each other.
"""


def main(arguments: list[str]) -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description="Measure what a fine zone that moves costs and is off by.")
    parser.add_argument("--finer", action="store_true", help="0.25 mm of the steel too: some minutes")
    parser.add_argument("--repeat", type=int, default=3, help="times each cost is measured")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    sections = [compared(case, args.repeat) for case in CASES if args.finer or not case.finer]
    others = [part for part in pages.sections(PAGE.read_text(encoding="utf-8")) if part.startswith(OTHERS)]
    PAGE.write_text("\n".join([HEAD, *sections, scenes(), *others]), encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
