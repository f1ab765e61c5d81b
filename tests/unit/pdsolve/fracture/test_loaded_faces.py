"""J and stress intensities of cracks under pressure from exact fields, whose faces count."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pressure_cracks import NU, A, E, P, exact_of_line, exact_of_penny

from pdmesh.model.pressed_faces import area_vectors, pieces_of, rim_of
from pdsolve.fracture.domain_integrals import Ring, Sampled, integrals
from pdsolve.fracture.fields import Elastic
from pdsolve.fracture.front_integrals import FrontFieldSamples, FrontPlace, Tube, front_integrals
from pdsolve.fracture.loaded_faces import LoadedFaces


def gradients(exact: object, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement gradients (n, d, d) of a field at places (n, d)."""
    step, d = 1e-5 * A, x.shape[1]
    ways = [(exact(x + step * way) - exact(x - step * way)) / (2 * step) for way in np.eye(d)]  # type: ignore[operator]
    return np.stack(ways, axis=-1)


def pressed(faces: NDArray[np.float64], exact: object, around: NDArray[np.float64], h: float) -> LoadedFaces:
    """Faces, upper and lower ones, of a crack in y = 0 or z = 0, that move as a field has it."""
    size = np.full(len(around), h)
    pieces = pieces_of(tuple(map(tuple, faces.tolist())), around, size, size)
    outward, corners = area_vectors(pieces.corners, pieces.pieces), pieces.corners[pieces.pieces]
    beside = corners.copy()
    beside[..., -1] += np.where(outward[:, None, -1] < 0, 1e-9, -1e-9) * A
    moved = exact(beside.reshape(-1, beside.shape[-1])).reshape(beside.shape)  # type: ignore[operator]
    return LoadedFaces(corners, moved, -P * outward, outward, rim_of(pieces)[pieces.pieces])


def test_of_a_line_crack() -> None:
    h = A / 20
    along = (np.arange(-40, 40) + 0.5) * h
    x = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    H = gradients(lambda at: exact_of_line(*at.T), x)
    strain = np.column_stack([H[:, 0, 0], H[:, 1, 1], (H[:, 0, 1] + H[:, 1, 0]) / 2])
    stress = (
        E
        / (1 - NU**2)
        * np.column_stack([strain[:, 0] + NU * strain[:, 1], strain[:, 1] + NU * strain[:, 0], (1 - NU) * strain[:, 2]])
    )
    row = x[np.abs(x[:, 1]) < h]
    segments = np.array([[-A, 0, A, 0], [A, 0, -A, 0]])
    faces = pressed(segments, lambda at: exact_of_line(*at.T), row, h)
    at = Sampled(x, np.full(len(x), h**2), H, strain, stress)
    K, plate, tip = P * np.sqrt(np.pi * A), Elastic(E, NU, "stress"), np.array([A, 0.0])
    for ring in (Ring(0.3 * A, 0.7 * A), Ring(0.4 * A, 0.9 * A)):
        found = integrals(at, tip, np.array([1.0, 0.0]), ring, plate, faces)
        assert pytest.approx(K, rel=5e-3) == found.K1
        assert pytest.approx(K**2 / E, rel=0.01) == found.J
        assert abs(found.K2) < 1e-6 * K
        assert abs(found.T) < 0.02 * P  # none, as the pressure acts along the crack too
        suction = faces._replace(displacement=-faces.displacement, force=-faces.force)
        other = integrals(at._replace(gradient=-H, strain=-strain, stress=-stress), tip, tip / A, ring, plate, suction)
        assert pytest.approx(-found.K1) == other.K1
        assert integrals(at, tip, np.array([1.0, 0.0]), ring, plate).K1 < 0.6 * K  # without the faces


@pytest.mark.slow
@pytest.mark.parametrize("shifted", [0.0, 0.2, -0.2])
def test_of_a_penny(shifted: float) -> None:
    """The arc of the front may be a fifth of a spacing off the rim of the drawn faces."""
    h = A / 12
    along = (np.arange(-19, 19) + 0.5) * h
    x = np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3)
    row = x[(np.abs(x[:, 2]) < h) & (np.hypot(x[:, 0], x[:, 1]) < A + h)]
    x = x[np.linalg.norm(x - [A, 0, 0], axis=1) < 0.9 * A]
    H = gradients(exact_of_penny, x)
    strain = (H + H.transpose(0, 2, 1)) / 2
    stress = E / 2.5 * (np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 2 * strain)
    turn = np.linspace(0, 2 * np.pi, 97)
    rim = A * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    disc = np.array([(np.zeros(3), rim[k], rim[k + 1]) for k in range(96)])
    faces = pressed(np.concatenate([disc, disc[:, ::-1]]).reshape(-1, 9), exact_of_penny, row, h)
    radius = A + shifted * h
    place = FrontPlace(np.array([radius, 0, 0]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), 1 / radius)
    solid, K = Elastic(E, 0.25, "strain"), 2 * P * np.sqrt(A / np.pi)
    at = FrontFieldSamples(x, np.full(len(x), h**3), H, strain, stress)
    found = front_integrals(at, place, Tube(3 * h, 9 * h, 4.5 * h), solid, faces)
    assert pytest.approx(K, rel=0.013) == found.K1
    assert pytest.approx(K**2 / solid.effective_modulus, rel=0.025) == found.J
    assert front_integrals(at, place, Tube(3 * h, 9 * h, 4.5 * h), solid).K1 < 0.3 * K  # without the faces
