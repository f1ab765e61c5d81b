"""Strain, stress and lines of bodies against fields that are known everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from prescribed_results import block, results_of

from pdsolve.fracture.gradients import gradients_of
from pdsolve.measures import fields
from pdsolve.measures.lines import sample_field_along_line
from pdsolve.results import Families, Nodes, ResultsError

H = np.array([[3e-3, -1e-3, 2e-3], [4e-3, 2e-3, -3e-3], [1e-3, 5e-3, -2e-3]])
E, NU = 70e9, 0.25  # bonds in space have this Poisson's ratio
MODEL = {"notch": [], "nodes": [], "version": 2, "material": {"E": E, "rho": 2000.0, "G0": 10.0, "plane": "space"}}


def between(nodes: Nodes, families: Families, axis: int, at: float) -> list[tuple[int, int, int]]:
    """The bonds across a plane, broken in step 5."""
    own = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    side = nodes.position[:, axis] > at
    cut = side[own] != side[families.neighbour]
    pairs = zip(nodes.ids[own[cut]].tolist(), nodes.ids[families.neighbour[cut]].tolist(), strict=True)
    return [(5, *pair) for pair in pairs]


def test_the_gradient_of_an_affine_field_is_exact_at_surfaces_too() -> None:
    nodes, families = block()
    results = results_of(nodes, families, nodes.position @ H.T + 1e-3, [], MODEL)
    exact = (H + H.T + H.T @ H) / 2
    found = fields.all_field_components(results, "strain", 10)
    for part, place in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():
        assert np.abs(found[part] - exact[place]).max() < 1e-6  # of displacements in single precision; 2.5e-7
    ends = np.linalg.eigvalsh(exact)[[0, 2]]
    assert [found[part][0] for part in ("smallest", "largest")] == pytest.approx(ends, rel=1e-4)
    fitted = gradients_of(nodes.position, nodes.area, nodes.position @ H.T, *families)
    assert np.abs(fitted - H).max() < 1e-12  # measured 7e-17


def test_a_stretched_bar_has_the_stress_of_its_modulus() -> None:
    """Of a stretch of 1e-6, its sides drawn in by Poisson's ratio of bonds, 1/4."""
    nodes, families = block()
    u = 1e-6 * nodes.position * [1.0, -NU, -NU]
    found = fields.all_field_components(results_of(nodes, families, u, [], MODEL), "stress", 10)
    assert found["xx"] / (1e-6 * E) == pytest.approx(1.0, abs=1e-5)
    assert found["mises"] / (1e-6 * E) == pytest.approx(1.0, abs=1e-5)
    for part in ("yy", "zz", "xy", "xz", "yz", "smallest"):
        assert np.abs(found[part]).max() < 1e-5 * 1e-6 * E


def test_broken_bonds_do_not_count_and_a_node_without_bonds_has_no_strain() -> None:
    """Two halves that move apart have no strain once all bonds between them are broken."""
    nodes, families = block()
    upper = nodes.position[:, 2] > 3e-3
    u = np.where(upper, 1e-4, -1e-4)[:, None] * np.array([0.25, 0.5, 1.0])
    broken = between(nodes, families, 2, 3e-3)
    lone = families.neighbour[: families.start[1]]
    broken += [(5, 1, int(nodes.ids[other])) for other in lone if not upper[other]]
    found = fields.all_field_components(results_of(nodes, families, u, broken, MODEL), "strain", 10)
    assert np.isnan([values[0] for values in found.values()]).all()
    assert max(np.abs(values[1:]).max() for values in found.values()) < 1e-9


def test_a_linear_field_is_itself_along_a_line() -> None:
    nodes, families = block()
    results = results_of(nodes, families, nodes.position @ H.T, [], MODEL)
    found = sample_field_along_line(results, "displacement", 10, (0.7e-3, 1.1e-3, 0.9e-3), (8.3e-3, 7.2e-3, 6.1e-3))
    for part, row in zip("xyz", H, strict=True):
        assert (
            np.abs(found.component_values[part] - found.points @ row).max() < 1e-11
        )  # single precision; measured 2e-12
    assert found.distance_from_start[-1] == pytest.approx(np.sqrt(7.6**2 + 6.1**2 + 5.2**2) * 1e-3)


def test_a_crack_is_a_jump_along_a_line_and_beyond_the_body_is_nothing() -> None:
    nodes, families = block()
    u = np.where(nodes.position[:, 2] > 3e-3, 1e-4, -1e-4)[:, None] * np.array([0.0, 0.0, 1.0])
    broken = between(nodes, families, 2, 3e-3)
    ends = (4.3e-3, 4.4e-3, -1e-3), (4.3e-3, 4.4e-3, 7e-3)
    whole, torn = (
        sample_field_along_line(results_of(nodes, families, u, gone, MODEL), "displacement", 10, *ends)
        for gone in ([], broken)
    )
    inside = whole.points[:, 2] >= -1e-9
    assert np.array_equal(np.isfinite(whole.component_values["z"]), inside)
    assert np.abs(np.abs(whole.component_values["z"][inside]) - 1e-4).max() > 0.5e-4
    assert np.abs(torn.component_values["z"][inside]) == pytest.approx(1e-4, rel=1e-6)


def test_a_line_elsewhere_and_a_place_of_a_plate_are_refused() -> None:
    nodes, families = block()
    results = results_of(nodes, families, nodes.position @ H.T, [], MODEL)
    with pytest.raises(ResultsError, match=naming(found=("1,1,1", "2,2,2"), expected="0.009,0.008,0.007")):
        sample_field_along_line(results, "displacement", 10, (1.0, 1.0, 1.0), (2.0, 2.0, 2.0))
    with pytest.raises(ResultsError, match=naming("--to", found="2 numbers", expected="3")):
        sample_field_along_line(results, "displacement", 10, (0.0, 0.0, 0.0), (1.0, 1.0))
