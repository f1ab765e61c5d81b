"""A model prepared for marching: bonds, conditions, state; and what can be read off it at any step."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from pdsolve import bonds as lists
from pdsolve.bonds import Assembly, Bonds, Filling, Part, listed
from pdsolve.checks import refuse
from pdsolve.conditions import Drive, drive, initial_acceleration, initial_velocity, put_loads
from pdsolve.energy import Ledger, ledger, strain_energies
from pdsolve.kernels import layout
from pdsolve.kernels.blocks import LANES, Blocks, Tracks, energy_densities
from pdsolve.kernels.bond_sums import Motion
from pdsolve.kernels.layout import aligned, blocks_of
from pdsolve.kernels.stale import drop_stale
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.results import Breaks, Families, Nodes
from pdsolve.schemes import EXACT_LOAD, PARTIAL_CELLS, SCHEMES, SYMMETRIC
from pdsolve.steppers.verlet import advance, advance_blocks, stability_bound

CRACKED = 0.35  # damage above which a node belongs to a crack
PIECE = 0.02  # of all nodes: smaller parts of a plate do not count as pieces

# On Linux the OpenMP layer starts a parallel loop three times as fast as numba's own. Its threads wait for each other
# by spinning, for so long that a second busy program makes a run ten times slower; a shorter spin costs 3 %.
numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
if not numba.config.DISABLE_JIT:
    drop_stale(Path(__file__).parent, [Path(kernel.stats.cache_path) for kernel in (advance_blocks, energy_densities)])


Energies = tuple[NDArray[np.float64], NDArray[np.float64]]  # as of `Problem.energies`


@dataclass(frozen=True)
class Options:
    """How to solve, as opposed to what."""

    mode: str = "conservative"
    precision: str = "float64"
    threads: int | None = None  # None: all there are
    kernel: str | None = None  # "blocks" or "textbook"; None: blocks where the nodes are a lattice


class Fast(NamedTuple):
    """The same bonds and motion as the fast kernel wants them; the arrays of `Motion` look into those of `tracks`."""

    blocks: Blocks
    tracks: Tracks
    whole: NDArray[np.uint64]  # masks of the slots with all bonds there


@dataclass(frozen=True)
class Problem:
    """A model prepared for marching; n nodes, b bonds. The arrays of `motion` and `drive` change with time.

    A bond has the number that the kernel in use gives it; `motion.broken` and `motion.worst` are in that order.
    """

    model: Model
    options: Options
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) as in Assembly
    count: NDArray[np.int64]  # (n,) bonds of a node at the start, those cut by a pre-crack left out
    drive: Drive
    motion: Motion
    rho: NDArray[np.floating]  # (n,) kg/m^3, in the run's precision
    time_step: float  # s
    bound: float  # surely stable time step, s
    initial_energy: float  # J/m
    fast: Fast | None  # None: by the textbook
    fill: Callable[[Model], Filling]  # how its bonds were made

    @property
    def kernel(self) -> str:
        """The name of the kernel in use."""
        return "blocks" if self.fast else "textbook"

    @cached_property
    def assembly(self) -> Assembly:
        """The whole list of bonds, in the run's precision; made anew for the fast kernel, which does without."""
        return _in_precision(self.fill(self.model).whole(), self.options.precision)

    @property
    def bonds(self) -> int:
        """How many directed bonds there were at the start."""
        return int(self.count.sum())

    def march(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1."""
        if self.fast:
            blocks, tracks, drive = self.fast.blocks, self.fast.tracks, self.drive
            advance_blocks(blocks, tracks, drive, drive.holds, drive.profiles, self.time_step, first, last)
            return
        advance(self.assembly.bonds, self.motion, self.drive, self.rho, self.time_step, first, last)

    def books(self, step: int, energies: Energies | None = None) -> Ledger:
        """The ledger after `step`; `energies` are those of now, if they are known already."""
        area, rho, held = self.area, self.model.rho, energies or self.energies()
        return ledger(held, self.motion, area, rho, len(self.broken()), step, step * self.time_step)

    def energies(self) -> Energies:
        """Densities (n,), J/m^3, of the energy that the nodes' bonds hold, and have spent on softening so far."""
        if self.fast:
            return layout.energies(self.fast.blocks, self.fast.tracks, len(self.model.grid))
        return strain_energies(self.assembly.bonds, self.motion)

    def damage(self) -> NDArray[np.float64]:
        """Damage (n,): 1 - intact / initial bonds, those cut by a pre-crack counted as broken; 0 without any."""
        broken, _ = self.ends(self.broken())
        intact = self.count - np.bincount(broken, minlength=len(self.family))
        return np.where(self.family > 0, 1 - intact / np.maximum(self.family, 1), 0.0)

    def broken(self) -> NDArray[np.int64]:
        """The numbers of the bonds broken so far."""
        if self.fast:
            return layout.there(self.fast.whole & ~self.fast.blocks.mask)
        return np.flatnonzero(self.motion.broken)

    def intact_neighbours(self, row: int) -> NDArray[np.int64]:
        """The rows that a node still has a bond to."""
        if self.fast:
            slots = self.fast.blocks.start[[row // LANES, row // LANES + 1]]
            numbers = layout.there(self.fast.blocks.mask[slots[0] : slots[1]], int(slots[0]))
        else:
            numbers = np.arange(*self.assembly.bonds.start[[row, row + 1]])
            numbers = numbers[self.motion.broken[numbers] == 0]
        source, target = self.ends(numbers)
        return np.asarray(target[source == row])

    def ends(self, bonds: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The rows (k,) of both nodes of the bonds with these numbers (k,)."""
        return layout.ends(self.fast.blocks, bonds) if self.fast else lists.ends(self.assembly.bonds, bonds)

    def fields(self, names: Iterable[str], energies: Energies | None = None) -> dict[str, NDArray[np.floating]]:
        """The fields (n,) of these names now; `energies` as in `books`."""
        motion = self.motion
        found: dict[str, NDArray[np.floating]] = {}
        for name in names:
            if name == "damage":
                found[name] = self.damage()
            elif name == "energy":
                found[name] = (energies or self.energies())[0]
            else:
                found[name] = getattr(motion, name[0])[:, "xy".index(name[1])]
        return found

    def nodes(self) -> Nodes:
        """The nodes as results know them."""
        grid, cut = self.model.grid, self.family - self.count
        return Nodes(grid.ids, grid.position, grid.delta, self.area, self.family, cut)

    def families(self, first: int, last: int) -> Families:
        """Who is bonded to whom at the start, for the rows `first` to `last` - 1."""
        if self.fast:
            slots = self.fast.blocks.start[[first // LANES, -(-last // LANES)]]
            numbers = layout.there(self.fast.whole[slots[0] : slots[1]], int(slots[0]))
        else:
            numbers = np.arange(*self.assembly.bonds.start[[first, last]])
        source, target = self.ends(numbers)
        own = (source >= first) & (source < last)
        order = np.lexsort((target[own], source[own]))
        start = np.concatenate([[0], np.cumsum(self.count[first:last])])
        return Families(start, target[own][order])

    def breaks_after(self, step: int) -> Breaks:
        """Bonds broken after `step`, in order."""
        ids, new = self.model.grid.ids, self.broken()
        new = new[self.motion.broken[new] > step]
        broken, (source, target) = self.motion.broken[new].astype(np.int64), self.ends(new)
        order = np.lexsort((target, source, broken))
        return Breaks(broken[order], ids[source[order]], ids[target[order]])

    def pieces(self) -> int:
        """How many pieces the plate is in: parts of the intact bonds' graph without cracked nodes."""
        from scipy.sparse import coo_matrix  # slow to import, and few runs ask
        from scipy.sparse.csgraph import connected_components

        sound = self.damage() <= CRACKED
        intact = layout.there(self.fast.blocks.mask) if self.fast else np.flatnonzero(self.motion.broken == 0)
        ends = self.ends(intact)
        whole = sound[ends[0]] & sound[ends[1]]
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
        """Go back to the state after `step`; of the `breaks` those until then count."""
        motion, breaks = self.motion, Breaks(*(column[breaks.step <= step] for column in breaks))
        for name in ("u", "v", "a", "dissipated", "work"):
            getattr(motion, name)[:] = state[name].reshape(getattr(motion, name).shape)
        self.drive.held_force[:] = state["held_force"]
        motion.worst[state["softened_bond"].astype(np.int64)] = state["softened_worst"]
        ids = self.model.grid.ids
        order = np.argsort(ids)
        node, neighbour = (order[np.searchsorted(ids, column, sorter=order)] for column in breaks[1:])
        if self.fast:
            blocks, tracks, whole = self.fast
            motion.broken[layout.find(blocks, whole, node, neighbour)] = breaks.step
            layout.revive(blocks, tracks.broken, tracks.worst, whole)
        else:
            motion.broken[lists.find(self.assembly.bonds, node, neighbour)] = breaks.step
        put_loads(self.drive, step * self.time_step)

    def bytes(self) -> int:
        """Memory of the arrays that marching uses; that of slots' own stiffnesses comes as their bonds break."""
        arrays: list[NDArray[np.generic]] = [
            *(self.fast.blocks if self.fast else self.assembly.bonds),
            *self.motion,
            self.rho,
            self.drive.force,
            self.drive.before,
        ]
        later = self.fast.blocks.stiffness[-len(self.fast.blocks.pull) :].nbytes if self.fast else 0
        return int(sum(array.nbytes for array in arrays)) - later


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
    refuse(model, PARTIAL_CELLS[options.mode])
    return problem_of(model, options, SCHEMES[options.mode])


class _Survey:
    """What is kept of the bonds while they pass, part by part."""

    def __init__(self, filling: Filling, rho: NDArray[np.float64], symmetric: bool) -> None:
        self._filling, self._rho, self._symmetric = filling, rho, symmetric
        self.counts: list[NDArray[np.int64]] = []
        self.families: list[NDArray[np.int64]] = []
        self.bound, self.softens = float("inf"), False

    def parts(self) -> Iterator[Part]:
        """All parts, noted."""
        for part in self._filling.parts():
            bonds = part.bonds
            self.counts.append(np.diff(bonds.start))
            self.families.append(part.family)
            rho = self._rho[part.first : part.first + len(part.family)]
            self.bound = min(self.bound, stability_bound(bonds, rho, self._symmetric))
            self.softens |= bool((bonds.peak < bonds.limit).any())
            yield part


def problem_of(model: Model, options: Options, fill: Callable[[Model], Filling]) -> Problem:
    """The problem of a model whose bonds are filled like this, in double precision. Raises ModelError."""
    filling = fill(model)
    kind, nodes = np.dtype(options.precision).type, len(model.grid)
    survey, blocks, exact = _Survey(filling, model.rho, SYMMETRIC[options.mode]), None, None
    if options.kernel != "textbook":
        blocks = blocks_of(survey.parts(), nodes, kind, numba.config.NUMBA_NUM_THREADS)
        if options.kernel == "blocks" and blocks is None:
            raise ModelError("kernel: found nodes without a lattice, expected one for blocks")
    if blocks is None:
        survey = _Survey(filling, model.rho, SYMMETRIC[options.mode])
        exact = listed(survey.parts(), filling.area)
    step, bound = model.settings.run.time_step, survey.bound
    if step is None:
        if not np.isfinite(bound):
            raise ModelError(f"{model.name}: $.run.time_step: found none, expected one for a model without bonds")
        step = bound
    if step > bound:
        warnings.warn(
            f"{model.name}: the time step {step:.4g} s is above the bound that is surely stable, {bound:.4g} s",
            ModelWarning,
            stacklevel=2,
        )
    driven = drive(model, filling.area, EXACT_LOAD[options.mode], kind)
    velocity, rho = initial_velocity(model), model.rho.astype(kind)
    family, count = np.concatenate(survey.families), np.concatenate(survey.counts)
    bonds = int(count.sum()) if blocks is None else LANES * len(blocks.mask)
    motion = Motion(
        u=np.zeros((nodes, 2), dtype=kind),
        v=velocity.astype(kind),
        a=initial_acceleration(driven, rho),
        broken=np.zeros(bonds, dtype=np.int32),
        worst=np.zeros(bonds if survey.softens else 0, dtype=kind),
        dissipated=np.zeros(nodes),
        work=np.zeros(nodes),
    )
    fast = None
    if blocks is not None:
        tracks = _tracks(motion, driven, rho, len(blocks.softened), len(blocks.scratch))
        fast = Fast(blocks, tracks, blocks.mask.copy())
        motion, driven = _looking_into(tracks, motion, driven)
    energy = float(np.sum(model.rho / 2 * filling.area * (velocity**2).sum(axis=1)))
    problem = Problem(model, options, filling.area, family, count, driven, motion, rho, step, bound, energy, fast, fill)
    if exact is not None:
        vars(problem)["assembly"] = _in_precision(exact, options.precision)  # to be asked for at once
    problem.march(1, 1)  # no step: compiles before the clock runs
    return problem


def _in_precision(exact: Assembly, precision: str) -> Assembly:
    rounded = (np.ascontiguousarray(column, dtype=precision) for column in exact.bonds[2:])
    return exact._replace(bonds=Bonds(exact.bonds.start, exact.bonds.neighbour, *rounded))


def _tracks(motion: Motion, drive: Drive, rho: NDArray[np.floating], count: int, threads: int) -> Tracks:
    """Motion, at rest, and loads in `count` whole blocks, with spare nodes for so many threads."""
    room = count * LANES

    def spread(values: NDArray[np.generic], idle: float = 0.0) -> NDArray[Any]:
        wide = np.full((*values.shape[1:], room), idle, dtype=values.dtype)
        wide[..., : len(values)] = values.T
        return aligned(wide)

    block = drive.holds.node // LANES
    held = np.argsort(block, kind="stable")
    loaded = np.zeros(count, dtype=np.bool_)
    loaded[drive.loads.node // LANES] = True
    return Tracks(
        u=aligned(np.zeros((3, 2, room + LANES * threads), dtype=motion.u.dtype)),
        v=spread(motion.v),
        a=spread(motion.a),
        force=spread(drive.force),
        before=spread(drive.before),
        rho=spread(rho, 1.0),
        dissipated=spread(motion.dissipated),
        work=spread(motion.work),
        broken=motion.broken.reshape(-1, LANES),
        worst=motion.worst.reshape(-1, LANES),
        loaded=loaded,
        held=held,
        held_start=np.searchsorted(block[held], np.arange(count + 1)),
        turns=_turns(count, numba.get_num_threads()),
    )


def _turns(count: int, threads: int) -> NDArray[np.int64]:
    """All of `count` blocks in an order whose equal parts, one for each of the threads, are equal work.

    Blocks at an interface between spacings cost more than others, so that a part takes groups from all over.
    """
    group = max(1, count // (16 * threads))
    return np.argsort(np.arange(count) // group % threads, kind="stable").astype(np.int64)


def _looking_into(tracks: Tracks, motion: Motion, drive: Drive) -> tuple[Motion, Drive]:
    """Motion and loads, node by node, as views of the tracks."""
    nodes = len(motion.u)
    views = {name: getattr(tracks, name)[..., :nodes].T for name in ("v", "a", "dissipated", "work")}
    force, before = tracks.force[:, :nodes].T, tracks.before[:, :nodes].T
    return motion._replace(u=tracks.u[0, :, :nodes].T, **views), drive._replace(force=force, before=before)
