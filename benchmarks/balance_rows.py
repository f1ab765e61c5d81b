"""Energy balance and condition forces of a prepared run at a step, as its accounts compute them."""

from __future__ import annotations

from pdsolve.run.accounts import report_balance, sum_condition_forces
from pdsolve.run.measures import ConditionForceRow, EnergyBalanceRow, join_balance
from pdsolve.run.subdomain import team_of
from pdsolve.run.system import System
from pdsolve.state import State


def compute_energy_balance_row(system: System, state: State, step: int) -> EnergyBalanceRow:
    """The ledger entry after `step` in one process."""
    return join_balance([report_balance(team_of(system, state), step).balance], len(system.area))


def compute_condition_forces(system: System, state: State, step: int, time: float) -> list[ConditionForceRow]:
    """The forces of all conditions after `step`, at `time`, s, in one process."""
    return sum_condition_forces(team_of(system, state), step, time)
