"""What there is of a substance, and where it has gone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.diffusion.dissolution import State, potential, solid_share
from pdsolve.diffusion.system import OWN, System


class Masses(NamedTuple):
    """The books of one step, a row of the table `mass`; of a plate, all per unit thickness."""

    step: int
    time: float  # s
    inside: float  # mol in nodes that are not held, what is solid counted
    through: float  # mol that has gone out through held nodes
    supplied: float  # mol
    solid: float  # m^d that is solid
    dissolved: float  # mol that was solid at the start and is not now
    surface: float  # m^(d - 1) of what is solid

    def balance(self, start: Masses) -> float:
        """What has appeared from nowhere since the start, over what there was or was supplied; 0 of nothing."""
        missing = self.inside + self.through - self.supplied - start.inside
        scale = max(start.inside, abs(self.supplied), abs(self.through))
        return missing / scale if scale else 0.0


def masses(system: System, state: State, step: int, solid_at_start: float | None) -> Masses:
    """The books after `step`; `solid_at_start` in m^d, None where this is the start."""
    medium, volume = system.model.settings.medium, system.operator.volume
    assert medium is not None
    solid, surface = 0.0, 0.0
    if medium.C_solid is not None:
        share = solid_share(medium, state)
        solid = float((volume * share).sum())
        surface = system.operator.contrast(share) / system.crossing
    gone = 0.0 if solid_at_start is None else (solid_at_start - solid) * (medium.C_solid or 0.0)
    inside = float((volume * state.content)[system.done.free].sum())
    through, supplied = state.books.tolist()
    return Masses(step, step * system.time_step, inside, through, supplied, solid, gone, surface)


def fields(system: System, state: State) -> dict[str, NDArray[np.float64]]:
    """What a frame holds of n nodes: what is dissolved, all there is, and the share that is solid."""
    medium, asked = system.model.settings.medium, system.model.settings.run.fields
    assert medium is not None
    found = {
        "c": potential(medium, state.content),
        "h": state.content,
        "solid": solid_share(medium, state),
    }
    chosen = [name for name in OWN if name in asked] or OWN
    return {name: found[name] for name in chosen}
