"""Strain and stress against fields whose derivatives are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from messages import naming
from prescribed_results import MODEL, plate, results_of

from pdmesh.model.document import Material
from pdsolve.fracture import gradients
from pdsolve.measures import fields, strain
from pdsolve.results import ResultsError

H = np.array([[3e-3, -1e-3], [4e-3, 2e-3]])


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_the_gradient_of_an_affine_field_is_exact_at_edges_too(jitter: float) -> None:
    nodes, families = plate(jitter=jitter)
    found = gradients.gradients_of(nodes.position, nodes.area, nodes.position @ H.T + 1.0, *families)
    assert np.abs(found - H).max() < 1e-12


@pytest.mark.slow
def test_a_quadratic_field_is_exact_inside_and_of_first_order_at_edges() -> None:
    """On a uniform grid the odd moments of a whole family are nothing; at an edge they are not."""
    inner, outer = [], []
    for side, spacing in ((13, 1e-3), (25, 5e-4), (49, 2.5e-4)):
        nodes, families = plate(side, spacing)
        nodes = nodes._replace(area=np.full(len(nodes.ids), spacing**2))
        x, y = nodes.position.T
        found = gradients.gradients_of(nodes.position, nodes.area, np.column_stack([x * x + x * y, y * y]), *families)
        exact = np.stack([np.column_stack([2 * x + y, x]), np.column_stack([0 * x, 2 * y])], axis=1)
        error = np.abs(found - exact).max(axis=(1, 2)).reshape(side, side)
        inner.append(error[4:-4, 4:-4].max())
        outer.append(error.max())
    assert max(inner) < 1e-12
    assert np.log2(np.array(outer[:-1]) / outer[1:]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_cubic_field_is_of_second_order_inside() -> None:
    errors = []
    for side, spacing in ((13, 1e-3), (25, 5e-4), (49, 2.5e-4)):
        nodes, families = plate(side, spacing)
        nodes = nodes._replace(area=np.full(len(nodes.ids), spacing**2))
        x, y = nodes.position.T
        found = gradients.gradients_of(nodes.position, nodes.area, np.column_stack([x**3, x * y * y]), *families)
        error = np.abs(found[:, 0, 0] - 3 * x * x).reshape(side, side)
        errors.append(error[4:-4, 4:-4].max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.01)


def test_broken_bonds_do_not_count() -> None:
    """Two halves that move apart as rigid bodies have no strain once all bonds between them are broken."""
    nodes, families = plate()
    upper = nodes.position[:, 1] > 5.5e-3
    u = np.where(upper, 1e-4, -1e-4)[:, None] * np.array([0.25, 1.0])
    own = np.repeat(np.arange(169), np.diff(families.start))
    between = upper[own] != upper[families.neighbour]
    pairs = [
        (5, int(nodes.ids[i]), int(nodes.ids[j]))
        for i, j in zip(own[between], families.neighbour[between], strict=True)
    ]
    whole = fields.field_values(results_of(nodes, families, u, []), "strain", 10)
    torn = fields.field_values(results_of(nodes, families, u, pairs), "strain", 10)
    late = fields.field_values(results_of(nodes, families, u, [(11, *pair[1:]) for pair in pairs]), "strain", 10)
    assert np.abs(whole).max() > 1e-2
    assert np.abs(torn).max() < 1e-9
    assert np.array_equal(late, whole)


def test_a_node_whose_bonds_are_gone_or_on_a_line_has_no_strain() -> None:
    nodes, families = plate(5)
    first, second = 0, 12  # the corner keeps a bond to the right and one twice as far
    own = np.repeat(np.arange(25), np.diff(families.start))
    gone = [
        (1, int(nodes.ids[i]), int(nodes.ids[j]))
        for i, j in zip(own, families.neighbour, strict=True)
        if i == second or (i == first and j not in (1, 2))
    ]
    found = fields.field_values(results_of(nodes, families, nodes.position @ H.T, gone), "strain", 10)
    assert np.flatnonzero(np.isnan(found)).tolist() == [first, second]


def test_turning_a_plate_does_not_strain_it() -> None:
    nodes, families = plate()
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    gradient = np.tile(turn - np.eye(2), (169, 1, 1))
    assert np.abs(gradients.green(gradient)).max() < 1e-15
    found = fields.field_values(results_of(nodes, families, nodes.position @ (turn - np.eye(2)).T, []), "strain", 10)
    assert np.abs(found).max() < 1e-6  # displacements are stored in single precision


def test_greens_strain_of_a_simple_shear() -> None:
    """u = (g y, 0): xy is g / 2 and yy g^2 / 2."""
    gradient = np.array([[[0.0, 0.2], [0.0, 0.0]]])
    assert gradients.green(gradient)[0] == pytest.approx([0.0, 0.02, 0.1])


@pytest.mark.parametrize(("plane", "nu"), [("stress", 1 / 3), ("strain", 1 / 4)])
def test_hookes_law(plane: str, nu: float) -> None:
    """Pulled along x, free across: E times the strain in plane stress, E / (1 - nu^2) in plane strain."""
    effective = nu if plane == "stress" else nu / (1 - nu)
    modulus = 70e9 if plane == "stress" else 70e9 / (1 - nu**2)
    pulled = np.array([[1e-3, -effective * 1e-3, 0.0], [0.0, 0.0, 1e-3]])
    stress = gradients.hooke(pulled, gradients.Stiffness(np.full(2, 70e9), np.full(2, nu), plane))
    out = 0.0 if plane == "stress" else nu * modulus * 1e-3
    assert stress[0] == pytest.approx([modulus * 1e-3, 0.0, 0.0, out], abs=1e-3)
    assert stress[1] == pytest.approx([0.0, 0.0, 70e9 / (1 + nu) * 1e-3, 0.0], abs=1e-3)


def test_principal_and_equivalent_stress() -> None:
    """Pure shear of t: principal stresses t and -t, von Mises t times the root of 3."""
    nodes, families = plate()
    g = 1e-6
    u = nodes.position @ np.array([[0.0, g], [g, 0.0]])
    found = fields.all_field_components(results_of(nodes, families, u, []), "stress", 10)
    t = 70e9 / (1 + 1 / 3) * g
    assert found["xy"] == pytest.approx(t, rel=1e-4)
    assert found["largest"] == pytest.approx(t, rel=1e-4)
    assert found["smallest"] == pytest.approx(-t, rel=1e-4)
    assert found["mises"] == pytest.approx(np.sqrt(3) * t, rel=1e-4)


def test_regions_have_their_own_stiffness() -> None:
    """Named by ids or by a box; the last that holds a node counts."""
    nodes, families = plate(3)
    other = {"E": 1.0, "rho": 1.0, "G0": 1.0, "plane": "strain"}
    model = {
        "material": {**MODEL["material"], "plane": "strain"},  # type: ignore[dict-item]
        "regions": [{"material": other, "nodes": [3, 6]}, {"material": {**other, "E": 2.0}, "box": [0, 0, 0, 2e-3]}],
    }
    modulus, nu, plane, _ = strain.elastic_constants_of_nodes(
        results_of(nodes, families, np.zeros((9, 2)), [], model), 0
    )
    assert plane == "strain"
    assert set(nu.tolist()) == {0.25}
    assert modulus.tolist() == [2.0, 1.0, 70e9, 2.0, 70e9, 70e9, 2.0, 70e9, 70e9]


def test_a_model_without_material_is_said() -> None:
    nodes, families = plate(3)
    with pytest.raises(ResultsError, match=naming("memory", found=("model", "missing"))):
        strain.elastic_constants_of_nodes(results_of(nodes, families, np.zeros((9, 2)), [], {"nodes": []}), 0)


@pytest.mark.parametrize(("columns", "stress"), [(4, (7.0, 0.0, 0.0, 0.0)), (6, (1.0, 1.0, 1.0, 0.0, 0.0, 2.0))])
def test_the_work_of_the_stress_is_elastic_and_plastic(
    columns: int, stress: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """E = 10, nu = 1/4: s^2 / 2 E of a bar; p^2 / 2 K and t^2 / 2 G of pressure and shear. One node has flowed."""
    steel = Material(
        E=10.0, rho=1.0, G0=1.0, nu=0.25, model="correspondence", solid="j2", yield_stress=5.0, hardening=2.0
    )
    constants = (lambda name: np.full(2, getattr(steel, name)), (steel,))
    monkeypatch.setattr(strain, "constants_of_nodes", lambda results, step: constants)
    stored = dict(zip(("sxx", "syy", "szz", "sxy", "sxz", "syz"), np.outer(stress, np.ones(2)), strict=False))
    flowed = np.array([0.0, 1.0])
    monkeypatch.setattr(strain, "scalar", lambda results, name, step: flowed)
    results = SimpleNamespace(dimension=2 if columns == 4 else 3, field=lambda name, step: stored[name])
    elastic = {4: 49 / 20, 6: 1 / (2 * 20 / 3) + 4 / (2 * 4)}[columns]
    assert strain.stress_work_if_yielded(results, 1) == pytest.approx([elastic, elastic + 5.0 + 2.0 / 2])  # type: ignore[arg-type]
    flowed[1] = 0.0
    assert strain.stress_work_if_yielded(results, 1) is None  # type: ignore[arg-type]
