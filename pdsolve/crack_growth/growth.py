"""Growth of cracks, particle by particle ahead of their tips, and its effect on bonds.

All tips are judged in one state; those that may grow then grow by one particle each. Bonds that cross a new arm are cut
like bonds of a pre-crack, or weakened where they see each other round its tip. Their energy is booked as dissipated,
and the motion continues without their forces. Only particles are stored: tips and their directions follow from them, so
that a resumed run equals an uninterrupted one.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.base_structs import MOST_STEPS
from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdmesh.model.visibility import Sight
from pdsolve.bonds.assembly import BondSource
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, constrained_components, unbreakable
from pdsolve.crack_growth.criteria import AHEAD, Verdict, by_intensity, by_release, by_stress
from pdsolve.crack_growth.tip_gradients import Round, Surroundings
from pdsolve.crack_growth.tips import ACTED_ON, CrackedPlate, Tip, tips_of
from pdsolve.errors import CheckpointError
from pdsolve.fracture.crack_particles import Particles, arms, grown, of_segments
from pdsolve.fracture.domain_integrals import Ring
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import force_densities
from pdsolve.state import Broken, State

BLURRED, LEAST, RING = 2.0, 3.5, 5.0  # horizons: where a ring begins, the room it needs, where it ends at most
OUTER = 0.8  # of the room: where a ring ends
CLOSE = 1.5  # horizons: a crack this near to what is ahead of it goes straight on to it
FOLDED = 0.6  # of the length of a crack: where it is no further from a place behind, it has turned back on itself
RISES = 1.1  # times what a tip felt when cracks began to grow at rest: they run on by themselves
FORK = 2.0  # horizons of a branch until it turns and forks: before, it feels its sibling's field more than its own


class Growth:
    """The cracks of a run, and the operator whose bonds they cut."""

    def __init__(self, model: Model, operator: Operator, filling: BondSource, drive: Drive, every: int | None) -> None:
        """`every` is the number of steps between checks; None: at rest, on request.

        Raises ModelError if no crack can grow.
        """
        self.every, self.rules = every, model.settings.run.particles
        self._model, self._operator, self._no_fail = model, operator, unbreakable(model)
        self._held = constrained_components(drive)
        self._ground, self._sight = CrackedPlate(model), Sight(model.grid, model.name)
        self._near = Surroundings(model, operator, filling.area, every is None)
        self.particles = of_segments(model.grid.cracks, self._ground.slack)
        self._long = float(model.horizons.max() / (model.grid.delta.min() * self.rules.spacing))
        self._round = Round(model, self._near, filling) if model.materials[0].detour is not None else None
        self._first, self._remarks = len(self.particles.place), dict[str, str]()
        self._began = _Began(-1, 0.0, 0)
        tips = tips_of(self.particles, self._ground)
        if not tips:
            raise ModelError(f"{model.name}: $.notch: no tip of a crack is inside the plate; add one that can grow")
        for tip in tips if self.rules.criterion == "intensity" else ():
            refused = self._too_small(tip, tips)
            if refused:
                raise ModelError(f"{model.name}: $.notch: {refused}")

    def look(self, state: State, step: int) -> bool:
        """Let cracks grow from a state, as of `step`; returns whether any did."""
        judged = self.evaluate_tips(state)
        due = [(tip, verdict) for tip, verdict in judged if verdict.share >= 1]
        new = self.grow_tips_and_cut_bonds(due, state, step)
        if new and self.every is None:
            # Cracks at rest that run unstably: the farther they run, the larger the driving force
            share = max(verdict.share for _, verdict in judged)
            began = self._began if self._began.step == step else _Began(step, share, 0)
            self._began = began = began._replace(particles=began.particles + new)
            if began.particles > self._long and share > RISES * began.share:
                message = f"cracks run on under the same load: after {began.particles} particles a tip feels"
                message += f" {share:.3g} of what lets it grow, at first {began.share:.3g}"
                expected = "load steps follow stable growth only; their path from there on is not known in"
                self.add_warning_once("runs", f"load step {step}: {message}; {expected} quasi-static analysis")
        return new > 0

    def evaluate_tips(self, state: State) -> list[tuple[Tip, Verdict]]:
        """All tips, and what is decided about them in a state."""
        tips = tips_of(self.particles, self._ground)
        return [(tip, self.judge(tip, tips, state)) for tip in tips]

    def grow_tips_and_cut_bonds(
        self, evaluated_tips: list[tuple[Tip, Verdict]], state: State, step: int, length_share: float = 1.0
    ) -> int:
        """Let these tips grow by a particle each, of that share of its length, and cut the bonds; returns the number of
        new particles."""
        before = len(self.particles.place)
        for tip, verdict in evaluated_tips:
            self._grow(tip, verdict, step, length_share)
        new = len(self.particles.place) - before
        if new:
            self._cut(arms(self.particles)[-new:], state, step)
        return new

    def growth_length(self, tip: Tip, length_share: float = 1.0) -> float:
        """The length, m, by which a tip grows at once, or a share of it; a spacing at least."""
        return max(length_share * self.rules.spacing, 1.0) * float(
            self._model.grid.delta[self._near.nearest(tip.place)]
        )

    def toughness(self, tip: Tip) -> float:
        """What the stress intensity of a tip must reach, Pa m^0.5."""
        row = self._near.nearest(tip.place)
        plate, G0 = self._near.plate(row), self._model.node_values("G0")[row]
        return self.rules.toughness or float(np.sqrt(plate.effective_modulus * G0))

    def judge(self, tip: Tip, tips: list[Tip], state: State) -> Verdict:
        """Decide about a tip, one of all `tips`, in a state."""
        horizon, rules = self._horizon(tip), self.rules
        if rules.criterion == "stress":
            sampled = self._near.sampled(state, self._near.rows(tip.place, AHEAD * horizon))
            young = tip.forked and tip.length < FORK * horizon
            verdict = by_stress(sampled, tip.place, self._way(tip), horizon, rules, not young)
            return verdict._replace(angles=(0.0,)) if young and verdict.angles else verdict
        room, what = self._room(tip, tips)
        plate, toughness = self._near.plate(self._near.nearest(tip.place)), self.toughness(tip)
        if room >= LEAST * horizon:
            ring = Ring(BLURRED * horizon, min(RING * horizon, OUTER * room))
        elif what == ACTED_ON:
            self.add_warning_once(f"room {tip.particle}", f"{self._too_small(tip, tips)}; it stays there")
            return Verdict(0.0, ())
        elif self._ground.ahead(tip.place, self._way(tip), CLOSE * horizon, arms(self.particles)):
            return Verdict(1.0, (0.0,), straight=True)
        else:
            ring = Ring(OUTER * room * BLURRED / RING, OUTER * room)
        sampled = self._near.sampled(state, self._near.rows(tip.place, ring.outer))
        if room >= LEAST * horizon:
            return by_intensity(sampled, tip.place, self._way(tip), ring, plate, toughness)
        return by_release(sampled, tip.place, self._way(tip), ring, plate, toughness)

    def _grow(self, tip: Tip, verdict: Verdict, step: int, share: float) -> None:
        """Add particles ahead of a tip."""
        rules, way, length = self.rules, self._way(tip), self.growth_length(tip, share)
        for angle in verdict.angles:
            if rules.most is not None and len(self.particles.place) - self._first >= rules.most:
                reached = f"a crack would go on from {_at(tip.place)} after {rules.most} particles, and stops there"
                self.add_warning_once("most", f"step {step}: {reached}; a larger run.particles.most lets it grow")
                return
            toward = float(np.arctan2(way[1], way[0])) + angle
            place = self._ground.end(tip.place, toward, length, arms(self.particles))
            line, at = [place], tip.particle
            while self.particles.step[at] > 0:
                line.append(self.particles.place[at])
                at = int(self.particles.parent[at])
            line.append(self.particles.place[at])
            points = np.array(line)
            along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
            straight = np.hypot(*(points - place).T)
            if bool(((along > BLURRED * self._horizon(tip)) & (straight < FOLDED * along)).any()):
                self.add_warning_once(
                    f"folds {tip.particle}",
                    f"step {step}: a crack turns back on itself at {_at(tip.place)}, and stops there",
                )
                return
            self.particles = grown(self.particles, place, tip.particle, step)

    def _cut(self, new: NDArray[np.float64], state: State, step: int) -> None:
        """Cut the bonds that cross new arms (k, 4)."""
        operator, near, model = self._operator, self._near, self._model
        reach = 1.5 * float(model.horizons.max()) + float(np.hypot(*(new[:, 2:] - new[:, :2]).T).max())
        rows = np.unique(np.concatenate([near.rows((arm[:2] + arm[2:]) / 2, reach) for arm in new]))
        numbers = near.bonds(rows)
        pairs = near.pairs(numbers)
        cut = numbers[self._sight.parted(pairs, new) & ~(self._no_fail[pairs.source] | self._no_fail[pairs.target])]
        share = None
        if self._round is not None:
            share = self._round.share(arms(self.particles))
            cut = np.flatnonzero(near.intact & (share == 0))  # those that the way round is too far for now, too
        if not len(cut) and share is None:
            return
        strain_energy, pulled = operator.energies(state)[0], force_densities(operator, state)
        new_broken = Broken(np.full(len(cut), step), near.source[cut], near.target[cut])
        broken = Broken(*(np.concatenate(both) for both in zip(operator.broken(), new_broken, strict=True)))
        operator.restore(operator.checkpoint_arrays(), broken)
        near.intact[cut] = False
        self._reweigh(share)
        state.dissipated[:] += strain_energy - operator.energies(state)[0]
        if self.every is not None:  # the next half step goes without the forces that are lost
            lost = (force_densities(operator, state) - pulled) / model.rho[:, None]
            lost[:, :2][self._held] = 0
            state.second[:] += lost.astype(state.second.dtype)

    def _reweigh(self, share: NDArray[np.float64] | None) -> None:
        """Set the weights of bonds to shares (b,) of their initial weights; None restores all that are intact."""
        if share is not None:
            assert isinstance(self._operator, BondList)
            self._operator.reweigh(np.where(self._near.intact & (share > 0), share, 1.0))

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Particles for a checkpoint."""
        remarks = np.frombuffer(json.dumps(self._remarks).encode(), dtype=np.uint8)
        columns = {name: column.copy() for name, column in self.particles._asdict().items()}
        return {f"particle_{name}": column for name, column in {**columns, "remarks": remarks}.items()}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], broken: Broken) -> None:
        """Restore a checkpoint with these broken bonds. Raises CheckpointError."""
        first, position = self._first, self._model.grid.position
        far = float(np.abs(position).max() + self._model.grid.delta.max())
        step = entry(checkpoint, "particle_step", (None,), np.int64, 0, MOST_STEPS)
        place = entry(checkpoint, "particle_place", (len(step), 2), float, -far, far)
        normal = entry(checkpoint, "particle_normal", (len(step), 2), float, -2, 2)
        parent = entry(checkpoint, "particle_parent", (len(step),), np.int64, -1, len(step) - 1)
        particles = self.particles
        same = np.array_equal(parent[:first], particles.parent[:first]) and np.array_equal(
            place[:first], particles.place[:first]
        )
        if not same or step[:first].any():
            raise CheckpointError(f"particles are not the {first} of pre-cracks first")
        later = np.arange(first, len(step))
        if ((parent[first:] < 0) | (parent[first:] >= later) | (step[first:] < 1)).any() or (np.diff(step) < 0).any():
            raise CheckpointError("a particle grew from none or a later one; it must grow from one before it")
        particles = Particles(place, normal, parent, step)
        letters = entry(checkpoint, "particle_remarks", (None,), np.uint8).tobytes()
        try:
            self.particles, self._remarks = particles, msgspec.json.decode(letters, type=dict[str, str])
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise CheckpointError("'particle_remarks' are none; they must be texts with names") from None
        near, nodes = self._near, len(self._near.start) - 1
        near.intact[:] = ~np.isin(near.source * nodes + near.target, broken.source * nodes + broken.target)
        if self._round is not None:
            self._reweigh(self._round.share(arms(self.particles)))

    def rows(self, after: int) -> list[tuple[float, ...]]:
        """Particles created after a step, as rows of results."""
        place, normal, parent, step = self.particles
        numbers = np.flatnonzero(step > after)
        columns = numbers, step[numbers], parent[numbers], *place[numbers].T, *normal[numbers].T
        return list(zip(*(column.tolist() for column in columns), strict=True))

    def _horizon(self, tip: Tip) -> float:
        """The horizon of the node nearest to a tip, m."""
        return float(self._model.horizons[self._near.nearest(tip.place)])

    def _way(self, tip: Tip) -> NDArray[np.float64]:
        """Unit vector (2,) of a tip's direction, from the inner radius of its ring, or from a horizon behind it."""
        return tip.way((BLURRED if self.rules.criterion == "intensity" else 1.0) * self._horizon(tip))

    def _room(self, tip: Tip, tips: list[Tip]) -> tuple[float, str]:
        other_tips = [np.tile(candidate.place, 2) for candidate in tips if candidate is not tip]
        every = arms(self.particles)
        gaps = every.reshape(-1, 2, 1, 2) - tip.back
        is_own_arm = (np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=2) <= self._ground.slack).all(axis=1)
        return self._ground.room(
            tip.place, np.vstack([every[~is_own_arm], *other_tips]) if other_tips else every[~is_own_arm]
        )

    def _too_small(self, tip: Tip, tips: list[Tip]) -> str:
        """Why a tip has no room for a ring; "" if it has."""
        radius, what = self._room(tip, tips)
        least = LEAST * self._horizon(tip)
        if radius >= least:
            return ""
        spacing = float(self._model.grid.delta[self._near.nearest(tip.place)]) * radius / least
        unit = 10.0 ** (np.floor(np.log10(spacing)) - 1) if radius > 0 else 1.0  # two digits, rounded down
        finer = f"; nodes {np.floor(spacing / unit) * unit:.2g} m apart or less have it" if radius > 0 else ""
        return (
            f"{what} is {radius:.3g} m from the tip at {_at(tip.place)};"
            f" it needs room of {LEAST:g} horizons, {least:.3g} m{finer}"
        )

    @property
    def remarks(self) -> list[str]:
        """Remarks to be read together with the crack paths."""
        return list(self._remarks.values())

    def add_warning_once(self, key: str, text: str) -> None:
        """Add a remark, once."""
        if key not in self._remarks:
            self._remarks[key] = text
            warnings.warn(f"{self._model.name}: {text}", ModelWarning, stacklevel=2)


class _Began(NamedTuple):
    """State of crack growth at the beginning of a load step."""

    step: int
    share: float  # of what lets a tip grow, the largest then
    particles: int  # since


def _at(place: NDArray[np.float64]) -> str:
    x, y = place
    return f"({x:.4g}, {y:.4g}) m"


def every_of(model: Model, step: float) -> int:
    """Steps of `step` s between checks: a crack that grows at every check runs at the Rayleigh speed, the upper
    limit."""
    speeds = [
        rayleigh_speed(material.E, material.rho, material.plane, poisson(material)) for material in model.materials
    ]
    fastest = max(speeds)
    if model.grid.fields:
        stiffness = np.array([material.E / material.rho for material in model.materials])[model.material_of]
        faster = np.sqrt(model.node_values("E") / model.node_values("rho") / stiffness)
        fastest = float((np.array(speeds)[model.material_of] * faster).max())
    shortest = model.settings.run.particles.spacing * float(model.grid.delta.min())
    return max(1, int(np.ceil(shortest / (fastest * step))))
