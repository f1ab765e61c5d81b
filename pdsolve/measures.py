"""What can be read off a system and its state at any step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fields import CRACKED
from pdsolve.state import State
from pdsolve.system import System

PIECE = 0.02  # of all nodes: smaller parts of a plate do not count as pieces

Energies = tuple[NDArray[np.float64], NDArray[np.float64]]  # of an operator: held, and spent on softening


class Ledger(NamedTuple):
    """The books of one step: what the motion holds, has lost and was given. Energies in J/m, momentum in N s/m."""

    step: int
    time: float  # s
    kinetic: float
    strain: float
    dissipated: float  # spent on softening and breaking bonds
    work: float  # done by loads and by holding components of the motion
    momentum_x: float
    momentum_y: float
    broken: int  # directed bonds broken so far

    def balance(self, initial: float) -> float:
        """Energy that has appeared from nowhere since a start with `initial` energy (J/m), over the larger of the
        work done and the energy at the start; 0 where energy is conserved."""
        missing = self.kinetic + self.strain + self.dissipated - self.work - initial
        scale = max(abs(self.work), initial)
        return missing / scale if scale else 0.0


def books(system: System, state: State, step: int, energies: Energies | None = None) -> Ledger:
    """The ledger after `step`, in double precision and in the nodes' order; `energies` are the operator's, if known."""
    strain, softened = energies or system.operator.energies(state)
    area, rho, velocity = system.area, system.model.rho, state.rate.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        return Ledger(
            step,
            step * system.time_step,
            kinetic=float(np.sum(rho / 2 * area * (velocity**2).sum(axis=1))),
            strain=float(np.sum(area * strain)),
            dissipated=float(np.sum(area * (state.dissipated + softened))),
            work=float(np.sum(area * state.work)),
            momentum_x=float(np.sum(rho * area * velocity[:, 0])),
            momentum_y=float(np.sum(rho * area * velocity[:, 1])),
            broken=len(system.operator.broken().step),
        )


def damage(system: System) -> NDArray[np.float64]:
    """Damage (n,): 1 - intact / initial bonds, those cut by a pre-crack counted as broken; 0 without any."""
    family = system.family
    intact = system.count - np.bincount(system.operator.broken().source, minlength=len(family))
    return np.where(family > 0, 1 - intact / np.maximum(family, 1), 0.0)


def fields(
    system: System, state: State, names: Iterable[str], energies: Energies | None = None
) -> dict[str, NDArray[np.floating]]:
    """The fields (n,) of these names now; `energies` as in `books`."""
    found: dict[str, NDArray[np.floating]] = {}
    for name in names:
        if name == "damage":
            found[name] = damage(system)
        elif name == "energy":
            found[name] = (energies or system.operator.energies(state))[0]
        else:
            values = {"u": state.value, "v": state.rate, "a": state.second}[name[0]]
            found[name] = values[:, "xy".index(name[1])]
    return found


def pieces(system: System) -> int:
    """How many pieces the plate is in: parts of the intact bonds' graph without cracked nodes."""
    from scipy.sparse import coo_array  # slow to import, and few runs ask
    from scipy.sparse.csgraph import connected_components

    sound = damage(system) <= CRACKED
    source, target = system.operator.bonds()
    whole = sound[source] & sound[target]
    nodes = len(sound)
    graph = coo_array((np.ones(int(whole.sum()), dtype=bool), (source[whole], target[whole])), (nodes, nodes))
    _, part = connected_components(graph, directed=False)
    return int((np.bincount(part) > PIECE * nodes).sum())
