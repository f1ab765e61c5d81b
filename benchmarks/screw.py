"""How fast a scalar field is made even: a dissolving screw by a plain list, by the solver's list, and by its slots.

    python -m benchmarks.screw [--spacing 0.125] [-o benchmarks/screw.json]

The screw of the multi-adaptive source, scaled (radius 1, height 4, a slot; held from a radius of 6 on), 240 steps by
each in turns, one thread, CPU time. `plain` is a textbook loop over 8-byte numbers of neighbours and conductances; the
bound of a list is how long it takes to read its bytes once, and nothing else, in the same run. `--collocation` measures
slots everywhere beside slots in a cylinder around the screw and stencils of 123 nodes, twice as far apart, elsewhere.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Run, Settings, Solid
from pdmesh.model.medium import Medium
from pdmesh.model.node_grid import Grid
from pdsolve.diffusion.families import Families
from pdsolve.diffusion.listed import BondList
from pdsolve.diffusion.masses import masses
from pdsolve.diffusion.operator import Fick
from pdsolve.diffusion.system import prepare
from pdsolve.model import Model
from pdsolve.steppers.euler import Euler

ROUNDS = 8
END = 2.0  # radius^2 / D


def lattice(spacing: float, reach: float) -> NDArray[np.float64]:
    """The middles (n, 3) of cubes around the origin that are within `reach` of it."""
    side = int(reach / spacing) + 1
    along = (np.arange(-side, side) + 0.5) * spacing
    z, y, x = (axis.ravel() for axis in np.meshgrid(along, along, along, indexing="ij"))
    there = np.sqrt(x**2 + y**2 + z**2) < reach
    return np.column_stack([x[there], y[there], z[there]])


def screw(spacing: float, steps: int, coarse: bool = False) -> Model:
    """The screw in liquid; `coarse`: outside of a cylinder around it nodes are twice as far apart, by collocation."""
    widest = 2 * spacing if coarse else spacing
    position = lattice(widest, 6 + 4 * widest)
    delta = np.full(len(position), widest)
    if coarse:
        near = (np.hypot(*position[:, :2].T) < 2.1) & (np.abs(position[:, 2]) < 3.1)
        corners = np.array(list(product((-0.5, 0.5), repeat=3))) * spacing
        fine = (position[near, None, :] + corners).reshape(-1, 3)
        position = np.concatenate([fine[np.lexsort(fine.T)], position[~near]])
        delta = np.concatenate([np.full(len(fine), spacing), delta[~near]])
    x, y, z = position.T
    nodes = len(x)
    solid = (np.hypot(x, y) < 1) & (np.abs(z) < 2) & ~((np.abs(y) < 0.25) & (z > 1.5))
    held = np.sqrt(x**2 + y**2 + z**2) >= 6
    nowhere = np.full(nodes, -1)
    grid = Grid(np.arange(1, nodes + 1), position, delta, nowhere > 0, nowhere, np.empty((0, 9)))
    dissolves = Solid(nodes=tuple((np.flatnonzero(solid) + 1).tolist()))
    clean = Concentration(nodes=tuple((np.flatnonzero(held) + 1).tolist()), value=0.0)
    run = Run(steps=steps, time_step=END / steps, every=steps, adapt="collocation" if coarse else "none")
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.2)
    return Model(grid, Settings(physics="diffusion", medium=medium, conditions=(dissolves, clean), run=run))


class Plain:
    """A textbook loop in place of an operator's."""

    name = "plain"

    def __init__(self, listed: BondList) -> None:
        bonds = listed.bonds
        self.volume, self.total, self.count = listed.volume, listed.total, listed.count
        self.start = bonds.first[bonds.start].astype(np.int64)
        self.neighbour = bonds.neighbour.astype(np.int64)
        self.weight = np.repeat(bonds.conductance, np.diff(bonds.first.astype(np.int64))) * listed.volume[0]

    def rates(self, potential: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Add to `out` (n,) what comes to each node, per volume and time, at this `potential` (n,)."""
        _plain(self.start, self.neighbour, self.weight, potential, out)

    def tangent(self) -> Any:
        """Nobody asks."""

    def contrast(self, share: NDArray[np.float64]) -> float:
        """Nobody asks."""
        return 0.0


@njit(nogil=True, error_model="numpy", cache=True)
def _plain(start, neighbour, weight, potential, out):  # type: ignore[no-untyped-def]
    for i in range(len(out)):
        s = 0.0
        for b in range(start[i], start[i + 1]):
            s += weight[b] * (potential[neighbour[b]] - potential[i])
        out[i] += s


@njit(nogil=True, error_model="numpy", cache=True, fastmath=True)
def _read(words):  # type: ignore[no-untyped-def]
    s = words[0]
    for word in words:
        s += word
    return s


def seconds(work: Callable[[], object]) -> float:
    """CPU time of this."""
    began = time.process_time()
    work()
    return time.process_time() - began


def bound(*arrays: NDArray[Any]) -> float:
    """The least time in which these can be read, s."""
    words = [array.view(np.uint8)[: array.nbytes // 8 * 8].view(np.uint64) for array in arrays]
    return min(sum(seconds(lambda one=one: _read(one)) for one in words) for _ in range(5))


def measure(spacing: float, steps: int) -> dict[str, Any]:
    """All three, in turns."""
    model = screw(spacing, steps)
    medium = Medium(D=1.0, C_solid=1.0, C_sat=0.2, surface_correction=False)  # the bonds of lattices alone
    model = replace(model, settings=msgspec.structs.replace(model.settings, medium=medium))
    slots, state = prepare(model, 1)
    listed = prepare(model, 1, listed=True)[0].operator.exchange
    assert isinstance(listed, BondList)
    plain = Plain(listed)
    runs = {}
    for exchange in (slots.operator.exchange, listed, plain):
        own = state._replace(**{name: values.copy() for name, values in state._asdict().items()})
        stepper = Euler(Fick(exchange, partial(Families, model), medium), slots.drive, slots.time_step)
        exchange.rates(own.value[:, 0], np.zeros(len(own.value)))
        runs[exchange.name] = (stepper, own)
    spent = dict.fromkeys(runs, 0.0)
    ends = [steps * part // ROUNDS for part in range(ROUNDS + 1)]
    for first, last in pairwise(ends):
        for name, (stepper, own) in runs.items():
            spent[name] += seconds(lambda s=stepper, o=own, a=first, b=last: s.march(o, a + 1, b + 1))
    bonds = int(slots.operator.count.sum())
    kept = listed.bonds
    least = bound(kept.first, kept.neighbour, kept.conductance)
    each = {name: value / steps / bonds * 1e9 for name, value in spent.items()}
    start = masses(slots, state, 0, None)
    now = masses(slots, runs["lattice"][1], steps, start.solid)
    return {
        "spacing": spacing,
        "steps": steps,
        "nodes": len(model.grid),
        "free_nodes": int(slots.free.sum()),
        "neighbours": int(slots.operator.count.max()),
        "bonds": bonds,
        "ns_per_bond_and_step": each,
        "ns_to_read_the_list": least / bonds * 1e9,
        "list_over_its_bound": each["listed"] / (least / bonds * 1e9),
        "slots_over_list": each["listed"] / each["lattice"],
        "slots_over_plain": each["plain"] / each["lattice"],
        "dissolved": now.dissolved / start.solid,
        "largest_difference": max(
            float(np.abs(runs["lattice"][1].value[:, 0] - own.value[:, 0]).max()) for _, own in runs.values()
        ),
    }


def collocated(spacing: float, steps: int) -> dict[str, Any]:
    """The uniform screw beside the one with collocation outside a cylinder, in turns."""
    systems = [prepare(screw(spacing, steps, coarse), 1) for coarse in (False, True)]
    starts = [masses(system, state, 0, None) for system, state in systems]
    spent, shares = np.zeros(2), np.zeros((2, 0))
    for system, state in systems:
        system.operator.exchange.rates(state.value[:, 0], np.zeros(len(state.value)))
    for part in range(ROUNDS):
        first, last = steps * part // ROUNDS, steps * (part + 1) // ROUNDS
        now = []
        for number, (system, state) in enumerate(systems):
            spent[number] += seconds(lambda s=system, o=state, a=first, b=last: s.stepper.march(o, a + 1, b + 1))
            found = masses(system, state, last, starts[number].solid)
            now.append(found.dissolved / starts[number].solid)
        shares = np.column_stack([shares, now])
    bonds = [int(system.operator.count.sum()) for system, _ in systems]
    speed = float(spent[0] / spent[1])
    return {
        "spacing": spacing,
        "steps": steps,
        "nodes": [len(system.model.grid) for system, _ in systems],
        "bonds": bonds,
        "ms_per_step": (spent / steps * 1e3).tolist(),
        "dissolved": shares.tolist(),
        "largest_difference": float(np.abs(shares[0] - shares[1]).max()),
        "balance": found.balance(starts[1]),
        "speed_up": speed,
        "fewer_bonds": bonds[0] / bonds[1],
        "speed_up_over_fewer_bonds": speed / (bonds[0] / bonds[1]),
    }


def main() -> None:
    """Measure, print, write."""
    program = argparse.ArgumentParser(description=__doc__)
    program.add_argument("--spacing", type=float, default=0.125)
    program.add_argument("--steps", type=int, default=240)
    program.add_argument("--collocation", action="store_true", help="beside collocation on a coarse lattice outside")
    program.add_argument("-o", "--output", type=Path)
    args = program.parse_args()
    found = collocated(args.spacing, args.steps) if args.collocation else measure(args.spacing, args.steps)
    text = json.dumps(found, indent=1)
    print(text)
    if args.output is not None:
        args.output.write_text(text + "\n")


if __name__ == "__main__":
    main()
