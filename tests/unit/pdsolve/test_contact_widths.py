"""Half-widths of contact from the forces of pairs: those of Hertz's pressures at the nodes."""

from __future__ import annotations

import numpy as np
import pytest

from pdsolve.operators.contact.contact_widths import Pressed, round_widths


def pressed(half: tuple[float, ...], at: float = 0.0, bodies: tuple[int, int] = (0, 1), curved: bool = True) -> Pressed:
    """Pairs of spacing 1 under a strip of these half-widths in the plane, or an ellipse in space."""
    x = np.meshgrid(*[np.arange(-11.0, 12.0)] * len(half), indexing="ij")
    force = np.sqrt(np.maximum(1 - sum((along / way) ** 2 for along, way in zip(x, half, strict=True)), 0.0))
    place = np.stack([*(along[force > 0] + at for along in x), 0 * force[force > 0]], axis=1)
    first, second, one = (np.full(len(place), number) for number in (*bodies, 1.0))
    return Pressed(place, force[force > 0], one, first, second, np.full(len(place), curved))


@pytest.mark.parametrize("half", [(5.2,), (9.4,), (4.7, 9.4), (9.4, 4.7), (6.3, 6.3)])
def test_the_half_width_is_that_of_the_pressure(half: tuple[float, ...]) -> None:
    """The smaller one of an ellipse."""
    pairs = pressed(half)
    (width,) = round_widths(pairs).values()
    assert width.half == pytest.approx(min(half), rel=0.03)  # measured 1.027, 1.010, 1.009, 1.009, 1.002
    assert width.force == pytest.approx(pairs.force.sum())


def test_the_narrowest_place_of_two_bodies_counts_and_flat_faces_do_not() -> None:
    """A single pair has the width of a cell; places apart are not one contact, nor is a body with itself."""
    wide, single, other = pressed((5.2,)), pressed((0.5,), 40.0), pressed((9.4,), 80.0, (1, 2))
    parts = wide, single, other, pressed((0.5,), 120.0, curved=False), pressed((0.5,), 160.0, (1, 1))
    widths = round_widths(Pressed(*(np.concatenate(column) for column in zip(*parts, strict=True))))
    assert set(widths) == {(0, 1), (1, 2)}
    assert widths[0, 1].half == pytest.approx(np.sqrt(4 / 12))
    assert widths[0, 1].force == pytest.approx(wide.force.sum() + 1)
    assert widths[1, 2].half == pytest.approx(9.4, rel=0.03)
