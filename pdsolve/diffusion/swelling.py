"""Bodies that heat, or a solvent, swells: a content and a motion of the same nodes, one step of each after the other.

The content h diffuses by itself (Fick's law: T with the thermal diffusivity, K). A free node is strained by alpha (h -
T0), a bond by the mean of its ends, and stretches from there, whatever its law. With `medium.deformation`, T also
changes by -T0 alpha / (rho c) times the change of the trace of stress (Lord Kelvin), which is minus the derivative of
the energy of bonds by the strain of free nodes; `second` of the content's state keeps that. The content takes one step
for a cycle of steps of the motion, in its middle, and goes to its end. At rest each step of the content is followed by
a load step. What a change of strain adds to the energy of bonds is booked as work: the mean of that at the
displacements before and after a step, as the forces of velocity Verlet are; at rest the same mean is exact for linear
bonds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material_constants import poisson
from pdmesh.model.neighbours import ROUND_OFF, Pairs
from pdmesh.model.node_fields import with_field
from pdsolve.diffusion.families import DiffusionFamilies
from pdsolve.diffusion.system import Transport
from pdsolve.diffusion.walls import Array
from pdsolve.lattice.flux_operator import FluxesInList, links_between
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.state import Broken, State
from pdsolve.stepper import Stepper

SMALL = 1e-5  # of strain: energies that far apart tell their derivative
# Steps of the motion, at most, for one of the content: what heats as fast as waves go is that coarse. A run chooses
# one of these, all of which divide 10, 20 and 50, so that usual frames come at the end of a step of the content
CYCLES = 1, 2, 5, 10


class Swollen(Operator, Protocol):
    """Bonds of n nodes that stretch from what they are long at strains of free nodes."""

    def swell(self, strain: Array) -> None:
        """Let bonds stretch from there at these strains (n,)."""


class BrokenBonds:
    """What the broken bonds of a motion, of the same n nodes, take from a transport.

    A pair of nodes whose bond broke keeps a share of the conductance that it had, that of the surface correction
    included. Walls that prescribe a value keep all of theirs.
    """

    def __init__(self, transport: Transport, broken: Callable[[], Broken], share: float) -> None:
        """`broken` returns the bonds that are broken now; each keeps a `share`, from 0 to 1, of its conductance."""
        self._transport, self._broken, self._share = transport, broken, share
        self._families, self._known = DiffusionFamilies(transport.model), 0

    def update(self, stepper: Stepper) -> None:
        """Let the bonds that are broken now conduct less, in the steps of `stepper` too."""
        broken = self._broken()
        if len(broken.step) == self._known:
            return
        self._known = len(broken.step)
        order = np.lexsort((broken.target, broken.source))
        source, target = broken.source[order], broken.target[order]
        # the conductance (b,) of these pairs while they are whole, 1/(s m^d); 0 where nothing diffuses
        families, operator = self._families, self._transport.operator
        length = np.sqrt(((families.position[target] - families.position[source]) ** 2).sum(axis=1))
        conductance = families.conductance(Pairs(source, target, length))
        conductance = np.where(conductance > ROUND_OFF * conductance.max(initial=0.0), conductance, 0.0)
        change = operator.change
        if change is not None and len(change.links.neighbour):
            start, neighbour, _ = change.links
            keys = np.repeat(np.arange(len(change.volume)), np.diff(start)) * len(change.volume) + neighbour
            wanted = source * len(change.volume) + target
            at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            conductance = conductance + np.where(keys[at] == wanted, change.conductance[at], 0.0)
        lost = (self._share - 1) * conductance
        is_reduced = lost < 0
        links = links_between(source[is_reduced], target[is_reduced], len(operator.volume))
        operator.torn = FluxesInList(links, lost[is_reduced], operator.volume, self._transport.threads)
        stepper.discard_factors()


class Swelling(Stepper):
    """Steps of a content and of the motion, or load steps, that it swells; n nodes."""

    def __init__(
        self,
        content: Stepper,
        content_state: State,
        motion: Stepper,
        bonds: Swollen,
        model: Model,
        steps_per_content_step: int = 1,
        broken: BrokenBonds | None = None,
        free: NDArray[np.bool_] | None = None,
    ) -> None:
        """`content` takes steps that are `steps_per_content_step` of the motion long.

        `model` has the materials, each with alpha and T0. `broken` bonds conduct less; None: all conduct alike.
        `free` (n,) are the nodes whose content is not prescribed; None: all.
        """
        self._broken, self._free = broken, np.ones(len(model.grid), dtype=np.bool_) if free is None else free
        self._content, self._h = content, content_state
        self.motion, self.steps_per_content_step, self._bonds = motion, steps_per_content_step, bonds
        self.inner, self.integrator = motion, motion.integrator
        self._alpha, self._T0 = coefficients(model)
        medium = model.settings.medium
        assert medium is not None
        self._capacity = medium.heat_capacity if medium.deformation else None
        if not motion.goes_from_rest_to_rest:
            self.swell()

    def swell(self) -> None:
        """Strain the bonds by the contents of now."""
        self._bonds.swell(self._strain())

    def begin(self, state: State) -> None:
        """Let heat of deformation count from the stress of this state on."""
        if self._capacity is None:
            return
        # The derivative of energies by the strain of free nodes, J/m^3: minus the trace of stress
        strain = self._strain()
        more, less = self._held(state, strain + SMALL), self._held(state, strain - SMALL)
        self._bonds.swell(strain)
        self._h.second[:, 0] = (more - less) / (2 * SMALL)

    def energy_density_at_zero_displacement(self, state: State) -> Array:
        """The energy densities (n,) that bonds would hold at no displacement, J/m^3: what heat can do at most."""
        now = state.value.copy()
        strain_energy = self._bonds.energies(state._replace(value=np.zeros_like(now)))[0]
        state.value[:] = now  # blocks have one place for displacements
        return strain_energy

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1 of both, in place; returns the last one.

        `state` is that of the motion.
        """
        step, strain_energy = first_step, None
        while step < end_step:
            until = min(end_step, step + (self.steps_per_content_step // 2 + 1 - step) % self.steps_per_content_step)
            if until > step:
                self.motion.advance(state, step, until)
                step, strain_energy = until, None
                continue
            strain_energy = self._heat(state, step, strain_energy)
            step += 1
        return end_step - 1

    def checkpoint_arrays(self) -> Mapping[str, NDArray[Any]]:
        """History of the motion, for a checkpoint; the content has a checkpoint of its own."""
        return self.motion.checkpoint_arrays()

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore the motion, and strain the bonds by the contents, which have been restored."""
        self.motion.restore(checkpoint, state, step, broken)
        self.swell()

    def summary(self) -> dict[str, Any]:
        """Iterations and residuals of load steps, where the motion has some."""
        return self.motion.summary()

    def _heat(self, state: State, step: int, strain_energy: Array | None) -> Array | None:
        """Take a step of the content and the one of the motion after it; returns what bonds hold then, if known.

        `strain_energy` (n,) is that of before, J/m^3, if it is known.
        """
        rests = self.motion.goes_from_rest_to_rest
        before = np.zeros(len(self._T0)) if rests and step == 1 else self._strain()
        strain_energy = self._held(state, before) if strain_energy is None else strain_energy
        if self._broken is not None:
            self._broken.update(self._content)
        if self._capacity is not None and not (rests and step == 1):  # before which nothing is strained
            # heat of deformation, by the change of stress since this was done last; booked as supplied
            previous_slope = self._h.second[:, 0].copy()
            self.begin(state)
            slope_change = self._h.second[:, 0] - previous_slope
            change = np.where(self._free, self._T0 * self._alpha / self._capacity * slope_change, 0.0)
            self._h.value[:, 0] += change
            self._h.work[:] += change
        self._content.advance(
            self._h, (step - 1) // self.steps_per_content_step + 1, (step - 1) // self.steps_per_content_step + 2
        )
        strain = self._strain()
        state.work[:] += (self._held(state, strain) - strain_energy) / 2

        def loaded(state: State) -> Array:
            unstrained, now = self._held(state, before), self._held(state, strain)
            state.work[:] += (now - unstrained) / 2
            return now

        self.motion.set_swelling_strain(strain, state, loaded)
        self.motion.advance(state, step, step + 1)
        return None if rests else loaded(state)

    def _strain(self) -> Array:
        """The strains (n,) of free nodes."""
        return np.asarray(self._alpha * (self._h.value[:, 0] - self._T0))

    def _held(self, state: State, strain: Array) -> Array:
        """The energy densities (n,) of bonds at these strains (n,), which stay, J/m^3."""
        self._bonds.swell(strain)
        return self._bonds.energies(state)[0]


def steps_per_content_step(time_step: float, longest_content_step: float) -> int:
    """Steps of the motion, of `time_step` s, for one of a content whose longest step is `longest_content_step`, s.

    It does not depend on the steps between two records. A record within a step of the content has the content of the
    nearest end of one.
    """
    return max(cycle for cycle in CYCLES if cycle == 1 or cycle * time_step <= longest_content_step)


def coefficients(model: Model) -> Array:
    """Strain for each unit of content, and the content without strain, of each node, (2, n).

    In plane strain it is 1 + nu times alpha: what is kept from growing along z grows within the plane instead.
    """
    alpha = model.node_values("alpha")
    if model.materials[0].plane == "strain":
        nu = np.array([poisson(each) for each in model.materials])[model.material_of]
        alpha *= 1 + with_field(model.grid.fields, "nu", nu)
    return np.array([alpha, model.node_values("T0")])
