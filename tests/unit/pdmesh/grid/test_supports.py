"""Loads that nothing holds or balances are warned of, others are not."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from pdmesh import Scene, box
from pdmesh.grid import soundness
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Displacement, Settings


def loose(scene: Scene) -> list[str]:
    """What is said of parts that nothing holds."""
    return [note for note in soundness.remarks(*build_grid(scene)[:2]) if "without supports" in note]


FREE: dict[str, tuple[Callable[[Scene], Scene], str]] = {
    "pulled at one end": (lambda plate: plate.load("top", traction=(0, 1e6)), "4e[+]04 N/m on 861 nodes"),
    "a couple": (
        lambda plate: plate.load("top", traction=(1e6, 0)).load("bottom", traction=(-1e6, 0)),
        "N/m on 861 nodes around .* fly off or turn",
    ),
    "held across the load": (lambda plate: plate.load("top", traction=(1e6, 0)).fix("bottom", x=None), "N/m on 861"),
    "hung up at a node": (
        lambda plate: plate.load("right", traction=(0, 1e6)).fix(box(-1e-4, -1e-4, 1e-4, 1e-4)),
        "N/m on 861",
    ),
    "opposite loads that follow time differently": (
        lambda plate: plate.load("top", (0, 1e6), profile=((0, 0), (1e-6, 1))).load("bottom", (0, -1e6)),
        "N/m on 861",
    ),
    "the half that is not held": (
        lambda plate: plate.crack([(0, 0.0105), (0.04, 0.0105)]).load("top", traction=(0, 1e6)).fix("bottom"),
        r"on 410 nodes around \(0.02, 0.0155\) m",
    ),
    "a weight": (lambda plate: plate.load(box(0, 0, 0.04, 0.02), body_force=(0, -1e6)), "800 N/m on 861"),
}  # fmt: skip


@pytest.mark.parametrize("name", FREE)
def test_what_nothing_holds_is_warned_of(name: str, plate: Scene) -> None:
    make, message = FREE[name]
    warnings = loose(make(plate))
    assert len(warnings) == 1
    assert warnings[0].startswith("warning: ")
    assert re.search(message, warnings[0])


HELD: dict[str, Callable[[Scene], Scene]] = {
    "pulled at both ends": lambda plate: plate.load("top", traction=(0, 1e6)).load("bottom", traction=(0, -1e6)),
    "clamped": lambda plate: plate.load("right", traction=(1e6, 1e6)).fix("left"),
    "on rollers": lambda plate: plate.load("top", traction=(0, 1e6)).fix("bottom", x=None),
    "pushed by what moves": lambda plate: plate.load("top", traction=(0, 1e6)).move("bottom", velocity=(None, 1.0)),
    "a weight on a table": lambda plate: plate.load(box(0, 0, 0.04, 0.02), body_force=(0, -1e6)).fix("bottom"),
    "thrown": lambda plate: plate.move(box(0, 0, 0.04, 0.02), initial_velocity=(1, 0)),
    "both halves pulled": lambda plate: plate.crack([(0, 0.0105), (0.04, 0.0105)]).fix("top").fix("bottom"),
    "pulled across a fine and a coarse end": lambda plate: (
        plate.zone(box(0, 0, 0.02, 0.02), 5e-4)
        .load("left", traction=(-1e6, 0), rows=4)
        .load("right", traction=(1e6, 0), rows=4)
    ),
}


@pytest.mark.parametrize("name", HELD)
def test_no_false_alarm_about_supports(name: str, plate: Scene) -> None:
    assert loose(HELD[name](plate)) == []


@pytest.mark.parametrize(("held", "free"), [((1, 2), 0), ((1,), 1)])
def test_a_strip_40000_times_as_long_as_wide_is_held_by_two_nodes_of_its_end(held: tuple[int, ...], free: int) -> None:
    """Against the turn its width resists with 1.6e-10 of what its length does with; one node does not at all."""
    corners = np.array([[0, 0], [0, 2.5e-5], [1, 0], [1, 2.5e-5]])
    settings = Settings(conditions=(Displacement(nodes=held, x=0.0, y=0.0),))
    motions = soundness._free_motions(settings, soundness._Motions(corners, corners), np.ones(4, dtype=bool))
    assert np.linalg.matrix_rank(motions) == free
