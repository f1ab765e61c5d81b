"""What takes steps on a device, of a motion or of a content."""

from __future__ import annotations

from pdsolve.diffusion.euler_on_device import EulerOnDevice
from pdsolve.steppers.protocol import Stepper
from pdsolve.steppers.verlet_on_device import VerletOnDevice

OnDevice = VerletOnDevice | EulerOnDevice


def fetch(stepper: Stepper) -> None:
    """Bring the state of a system up to the steps taken, if a device takes them."""
    if isinstance(stepper, OnDevice):
        stepper.fetch()
