"""Accounts of a motion: energy ledger, probes and reactions, with checks of the physics."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pdmesh.model.bond_counts import pair_count
from pdmesh.model.broken_area import broken_area
from pdsolve.checks import advise_damped, advise_made, advise_spent, closing
from pdsolve.diffusion.swelling import Swelling
from pdsolve.errors import UnstableError
from pdsolve.laws.material_checks import negative_secants
from pdsolve.results import Frame, Results
from pdsolve.run.inversion_checks import MotionChecks
from pdsolve.run.measures import Asked, Ledger, books
from pdsolve.run.operator_factory import intact_stable_step
from pdsolve.run.reactions import Reaction, grips, reactions
from pdsolve.run.system import System
from pdsolve.state import State

RUNAWAY = 10.0  # times the energy put in: more than this is not physics


class MotionAccounts:
    """The accounts of one motion; see `pdsolve.run.accounts.Accounts`."""

    def __init__(self, system: System, state: State, step: int, bond_state: Asked, results: Results | None) -> None:
        """`results` are those of a resumed run after `step`, else None."""
        self._start(system, step, results)
        self._watch: MotionChecks | None = None
        self._given = False, False
        self._look_around()
        self.last, self._clamped = books(system, state, step, bond_state), self._heat(state)

    def _start(self, system: System, step: int, results: Results | None) -> None:
        self._system, materials = system, system.model.materials
        self._flows = any(material.solid == "j2" and material.form != "rate" for material in materials)  # to warn of
        self._nodes_changed = results is not None and len(results.epochs()) > 1  # which makes or loses energy
        self._most = 0.0  # J/m, the largest work, given or taken
        if results is not None:
            done = results.history()
            self._most = float(np.abs(done["work"][done["step"] <= step]).max(initial=0.0))
        self._ledgers: list[Ledger] = []
        self._probes: list[tuple[float, ...]] = []
        self._reactions: list[Reaction] = []

    def _heat(self, state: State) -> float:
        """What heat can do at most, J/m, against which little is round-off; 0 without it."""
        swelling = self._system.stepper
        return float(np.sum(self._system.area * swelling.clamped(state))) if isinstance(swelling, Swelling) else 0.0

    def follow(self, system: System) -> None:
        """Continue with changed nodes."""
        self._system, self._looked, self._nodes_changed = system, False, True
        if self._watch is not None:  # it has the nodes before, which are many
            self._given, self._watch = self._watch.given, None

    def _look_around(self) -> None:
        """Find the nodes of conditions and probes among the current nodes."""
        model, run = self._system.model, self._system.model.settings.run
        probes = [*run.probes, *(end for gap in run.gaps for end in gap.ends)]
        self._grips = grips(self._system)
        self._probed = model.grid.nearest(probes)[1].tolist() if probes else []
        self._watch = MotionChecks(model, partial(self._system.operator.bonds, start=True), self._given)
        self._looked = True

    @property
    def broken(self) -> int:
        """Directed bonds broken, as of the last entry."""
        return self.last.broken

    @property
    def balance(self) -> float:
        """Relative error of the last ledger entry; see `Ledger.balance`."""
        return self.last.balance(self._system.initial_energy, max(self._most, self._clamped))

    def words(self, broken: int) -> str:
        """State of the accounts in words, with so many broken bonds, for a progress display."""
        fine, text = self._system.zone_summary, f"broken bonds {pair_count(broken)}, balance {self.balance:+.1e}"
        if fine is not None:
            text += f", fine {fine.fine_share:.1%}"
            text += f", clipped stretch {fine.clipped_stretch:.2f}" if fine.clipped_stretch else ""
        return text

    def settle(self, state: State, step: int, bond_state: Asked) -> None:
        """Make this step the last entry."""
        if self.last.step != step:
            self.last, self._clamped = books(self._system, state, step, bond_state), self._heat(state)

    def take(self, state: State, step: int, bond_state: Asked) -> None:
        """Record the ledger, the probes and the reactions of this step. Raises UnstableError."""
        if not self._looked:
            self._look_around()
        system = self._system
        self.settle(state, step, bond_state)
        if self._is_unstable(self.last, bool(np.isfinite(state.value).all())):
            finite = np.isfinite(state.value).all(axis=1)
            worst = int((~finite).argmax() if not finite.all() else np.abs(state.rate).sum(axis=1).argmax())
            most, node = max(self._most, self._clamped), int(system.model.grid.ids[worst])
            raise UnstableError(unstable_words(system, self.last, most, node))
        self._most = max(self._most, abs(self.last.work))
        assert self._watch is not None
        self._watch.look(state.value[:, : system.model.grid.dimension], bond_state.broken, step)
        if self._flows:
            from pdsolve.run.plastic_checks import warn_of_plastic_strain  # few bodies flow

            self._flows = not warn_of_plastic_strain(system, step)
        self._ledgers.append(self.last)
        for row in dict.fromkeys(self._probed):
            node = int(system.model.grid.ids[row])
            self._probes.append((step, self.last.time, node, *motion_of(state, row, system.model.grid.dimension)))
        self._reactions += reactions(self._grips, system, state, step, self.last.time)

    def _is_unstable(self, books: Ledger, finite: bool) -> bool:
        """Whether energy is created, or values are not `finite`."""
        created = _created(self._system, books, max(self._most, self._clamped))
        return not (finite and np.isfinite(books.kinetic + books.strain) and created <= RUNAWAY)

    def entered(self, frame: Frame) -> Frame:
        """The frame with the records since the last one."""
        frame = frame._replace(ledger=self._ledgers, probes=self._probes, reactions=self._reactions)
        self._ledgers, self._probes, self._reactions = [], [], []
        return frame

    def meta(self) -> dict[str, Any]:
        """Metadata of the results about the physics, known from the start."""
        return {"initial_energy": self._system.initial_energy}

    def summary(self) -> dict[str, Any]:
        """Results of the run for its summary."""
        names = "kinetic", "strain", "dissipated", "damped", "friction", "work"
        return {
            "broken_bonds": pair_count(self.broken),
            "energy": {name: getattr(self.last, name) for name in names},
            "balance": self.balance,
            **self._broken_area(),
            **({"energy_unit": "J"} if self._system.model.grid.dimension == 3 else {}),
        }

    def _broken_area(self) -> dict[str, Any]:
        """Area of the cracks, G0 times it, and what bonds took, for a summary; nothing where nodes change, or cracks
        cost another energy.

        Bonds took what is booked as dissipated, less what the balance has too much.
        """
        system, run = self._system, self._system.model.settings.run
        plain = run.adapt == "none" and run.cracks == "bonds" and run.fatigue is None
        if not plain or self._nodes_changed or system.options.team is not None or not self.broken:
            return {}
        model, broken = system.model, system.operator.broken()
        of_material = model.materials, model.material_of
        cracks = broken_area(model.grid, model.settings.horizon.ratio, *of_material, broken.source, broken.target)
        if not cracks.cost > 0:  # bonds as long as a horizon, of a conical micromodulus, cost nothing
            return {}
        created = self.balance * self.last.put_in(system.initial_energy, max(self._most, self._clamped))
        sure = system.scheme.symmetric and model.settings.contact is None
        return {"cracks": {**cracks._asdict(), "spent": self.last.dissipated - (created if sure else 0.0)}}

    def close(self) -> None:
        """Issue warnings that follow from the final accounts."""
        system, last = self._system, self.last
        put_in = last.put_in(system.initial_energy, self._most)
        closing(system.model, self.balance, last.dissipated, system.scheme.symmetric)
        if system.scheme.symmetric and not self._nodes_changed:
            advise_spent(system.model, self.balance * put_in, put_in, last.dissipated)
        advise_made(system.model, last.refinement, put_in)
        advise_damped(system.model, last.damped + last.friction, put_in)


def motion_of(state: State, row: int, d: int) -> list[float]:
    """What is recorded of the motion of a node in d dimensions: u, v, a in the plane, and then along z."""
    fields = state.value, state.rate, state.second
    plane, space = ([field[row, axes].tolist() for field in fields] for axes in (slice(2), slice(2, d)))
    along = [value for values in space for value in values] or [0.0] * 3
    return [*(value for values in plane for value in values), *along]


def unstable_words(system: System, books: Ledger, most: float, node: int) -> str:
    """What is said of a run that is not stable: step, time, the id of a node, energy and the stability bound.

    `most`, J/m, is the largest work so far.
    """
    return (
        f"unstable at step {books.step}, {books.time:.4g} s, node {node}: energy is"
        f" {_created(system, books, most):.3g} times what was put in; the time step is {system.time_step:.4g} s,"
        f" stable up to {system.bound:.4g} s"
        f"{_suspect(system)}"
    )


def _created(system: System, books: Ledger, most: float) -> float:
    """The energy that is there over what was put in; 0 where nothing was."""
    energy_supplied = max(abs(books.work), most) + system.initial_energy
    return (books.kinetic + books.strain) / energy_supplied if energy_supplied else 0.0


def _suspect(system: System) -> str:
    """The likely cause of an instability other than the time step."""
    if system.time_step > system.bound:
        return ""
    laws = negative_secants(system.model)
    if laws:
        names = " and ".join(f"'{name}'" for name in laws)
        return f"; the likely cause is the law {names}, whose secant turns negative"
    if system.scheme.symmetric:
        intact_step = intact_stable_step(system.model, system.operator)
        if system.time_step > intact_step:
            return f", and with the bonds that are left up to {intact_step:.4g} s; take a shorter step (run.time_step)"
        return "; the step is not the cause: check loads and prescribed motion"
    return (
        f"; the cause is the one-sided bonds of the {system.scheme.name} mode, which make energy: --mode conservative"
    )
