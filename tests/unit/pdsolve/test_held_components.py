"""One held component of the motion: what it is set to at the end of a step, and from where."""

from __future__ import annotations

import numpy as np
import pytest

from pdsolve.conditions import DISPLACEMENT, VELOCITY, Entries, Profiles, prescribe_held_u_and_v

U, V, A, DT = 0.3, 2.0, 4.0, 0.1  # m, m/s, m/s^2, s: after the drift of a step
RAMP = Profiles(np.array([0, 2]), np.array([0.0, 1.0]), np.array([0.0, 1.0]))


@pytest.mark.parametrize(
    ("kind", "value", "speed", "place"),
    [
        (DISPLACEMENT, 0.8, (0.8 * 0.5 - (U - DT * V)) / DT, 0.8 * 0.5),  # the profile's factor at 0.5 s
        (VELOCITY, 3.0, 3.0 * 0.45, U - DT * V + DT * 3.0 * 0.45),  # and half a step before
    ],
)
def test_a_held_component_goes_on_from_where_it_was_before_the_step(
    kind: int, value: float, speed: float, place: float
) -> None:
    u, v, a = (np.full((2, 2), each) for each in (U, V, A))
    held = np.zeros(1)
    one = {"node": 1, "axis": 0, "value": value, "profile": 0, "kind": kind, "condition": 0}
    holds = Entries(**{name: np.array([each]) for name, each in one.items()})
    prescribe_held_u_and_v.py_func(u, v, a, holds, RAMP, held, 0, DT, 0.5)
    assert held[0] == pytest.approx(V - DT / 2 * A)  # of the half step before
    assert v[1, 0] == pytest.approx(speed)
    assert u[1, 0] == pytest.approx(place)
    assert (u[0] == U).all()
    assert (v[:, 1] == V).all()
