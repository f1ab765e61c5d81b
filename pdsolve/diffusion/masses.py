"""Amounts of a substance, where they have gone, and the accounts of a run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pdmesh.model.medium import amount_of
from pdsolve.diffusion.system import Transport
from pdsolve.errors import CheckpointError, UnstableError
from pdsolve.results import FrameRecord, Results
from pdsolve.state import State

AMOUNTS = ("inside", "through", "supplied")


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


class MassAccounts:
    """The mass accounts of one run; see `pdsolve.run.accounts.Accounts`."""

    broken_directed_bond_count = last_break_step = 0  # bonds do not break

    def __init__(self, transport: Transport, state: State, step: int, results: Results | None) -> None:
        """`results` are those of a resumed run after `step`, else None."""
        self._transport, self._state = transport, state
        start = None if results is None else results.masses()
        if start is not None and not len(start):
            raise CheckpointError("masses at the start are missing")
        self._start = masses(transport, state, step, None) if start is None else Masses(*start[0])
        self.last = masses(transport, state, step, self._start.solid)
        self._rows: list[Masses] = []

    @property
    def balance_error(self) -> float:
        """Relative error of the mass balance: amount created, over the amount present or supplied."""
        return self.last.balance(self._start)

    def progress_text(self, broken_directed_bond_count: int) -> str:
        """State of the balance in words, for a progress display."""
        dissolved = f"{1 - self.last.solid / self._start.solid:.1%} dissolved, " if self._start.solid else ""
        return f"{dissolved}balance {self.balance_error:+.1e}"

    def follow(self, system: object) -> None:
        """Does nothing, as nodes do not change."""

    def evaluate(self, step: int) -> None:
        """Evaluate the balance at this step, unless it is the last entry."""
        if self.last.step != step:
            self.last = masses(self._transport, self._state, step, self._start.solid)

    def record(self, step: int) -> None:
        """Record the masses after this step. Raises UnstableError."""
        content, transport = self._state.value[:, 0], self._transport
        if not np.isfinite(content).all():
            worst = int((~np.isfinite(content)).argmax())
            raise UnstableError(
                f"unstable at step {step} ({step * transport.time_step:.4g} s, node"
                f" {transport.model.grid.ids[worst]}): its content is {content[worst]}; reduce run.time_step"
            )
        self.evaluate(step)
        self._rows.append(self.last)

    def move_rows_into(self, frame: FrameRecord) -> FrameRecord:
        """The frame with the rows since the last one."""
        rows, self._rows = self._rows, []
        return frame._replace(masses=rows)

    def metadata(self) -> dict[str, Any]:
        """Metadata of the results about the physics."""
        return {"physics": "diffusion"}

    def summary(self) -> dict[str, Any]:
        """Results of the run for its summary."""
        start, transport = self._start, self._transport
        factor, unit = amount_of(transport.operator.medium, transport.model.grid.dimension)
        return {
            "physics": "diffusion",
            "bonds": int(self._transport.operator.count.sum()),
            "method": self._transport.stepper.name,
            "masses": self.last._asdict(),
            "amounts": {name: factor * getattr(self.last, name) for name in AMOUNTS} | {"unit": unit},
            "dissolved_share": 1 - self.last.solid / start.solid if start.solid else None,
            "balance": self.balance_error,
        }

    def warn_at_end(self) -> None:
        """Does nothing: there are no closing warnings."""
