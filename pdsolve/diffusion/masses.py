"""Amounts of a substance, and where they have gone."""

from __future__ import annotations

from typing import NamedTuple

from pdsolve.diffusion.system import Transport
from pdsolve.state import State


class Masses(NamedTuple):
    """Mass balance of one step, a row of the table `mass`; for a plate, per unit thickness."""

    step: int
    time: float  # s
    inside: float  # mol in all nodes, what is solid counted
    through: float  # mol that has gone out through nodes whose content is prescribed
    supplied: float  # mol
    solid: float  # m^d that is solid
    dissolved: float  # mol that was solid at the start and is not now
    surface: float  # m^(d - 1) of what is solid

    def balance(self, start: Masses) -> float:
        """Amount created since the start over the amount present or supplied; 0 without any."""
        missing = self.inside + self.through - self.supplied - start.inside
        scale = max(start.inside, abs(self.supplied), abs(self.through))
        return missing / scale if scale else 0.0


def masses(transport: Transport, state: State, step: int, solid_at_start: float | None) -> Masses:
    """Mass balance after `step`; `solid_at_start` in m^d, None at the start.

    Nodes of prescribed content are of the body: what raises their content has come in through them.
    """
    medium, operator, volume = transport.operator.medium, transport.operator, transport.operator.volume
    solid, surface = 0.0, 0.0
    if medium.C_solid is not None:
        share = operator.share(state)
        solid = float((volume * share).sum())
        surface = operator.exchange.contrast(share) / transport.crossing
    dissolved = 0.0 if solid_at_start is None else (solid_at_start - solid) * (medium.C_solid or 0.0)
    amount = volume * state.value[:, 0]
    inside, prescribed_amount = float(amount.sum()), float(amount[~transport.free].sum())
    through, supplied = (float((volume * column).sum()) for column in (state.dissipated, state.work))
    through -= prescribed_amount - transport.held
    return Masses(step, step * transport.time_step, inside, through, supplied, solid, dissolved, surface)
