"""Chooses what takes the explicit steps of a motion: a device, one sweep with the forces of blocks, or Verlet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive
from pdsolve.diffusion.euler_on_device import EulerOnDevice
from pdsolve.diffusion.system import Transport
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.device.runtime import Session
from pdsolve.operators.protocol import Operator
from pdsolve.ranks.diffusing import EulerOnRanks
from pdsolve.run.operator_factory import in_blocks
from pdsolve.state import State
from pdsolve.steppers.ghosts import Ghosts
from pdsolve.steppers.protocol import Stepper
from pdsolve.steppers.verlet import Verlet
from pdsolve.steppers.verlet_blocks import VerletBlocks
from pdsolve.steppers.verlet_on_device import OnDevice, VerletOnDevice


class Beside(NamedTuple):
    """What a window of a model has to do with other ranks."""

    ghosts: Ghosts
    damping: NDArray[np.float64]  # (n,) 1/s, of layers that may reach beyond the window
    damps: bool  # whether a node of any rank is damped


def stepper_of(
    operator: Operator,
    state: State,
    drive: Drive,
    rho: NDArray[np.floating],
    dt: float,
    damping: NDArray[np.float64],
    beside: Beside | None = None,
) -> tuple[Stepper, Drive]:
    """What takes steps of `dt`, s, of a placed state, and its conditions; `rho` (n,), kg/m^3, `damping` (n,), 1/s.

    `beside` is what a window has to do with other ranks.
    """
    ghosts, damps = (None, bool(damping.any())) if beside is None else (beside.ghosts, beside.damps)
    if isinstance(operator, OnDevice):
        return VerletOnDevice((operator, state, drive), rho, dt, damping), drive
    blocks, touching = in_blocks(operator)
    if blocks and not damps:
        fused = VerletBlocks(blocks, drive, rho, dt, touching, ghosts)
        return fused, fused.drive
    return Verlet(operator, drive, rho, dt, damping, ghosts), drive


def stepper_of_content(model: Model, transport: Transport, state: State, team: Team | None) -> Stepper:
    """What takes the steps of a transport through a model, on the ranks of a team if there is one."""
    device = model.settings.run.device
    if device != "cpu":
        return EulerOnDevice(transport.operator, state, transport.drive, transport.time_step, Session(device))
    if team is None:
        return transport.stepper
    return EulerOnRanks(model, team, transport.operator, transport.drive, transport.time_step)
