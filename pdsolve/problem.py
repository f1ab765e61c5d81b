"""A model prepared for marching: bonds, conditions, state; and what can be read off it at any step."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pdsolve.bonds import Assembly, Bonds
from pdsolve.conditions import Drive, apply_loads, drive, initial_acceleration, initial_velocity
from pdsolve.energy import Ledger, ledger, strain_energies
from pdsolve.kernels.bond_sums import Motion
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.results import Breaks, Nodes
from pdsolve.schemes import EXACT_LOAD, SCHEMES
from pdsolve.steppers.verlet import advance, stability_bound

SAFETY = 0.8  # of the stability bound, for a model that names no time step
CRACKED = 0.35  # damage above which a node belongs to a crack
PIECE = 0.02  # of all nodes: smaller parts of a plate do not count as pieces

# On Linux the OpenMP layer starts a parallel loop three times as fast as numba's own.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]


@dataclass(frozen=True)
class Options:
    """How to solve, as opposed to what."""

    mode: str = "conservative"
    precision: str = "float64"
    threads: int | None = None  # None: all there are


class Softened(NamedTuple):
    """Bonds past their peak, to go on from."""

    bond: NDArray[np.int64]
    worst: NDArray[np.floating]


@dataclass(frozen=True)
class Problem:
    """A model prepared for marching; n nodes, b bonds. The arrays of `motion` and `drive` change with time."""

    model: Model
    options: Options
    assembly: Assembly
    drive: Drive
    motion: Motion
    rho: NDArray[np.floating]  # (n,) kg/m^3, in the run's precision
    time_step: float  # s
    bound: float  # surely stable time step, s
    initial_energy: float  # J/m

    def march(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1."""
        advance(self.assembly.bonds, self.motion, self.drive, self.rho, self.time_step, first, last)

    def books(self, step: int) -> Ledger:
        """The ledger after `step`."""
        assembly = self.assembly
        return ledger(assembly.bonds, self.motion, assembly.area, self.model.rho, step, step * self.time_step)

    def damage(self) -> NDArray[np.float64]:
        """Damage (n,): 1 - intact / initial bonds, those cut by a pre-crack counted as broken; 0 without any."""
        start, family = self.assembly.bonds.start, self.assembly.family
        running = np.concatenate([[0], np.cumsum(self.motion.broken == 0)])
        intact = running[start[1:]] - running[start[:-1]]
        return np.where(family > 0, 1 - intact / np.maximum(family, 1), 0.0)

    def fields(self, names: Iterable[str]) -> dict[str, NDArray[np.floating]]:
        """The fields (n,) of these names now."""
        motion = self.motion
        found: dict[str, NDArray[np.floating]] = {}
        for name in names:
            if name == "damage":
                found[name] = self.damage()
            elif name == "energy":
                found[name] = strain_energies(self.assembly.bonds, motion)[0]
            else:
                found[name] = getattr(motion, name[0])[:, "xy".index(name[1])]
        return found

    @cached_property
    def source(self) -> NDArray[np.int32]:
        """Row (b,) of the node whose bond it is."""
        counts = np.diff(self.assembly.bonds.start)
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    def nodes(self) -> Nodes:
        """The nodes as results know them."""
        grid, assembly = self.model.grid, self.assembly
        cut = assembly.family - np.diff(assembly.bonds.start)
        return Nodes(grid.ids, grid.position, grid.delta, assembly.area, assembly.family, cut)

    def breaks_after(self, step: int) -> Breaks:
        """Bonds broken after `step`, in order."""
        broken, ids = self.motion.broken, self.model.grid.ids
        new = np.flatnonzero(broken > step)
        new = new[np.argsort(broken[new], kind="stable")]
        return Breaks(broken[new].astype(np.int64), ids[self.source[new]], ids[self.assembly.bonds.neighbour[new]])

    def pieces(self) -> int:
        """How many pieces the plate is in: parts of the intact bonds' graph without cracked nodes."""
        sound = self.damage() <= CRACKED
        ends = self.source, self.assembly.bonds.neighbour
        whole = (self.motion.broken == 0) & sound[ends[0]] & sound[ends[1]]
        nodes = len(sound)
        graph = coo_matrix((np.ones(int(whole.sum()), dtype=bool), (ends[0][whole], ends[1][whole])), (nodes, nodes))
        _, part = connected_components(graph, directed=False)
        return int((np.bincount(part) > PIECE * nodes).sum())

    def state(self) -> dict[str, NDArray[np.floating]]:
        """Everything a later run needs to go on to the same bits, but for the broken bonds."""
        motion = self.motion
        softened = np.flatnonzero(motion.worst)
        return {
            **{name: getattr(motion, name) for name in ("u", "v", "a", "dissipated", "work")},
            "held_force": self.drive.held_force,
            "softened_bond": softened,
            "softened_worst": motion.worst[softened],
        }

    def restore(self, step: int, state: dict[str, NDArray[np.floating]], breaks: Breaks) -> None:
        """Go back to a state and the bonds broken until then."""
        motion = self.motion
        for name in ("u", "v", "a", "dissipated", "work"):
            getattr(motion, name)[:] = state[name].reshape(getattr(motion, name).shape)
        self.drive.held_force[:] = state["held_force"]
        motion.worst[state["softened_bond"].astype(np.int64)] = state["softened_worst"]
        ids = self.model.grid.ids
        order = np.argsort(ids)
        node, neighbour = (order[np.searchsorted(ids, column, sorter=order)] for column in breaks[1:])
        key = self.source.astype(np.int64) * len(ids) + self.assembly.bonds.neighbour
        motion.broken[np.searchsorted(key, node * len(ids) + neighbour)] = breaks.step
        apply_loads(self.drive, step * self.time_step)

    def bytes(self) -> int:
        """Memory of the arrays that marching uses."""
        arrays: list[NDArray[np.generic]] = [
            *self.assembly.bonds,
            *self.motion,
            self.rho,
            self.drive.force,
            self.drive.before,
        ]
        return int(sum(array.nbytes for array in arrays))


def prepare(model: Model, options: Options) -> Problem:
    """Bonds, conditions and the state at time 0. Raises ModelError for options or a model that cannot be run."""
    if options.mode not in SCHEMES:
        raise ModelError(f"mode: found '{options.mode}', expected one of {', '.join(SCHEMES)}")
    if options.precision not in ("float64", "float32"):
        raise ModelError(f"precision: found '{options.precision}', expected float64 or float32")
    cores = numba.config.NUMBA_NUM_THREADS
    if options.threads is not None and not 1 <= options.threads <= cores:
        raise ModelError(f"threads: found {options.threads}, expected 1 to {cores}")
    numba.set_num_threads(options.threads or cores)
    kind = np.dtype(options.precision).type
    exact = SCHEMES[options.mode](model)
    bound = stability_bound(exact.bonds, model.rho)
    step = model.settings.run.time_step
    if step is None:
        if not np.isfinite(bound):
            raise ModelError(f"{model.name}: $.run.time_step: found none, expected one for a model without bonds")
        step = SAFETY * bound
    if step > bound:
        warnings.warn(
            f"{model.name}: the time step {step:.4g} s is above the bound that is surely stable, {bound:.4g} s",
            ModelWarning,
            stacklevel=2,
        )
    rounded = [np.ascontiguousarray(column, dtype=kind) for column in exact.bonds[2:]]
    bonds = Bonds(exact.bonds.start, exact.bonds.neighbour, *rounded)
    driven = drive(model, exact.area, EXACT_LOAD[options.mode], kind)
    nodes, rho = len(model.grid), model.rho.astype(kind)
    velocity = initial_velocity(model)
    softens = bool((exact.bonds.peak < exact.bonds.limit).any())
    motion = Motion(
        u=np.zeros((nodes, 2), dtype=kind),
        v=velocity.astype(kind),
        a=initial_acceleration(driven, rho),
        broken=np.zeros(len(bonds.neighbour), dtype=np.int32),
        worst=np.zeros(len(bonds.neighbour) if softens else 0, dtype=kind),
        dissipated=np.zeros(nodes),
        work=np.zeros(nodes),
    )
    energy = float(np.sum(model.rho / 2 * exact.area * (velocity**2).sum(axis=1)))
    problem = Problem(model, options, exact._replace(bonds=bonds), driven, motion, rho, step, bound, energy)
    problem.march(1, 1)  # no step: compiles before the clock runs
    return problem
