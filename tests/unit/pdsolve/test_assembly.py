"""What takes the steps of a content."""

from __future__ import annotations

from diffusion_models import disc

from pdsolve.options import Options
from pdsolve.run.assembly import make_diffusion_stepper
from pdsolve.run.prepare import prepare
from pdsolve.steppers.euler import ForwardEuler


def test_a_content_on_the_processor_is_taken_there() -> None:
    system, state = prepare(disc(0.25, 400), Options(threads=1))
    assert system.transport is not None
    taken = make_diffusion_stepper(system.model, system.transport, state, None)
    assert isinstance(taken, ForwardEuler)
    assert taken is system.transport.stepper
