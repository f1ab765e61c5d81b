"""Integrals around a tip against fields whose J, K and T are known; no bond is in them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from plates import square_grid

from pdsolve.fracture.domain_integrals import Ring, Sampled, SampledMotion, integrals, kink, weight
from pdsolve.fracture.fields import Elastic, TipField, intensities, pushed

STRESS, STRAIN = Elastic(3.0, 0.3, "stress"), Elastic(3.0, 0.3, "strain")


def hookes(plate: Elastic, stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Strains (n, 3) of stresses (n, 3)."""
    nu = plate.nu if plate.plane == "stress" else plate.nu / (1 - plate.nu)
    xx, yy, xy = stress.T
    return np.column_stack([xx - nu * yy, yy - nu * xx, (1 + nu) * xy]) / plate.effective_modulus


def square(fineness: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places (n, 2) and areas (n,) of a lattice on a square from -1 to 1, the crack between two rows of it."""
    grid = square_grid(2 * fineness, 2 * fineness, 1 / fineness, 0.5 / fineness - 1, 0.5 / fineness - 1)
    return grid.position, np.full(len(grid), fineness**-2.0)


def state(field: TipField, plate: Elastic, area: NDArray[np.float64], place: NDArray[np.float64]) -> Sampled:
    """A field at rest, its gradient completed by Hooke's law."""
    strain = hookes(plate, field.stress)
    across = np.column_stack([2 * strain[:, 2] - field.slope[:, 1], strain[:, 1]])
    return Sampled(place, area, np.stack([field.slope, across], axis=2), strain, field.stress)


@pytest.mark.parametrize("plate", [STRESS, STRAIN], ids=["stress", "strain"])
@pytest.mark.parametrize("turned", [0.0, 0.6, 2.5])
def test_a_field_of_known_intensities(plate: Elastic, turned: float) -> None:
    """K1, K2 and T come back and J is theirs, whichever way the crack goes; the sum over squares is all that is off."""
    place, area = square(40)
    z = place[:, 0] + 1j * place[:, 1]
    K1, K2, T = 1.3, -0.7, 0.9
    field = intensities(z, plate, K1, K2)
    along = np.column_stack([np.full(len(z), T), np.zeros((len(z), 2))])
    field = TipField(field.stress + along, field.slope + np.array([T / plate.effective_modulus, 0.0]))
    at = state(field, plate, area, place)
    c, s = np.cos(turned), np.sin(turned)
    back = np.array([[c, -s], [s, c]])
    matrices = [
        back @ np.stack([e[:, 0], e[:, 2], e[:, 2], e[:, 1]], axis=-1).reshape(-1, 2, 2) @ back.T
        for e in (at.strain, at.stress)
    ]
    strain, stress = (np.column_stack([m[:, 0, 0], m[:, 1, 1], m[:, 0, 1]]) for m in matrices)
    tip = np.array([0.3, -5.0])
    at = Sampled(place @ back.T + tip, area, back @ at.gradient @ back.T, strain, stress)
    found = integrals(at, tip, back[:, 0], Ring(0.3, 0.9), plate)
    off = np.array([found.K1 - K1, found.K2 - K2, found.T - T, found.J * plate.effective_modulus / (K1**2 + K2**2) - 1])
    assert np.abs(off).max() < 2e-4  # measured 7e-5, 3e-5, 1.1e-4, 6e-5
    assert found.angle == kink(found.K1, found.K2)


@pytest.mark.parametrize(
    "which", [lambda z, plate: intensities(z, plate, 1.0, -2.0), lambda z, plate: pushed(z, plate, 1.0)]
)
@pytest.mark.parametrize("plate", [STRESS, STRAIN], ids=["stress", "strain"])
def test_auxiliary_fields_are_solutions(which, plate: Elastic) -> None:  # type: ignore[no-untyped-def]
    """Stresses balance, du/dx is Hooke's exx, dv/dx belongs to the same displacement, and the faces are free."""
    rng, step = np.random.default_rng(2), 1e-5
    z = rng.uniform(0.5, 1.5, 40) * np.exp(1j * rng.uniform(-3, 3, 40))
    field = which(z, plate)
    by_x, by_y = (
        (np.array(which(z + h, plate).stress) - which(z - h, plate).stress) / (2 * step) for h in (step, 1j * step)
    )
    assert np.abs(by_x[:, 0] + by_y[:, 2]).max() < 1e-8
    assert np.abs(by_x[:, 2] + by_y[:, 1]).max() < 1e-8
    strain = hookes(plate, field.stress)
    assert field.slope[:, 0] == pytest.approx(strain[:, 0], abs=1e-12)
    turn = (which(z + 1j * step, plate).slope - which(z - 1j * step, plate).slope)[:, 1] / (2 * step)
    eyy = (hookes(plate, which(z + h, plate).stress)[:, 1] for h in (step, -step))
    assert turn == pytest.approx(np.subtract(*eyy) / (2 * step), abs=1e-8)  # v,xy of either
    faces = which(-np.linspace(0.1, 2, 9) + 1e-15j * np.array([1, -1, 1, -1, 1, -1, 1, -1, 1]), plate)
    assert np.abs(faces.stress[:, 1:]).max() < 1e-12


def test_a_wave_has_no_j() -> None:
    """A P wave that runs through the ring: nothing comes of it; what inertia adds is all that undoes the rest."""
    place, area = square(60)
    k, rho = 5.0, 2.0
    plate = STRAIN
    c11 = plate.E * (1 - plate.nu) / (1 + plate.nu) / (1 - 2 * plate.nu)
    omega = k * np.sqrt(c11 / rho)
    phase = k * place[:, 0] + 0.4
    zero = np.zeros(len(place))
    exx = k * np.cos(phase)
    u = np.sin(phase)
    gradient = np.stack([np.column_stack([exx, zero]), np.column_stack([zero, zero])], axis=1)
    stress = np.column_stack([c11 * exx, c11 * plate.nu / (1 - plate.nu) * exx, zero])
    motion = SampledMotion(
        rho,
        np.column_stack([-omega * np.cos(phase), zero]),
        np.column_stack([-(omega**2) * u, zero]),
        np.stack([np.column_stack([omega * k * np.sin(phase), zero]), np.column_stack([zero, zero])], axis=1),
    )
    at = Sampled(place, area, gradient, np.column_stack([exx, zero, zero]), stress)
    tip, way = np.zeros(2), np.array([1.0, 0.0])
    rest = integrals(at, tip, way, Ring(0.3, 0.9), plate).J
    moving = integrals(at._replace(motion=motion), tip, way, Ring(0.3, 0.9), plate).J
    assert abs(rest) > 1.0  # measured 5.9
    assert abs(moving) < 1e-10 * abs(rest)  # measured 4e-16


def test_a_standing_wave_beside_free_faces_has_no_intensity() -> None:
    """u = cos(k y) along the crack, which no face feels, swinging: K1 is 0 with what inertia adds, and not without."""
    place, area = square(60)
    k, rho, plate = 3.0, 2.0, STRAIN
    y, zero = place[:, 1], np.zeros(len(place))
    slope = -k * np.sin(k * y)
    gradient = np.stack([np.column_stack([zero, slope]), np.column_stack([zero, zero])], axis=1)
    strain = np.column_stack([zero, zero, slope / 2])
    swing = np.column_stack([-plate.shear * k**2 / rho * np.cos(k * y), zero])
    motion = SampledMotion(rho, np.zeros((len(y), 2)), swing, np.zeros((len(y), 2, 2)))
    at = Sampled(place, area, gradient, strain, 2 * plate.shear * strain)
    tip, way = np.zeros(2), np.array([1.0, 0.0])
    rest = integrals(at, tip, way, Ring(0.3, 0.9), plate)
    moving = integrals(at._replace(motion=motion), tip, way, Ring(0.3, 0.9), plate)
    assert abs(rest.K1) > 0.5  # measured 0.64
    assert abs(moving.K1) < 3e-3 * abs(rest.K1)  # measured 1.8e-3


def test_a_node_at_the_tip_does_no_harm() -> None:
    """The fields of a tip are infinite there; pytest takes a warning for an error."""
    place, area = square(20)
    field = intensities(place[:, 0] + 1j * place[:, 1], STRESS, 1.0, 0.5)
    at = state(field, STRESS, area, place)
    still = np.zeros((len(place) + 1, 2))
    more = [np.concatenate([column[:1], column]) for column in at[:5]]
    more[0][0] = 0.0
    motion = SampledMotion(1.0, still, still + 1e-9, np.zeros((len(still), 2, 2)))
    tip, way, ring = np.zeros(2), np.array([1.0, 0.0]), Ring(0.3, 0.9)
    with_it = integrals(Sampled(*more, motion), tip, way, ring, STRESS)
    assert with_it[:3] == pytest.approx(integrals(at, tip, way, ring, STRESS)[:3], rel=1e-6)


@pytest.mark.parametrize(
    ("K1", "K2", "angle"),
    [(1.0, 0.0, 0.0), (1.0, 1.0, -53.130), (1.0, -1.0, 53.130), (0.0, 1.0, -70.529), (0.0, -1.0, 70.529)],
)
def test_where_a_crack_turns_to(K1: float, K2: float, angle: float) -> None:
    assert kink(K1, K2) == pytest.approx(angle, abs=1e-3)
    assert np.isnan(kink(0.0, 0.0))


def test_the_weight_is_smooth_and_its_gradient_its_own() -> None:
    ring = Ring(0.4, 0.9)
    x = np.linspace(0.05, 1.2, 400)
    places = np.column_stack([x, 0.3 * x])
    q, slope = weight(places, ring)
    assert (q[np.hypot(*places.T) < 0.4] == 1).all()
    assert (q[np.hypot(*places.T) > 0.9] == 0).all()
    step = 1e-6
    for axis in (0, 1):
        moved = step * np.eye(2)[axis]
        number = (weight(places + moved, ring)[0] - weight(places - moved, ring)[0]) / (2 * step)
        assert number == pytest.approx(slope[:, axis], abs=1e-5)


@pytest.mark.parametrize(("K1", "K2"), [(1.0, 0.5), (1.0, -0.5), (0.3, 1.0), (0.0, -1.0)])
def test_a_crack_turns_to_where_the_hoop_stress_of_its_own_field_is_largest(K1: float, K2: float) -> None:
    """Sought on a circle around the tip, to the tenth of a degree it is looked at in; to the right where K2 is
    positive."""
    angle = np.radians(np.arange(-1790, 1791) / 10)
    xx, yy, xy = intensities(np.exp(1j * angle), STRESS, K1, K2).stress.T
    hoop = xx * np.sin(angle) ** 2 + yy * np.cos(angle) ** 2 - 2 * xy * np.sin(angle) * np.cos(angle)
    assert kink(K1, K2) == pytest.approx(np.degrees(angle[hoop.argmax()]), abs=0.06)
    assert np.sign(kink(K1, K2)) == -np.sign(K2)
