"""Displacements around the tip of a crack, as a boundary has them."""

from __future__ import annotations

from math import nan, pi, sqrt

import numpy as np
import pytest
from messages import naming

from pdmesh import Body, Box, Material, Scene, SceneError, box, build, k_field
from pdmesh.model.values_of_place import Table

E, G0, R = 65e9, 204.0, 0.01
GLASS = Material(E=E, rho=2235, G0=G0)
K = sqrt(E * G0)


def at(field: tuple[object, object], *place: float) -> list[float]:
    return [value(*place) for value in field]  # type: ignore[operator]


def test_a_plate_opens_as_in_the_reference() -> None:
    """K_c is 3.641428 MPa sqrt m; u in um, 10 mm from the tip, above and behind it; nu is 1/3."""
    assert pytest.approx(3.641428e6, rel=1e-6) == K
    field = k_field(GLASS, K)
    assert at(field, 0, R) == pytest.approx([4.21427e-6, 4.21427e-6], rel=1e-5)
    assert at(field, -R, 0.0) == pytest.approx([0, 8.93981e-6], rel=1e-5, abs=1e-12)
    assert at(field, -R, -1e-15) == pytest.approx([0, -8.93981e-6], rel=1e-5, abs=1e-12)


def test_faces_open_and_slide_by_the_intensities() -> None:
    """u = 8 K / E' sqrt(r / 2 pi) between both faces, of opening and of sliding, also in plane strain."""
    for plane, modulus in (("stress", E), ("strain", E / (1 - 0.25**2))):
        glass = Material(E=E, rho=2235, G0=G0, plane=plane)  # type: ignore[arg-type]
        opened, slid = (
            np.subtract(at(k_field(glass, *both), -R, 1e-15), at(k_field(glass, *both), -R, -1e-15))
            for both in ((1e6, 0.0), (0.0, 1e6))
        )
        apart = 8e6 / modulus * sqrt(R / (2 * pi))
        assert opened == pytest.approx([0, apart], rel=1e-9, abs=1e-15)
        assert slid == pytest.approx([apart, 0], rel=1e-9, abs=1e-15)


def test_a_field_turns_and_moves_with_its_tip() -> None:
    still = k_field(GLASS, K, 2e5, T=1e6)
    moving = k_field(
        GLASS, K, 2e5, T=1e6, tip=(1e-3, 2e-3), angle=90, speed=10, times=[0, 1e-3], profile=((0, 0.0), (1e-3, 2.0))
    )
    assert at(moving, 1e-3 - 3e-3, 2e-3 + 0.5e-2 + 5e-3, 0.5e-3) == pytest.approx(
        np.array([[0, -1], [1, 0]]) @ at(still, 5e-3, 3e-3)
    )
    tension = k_field(GLASS, 0, T=1e6)
    assert at(tension, 3e-3, 2e-3) == pytest.approx([3e3 / E, -2e3 / 3 / E])
    strained = k_field(Material(E=E, rho=2235, G0=G0, plane="strain"), 0, T=1e6)
    assert at(strained, 3e-3, 2e-3) == pytest.approx([3e3 * (1 - 0.25**2) / E, -2e3 * 0.25 * 1.25 / E])


def test_a_scene_samples_a_moving_field_over_time() -> None:
    plate = Scene(box(0, 0, 0.01, 0.01), 1e-3, GLASS)
    field = k_field(GLASS, K, tip=(0.005, 0.0055), speed=10, times=(0, 1e-4))
    (condition,) = build(plate.fix("top", *field)).settings.conditions
    assert isinstance(condition.y, Table)
    assert condition.y.times == (0.0, 1e-4)
    assert condition.y.values[:2] == pytest.approx([field[1](x, 0.01, 0.0) for x in (0.0, 1e-3)])


@pytest.mark.process
def test_a_body_is_in_plane_strain() -> None:
    field = k_field(GLASS, K, T=1e6)
    bar = Body(Box((0, 0, 0), (0.004, 0.004, 0.004)), 1e-3, Material(E=E, rho=2235, G0=G0, plane="space"))
    (condition,) = build(bar.fix("top", *k_field(bar.material, K), 0.0)).settings.conditions
    assert condition.x.values[0] != field[0](*condition.x.places[0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"K1": nan}, naming("k_field: K1", expected="finite")),
        ({"speed": 10.0}, naming("k_field", found="speed", expected="times")),
        ({"profile": ((0, 0), (1, 1))}, naming("k_field", found="profile", expected="times")),
    ],
)
def test_fields_that_cannot_be_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        k_field(GLASS, **{"K1": K} | changes)  # type: ignore[arg-type]


def test_an_orthotropic_ply_has_no_such_field() -> None:
    ply = Material(
        E=171e9, rho=1580, G0=100, model="correspondence", solid="orthotropic", E2=9e9, nu=0.32, G12=5e9, failure="none"
    )
    with pytest.raises(SceneError, match=naming("k_field", found="orthotropic")):
        k_field(ply, K)
