"""What a refinement of a body does to the state, the forces on held nodes and the rows before."""

from __future__ import annotations

from types import SimpleNamespace as Part
from typing import Any

import numpy as np
import pytest

from pdsolve.errors import CheckpointError
from pdsolve.run import body_zones
from pdsolve.run.body_zones import BodyCellRefinement, _previous_row_of_nodes_with_same_bonds
from pdsolve.run.system import PreparedRun
from pdsolve.state import State

ROWS = np.array([0, 2, -1, 1])  # before: of the first node, too


def systems(**changed: list[float]) -> tuple[Any, Any]:
    """Two systems whose nodes have the same cells and bonds, but for what is `changed` after."""
    values = {"volume": [1.0, 2.0, 3.0], "family": [4, 5, 6], "count": [4, 4, 4]}
    after = {key: np.array(given)[np.maximum(ROWS, 0)] for key, given in values.items()}
    for key, given in changed.items():
        after[key] = np.array(given)
    return tuple(  # type: ignore[return-value]
        Part(
            operator=Part(volume=np.array(one["volume"])),
            family_sizes=np.array(one["family"]),
            initial_bond_counts=np.array(one["count"]),
        )
        for one in (values, after)
    )


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, [0, 2, -1, 1]),
        ({"volume": [9.0, 3.0, 1.0, 2.0]}, [-1, 2, -1, 1]),
        ({"family": [4, 9, 4, 5]}, [0, -1, -1, 1]),
        ({"count": [4, 4, 4, 9]}, [0, 2, -1, -1]),
    ],
)
def test_nodes_that_keep_their_cell_and_bonds(
    changed: dict[str, list[float]], expected: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(body_zones, "expect_body_zone_operator", lambda system: system.operator)
    assert _previous_row_of_nodes_with_same_bonds(*systems(**changed), ROWS).tolist() == expected


class Zone:
    """An operator whose cells may become fine, as far as a refinement asks it."""

    def __init__(self, new: list[int], volume: list[float], refined: Zone | None = None) -> None:
        self.new, self.volume, self.refined = np.array(new, dtype=np.int64), np.array(volume), refined
        self.history, self.rows, self.asked, self.damping_rates = Made(100.0), ROWS, list[int](), None

    def mark_new_fine_cells(self, state: State, step: int) -> np.ndarray[Any, Any]:
        self.asked.append(step)
        return self.new

    def energies_near_new_cells(self, state: object, new: object) -> str:
        return "around"

    def operator_after_refinement(self, new: object) -> Zone | None:
        return self.refined

    def current_rows_of_grid_rows(self, rows: object) -> object:
        return rows

    def interpolate_at_grid_rows(
        self, rows: np.ndarray[Any, Any], values: np.ndarray[Any, Any]
    ) -> np.ndarray[Any, Any]:
        return 10.0 * values

    def force_densities_near_new_cells(
        self, state: object, new: object
    ) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        return 100.0 * np.ones((4, 3)), np.array([False, False, True, False])


class Made:
    """A history with the energy made by refinement, J."""

    def __init__(self, made: float) -> None:
        self.refinement_energy = made

    def _replace(self, refinement_energy: float) -> Made:
        return Made(refinement_energy)


@pytest.fixture
def zone() -> Zone:
    """A zone of three cells, the last of which becomes fine: four rows after."""
    return Zone([3], [4.0, 6.0, 8.0], Zone([], [2.0, 8.0, 1.0, 3.0]))


@pytest.fixture
def change(zone: Zone, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What its refinement changes: 11 J after, 4 J before, 0.5 J of forces."""
    before = Part(force=np.zeros((3, 3)), holds=Part(node=np.array([0, 1]), axis=np.array([1, 2])))
    before.held_force, force = np.array([5.0, 7.0]), np.arange(12.0).reshape(4, 3)
    after = Part(force=force, holds=Part(node=np.array([0, 3, 2]), axis=np.array([1, 2, 0])), held_force=np.zeros(3))
    system: Any = Part(operator=zone, drive=before)
    monkeypatch.setattr(body_zones, "expect_body_zone_operator", lambda system: system.operator)
    monkeypatch.setattr(
        body_zones, "verlet_conserved_energy", lambda one, state, around: 4.0 if one is system else 11.0
    )
    monkeypatch.setattr(body_zones, "half_kick_work_of_acceleration_error", lambda *_: 0.5)
    monkeypatch.setattr(
        body_zones, "_system_with_refined_operator", lambda _, operator, step: Part(operator=operator, drive=after)
    )
    monkeypatch.setattr(body_zones, "_previous_row_of_nodes_with_same_bonds", lambda *_: "origin")
    motion = [np.full((4, 3), value) for value in (1.0, 2.0, 3.0)]
    booked = [factor * np.array([1.0, 10.0, 100.0]) for factor in (1.0, 2.0, 3.0)]
    return BodyCellRefinement().change_nodes(system, State(*motion, *booked), 256)


def test_what_was_booked_stays_where_it_was(zone: Zone, change: Any) -> None:
    """Densities on cells of another volume hold the same energy; new nodes hold none."""
    assert [float(values[0, 0]) for values in change.state[:3]] == [10.0, 20.0, 30.0]
    assert zone.refined is not None
    for factor, values in zip((1.0, 2.0, 3.0), change.state[3:], strict=True):
        assert np.array_equal(values, factor * np.array([2.0, 100.0, 0.0, 20.0]))
        assert np.array_equal((values * zone.refined.volume)[[0, 1, 3]], factor * np.array([4.0, 800.0, 60.0]))


def test_forces_on_held_components(change: Any) -> None:
    """They are the pull and the load where it is known, and those before elsewhere."""
    assert change.system.drive.held_force.tolist() == [5.0, 7.0, 100.0 + 6.0]


def test_the_energy_made_by_a_refinement_is_added_up(zone: Zone, change: Any) -> None:
    """11 J after less 4 J before and 0.5 J of forces; 100 J of earlier ones."""
    assert change.system.operator.history.refinement_energy == 107.5
    assert change[2] == "origin"
    assert zone.asked == [256 - BodyCellRefinement.steps_between_checks]  # what broke since the last look


def test_without_cells_to_refine_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body_zones, "expect_body_zone_operator", lambda system: system.operator)
    assert BodyCellRefinement().change_nodes(Part(operator=Zone([], [])), "state", 256) is None  # type: ignore[arg-type]


def test_a_checkpoint_of_other_cells_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    grid, unknowns = Part(ids=np.array([1, 2])), [Part(width=3)]
    after = Part(current_nodes_model=Part(grid=grid), volume=np.ones(2), unknowns=unknowns, kind=np.float64)
    monkeypatch.setattr(
        body_zones, "expect_body_zone_operator", lambda system: Part(operator_with_checkpoint_cells=lambda kept: after)
    )
    steps: list[int] = []
    monkeypatch.setattr(body_zones, "_system_with_refined_operator", lambda system, operator, step: steps.append(step))
    assert BodyCellRefinement().create_system_with_checkpoint_nodes(
        Part(), {"ids": np.array([1, 2])}
    ).state.value.shape == (2, 3)  # type: ignore[arg-type]
    assert steps == [0]
    with pytest.raises(CheckpointError, match="ids of nodes"):
        BodyCellRefinement().create_system_with_checkpoint_nodes(Part(), {"ids": np.array([1, 3])})  # type: ignore[arg-type]


def test_loads_of_new_nodes_are_those_of_the_time_of_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    times: list[float] = []
    monkeypatch.setattr(body_zones, "create_conditions_of_current_nodes", lambda after, time: times.append(time))
    assemble: Any = lambda *words, conditions, damping_rates: Part(system=PreparedRun(words[5:7], None))  # noqa: E731
    monkeypatch.setattr(body_zones, "assemble_system", assemble)
    monkeypatch.setattr(body_zones.dataclasses, "replace", lambda system, **changes: (system, changes))
    system: Any = Part(
        time_step=0.5, stable_time_step=0.7, options=None, scheme=None, full_model="whole", regridder="zone"
    )
    operator: Any = Part(current_nodes_model=None, volumes_and_bond_counts=None, damping_rates=None)
    found: Any = body_zones._system_with_refined_operator(system, operator, 8)
    assert times == [4.0]
    assert (found[0][0], found[1]) == ((0.5, 0.7), {"full_model": "whole", "regridder": "zone"})
