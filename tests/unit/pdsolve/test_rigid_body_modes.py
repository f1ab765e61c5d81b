"""Which supports hold a body, whatever its shape and size."""

from __future__ import annotations

import numpy as np
import pytest

from pdsolve.rest.modes import find_loose_bodies


def slab(*counts: int, spacing: float = 1e-3) -> np.ndarray:
    """Nodes (n, d) of a lattice."""
    axes = [spacing * np.arange(count) for count in counts]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(counts))


def rows(length: int, thick: int) -> tuple[np.ndarray, np.ndarray]:
    """A strip and the bonds of each node to those around it, as a longer one has too many pairs to look at."""
    position = slab(length, thick)
    number = np.arange(len(position)).reshape(length, thick)
    pairs = [(number[:-1], number[1:]), (number[:, :-1], number[:, 1:])]
    pairs += [(number[:-1, :-1], number[1:, 1:]), (number[:-1, 1:], number[1:, :-1])]
    one, other = (np.concatenate([pair[side].ravel() for pair in pairs]) for side in (0, 1))
    return position, np.stack([np.r_[one, other], np.r_[other, one]])


@pytest.mark.parametrize("length", [30, 3000, 30000])
@pytest.mark.parametrize(("components", "free"), [([0, 1], ""), ([0], "move"), ([1], "move")])
def test_a_strip_of_any_length_is_held_by_its_end(length: int, components: list[int], free: str) -> None:
    position, bonds = rows(length, 3)
    held = np.zeros(position.shape, dtype=bool)
    held[:3, components] = True
    found = find_loose_bodies(position, np.arange(len(position)), (bonds[0], bonds[1]), held)
    assert found.is_loose_node.all() if free else not found.is_loose_node.any()
    assert f"can {free}" in found.description if free else found.description == ""


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_one_node_that_is_held_leaves_a_body_of_any_size_free_to_turn(scale: float) -> None:
    position, bonds = rows(3000, 3)
    held = np.zeros(position.shape, dtype=bool)
    held[0] = True
    found = find_loose_bodies(scale * position, np.arange(len(position)), (bonds[0], bonds[1]), held)
    assert found.is_loose_node.all()
    assert "can turn" in found.description


def test_a_strip_turns_about_a_row_held_along_it_alone() -> None:
    """All components along x of a row along x leave the turn in the plane about any place of the row, and y."""
    position, bonds = rows(300, 3)
    held = np.zeros(position.shape, dtype=bool)
    held[position[:, 1] < 1e-9, 0] = True
    assert "can move along y" in find_loose_bodies(position, np.arange(900), (bonds[0], bonds[1]), held).description
    held[0, 1] = True
    assert "can turn" in find_loose_bodies(position + 0.1, np.arange(900), (bonds[0], bonds[1]), held).description


@pytest.mark.parametrize("turned", [0.0, 0.7])
@pytest.mark.parametrize(("width", "free"), [(1, True), (2, False)])
def test_a_body_turns_about_a_row_and_not_about_a_thin_strip(turned: float, width: int, free: bool) -> None:
    """In space a long row of fixed nodes is an axis, two rows are a support, along the axes and oblique."""
    position = slab(60, 2, 2)
    rotation = np.eye(3)
    rotation[:2, :2] = [[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]]
    held = np.zeros(position.shape, dtype=bool)
    held[(position[:, 1] < (width - 0.5) * 1e-3) & (position[:, 2] < 1e-9)] = True
    number = np.arange(len(position))
    i, j = np.nonzero(np.abs(position[:, None] - position).max(axis=2) < 1.5e-3)
    found = find_loose_bodies(position @ rotation.T, number, (i[i != j], j[i != j]), held)
    assert found.is_loose_node.any() == free


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_a_row_of_nodes_in_space_needs_no_turn_about_itself_held(turned: float) -> None:
    position = np.zeros((4, 3))
    position[:, 0], position[:, 1] = 1e-3 * np.cos(turned) * np.arange(4), 1e-3 * np.sin(turned) * np.arange(4)
    bonds = np.array([[0, 1, 1, 2, 2, 3], [1, 0, 2, 1, 3, 2]])
    held = np.zeros((4, 3), dtype=bool)
    held[[0, 3]] = True
    held[[1, 2], 2] = True  # bonds in one line leave these to the supports
    held[[1, 2], 1 if turned == 0 else 0] = True
    assert find_loose_bodies(position, np.arange(4), (bonds[0], bonds[1]), held).description == ""
