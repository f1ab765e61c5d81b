"""Cracks that grow particle by particle: when, whither, what it does to bonds, and what is refused."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from grown import BY_STRESS, pulled
from whole import contents

from pdmesh.model.document import ParticleRules, Run, Static
from pdmesh.model.domain_integrals import Sampled
from pdmesh.model.particles import arms, until
from pdmesh.model.visibility import Sight
from pdsolve.cracking.criteria import ANGLES, _maxima, by_stress
from pdsolve.model import Model, ModelError
from pdsolve.operators.listed import Listed
from pdsolve.results import Results
from pdsolve.schemes import SCHEMES
from pdsolve.simulation import Options, prepare, resume, simulate


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cracking") / "pulled.sqlite"
    simulate(pulled(), path, Options(threads=1)).close()
    return path


def test_a_crack_forks_evenly_and_cuts_just_what_its_arms_meet(solved: Path) -> None:
    """It runs straight ahead, then forks into mirror images; broken bonds are those that a drawn crack would cut."""
    model = pulled()
    with Results.open(solved) as results:
        results.verify()
        particles, breaks, nodes, history = results.particles(), results.breaks(), results.nodes(), results.history()
        assert results.summary()["particles"] == len(particles.place) > 15
        families = results.families()
    (fork,) = np.flatnonzero(np.bincount(particles.parent[1:]) > 1)
    assert np.abs(particles.place[: fork + 1, 1]).max() == 0
    assert fork > 3
    upper, lower = particles.place[fork + 2 :: 2], particles.place[fork + 1 :: 2]
    assert upper == pytest.approx(lower * [1, -1], abs=1e-12)
    assert np.hypot(*np.diff(particles.place[1 : fork + 1], axis=0).T) == pytest.approx(1e-3)
    source = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    pairs = prepare(model, Options(threads=1)).system.growth._near.pairs(np.arange(len(source)))
    lasting = np.abs(nodes.position[:, 1]) > 9.3e-3
    cut = Sight(model.grid).parted(pairs, arms(until(particles, int(breaks.step.max())), after=0))
    cut &= ~(lasting[pairs.source] | lasting[pairs.target])
    expected = {(nodes.ids[pairs.source[k]], nodes.ids[pairs.target[k]]) for k in np.flatnonzero(cut)}
    assert set(zip(breaks.node.tolist(), breaks.neighbour.tolist(), strict=True)) == expected
    assert history["dissipated"][-1] > 0


def test_energy_is_booked(solved: Path) -> None:
    """What the ledger misses at half of the stable step is 0.018 of what the crack takes."""
    with Results.open(solved) as results:
        summary = results.summary()
    assert abs(summary["balance"]) * summary["energy"]["work"] < 0.03 * summary["energy"]["dissipated"]


@pytest.mark.parametrize("kernel", [None, pytest.param("listed", marks=pytest.mark.slow)])
def test_a_run_that_was_stopped_comes_to_the_same_bits(
    kernel: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pdsolve.simulation.PATIENCE", 1.0)
    whole, path, options = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", Options(threads=1, kernel=kernel)
    simulate(pulled(), whole, options).close()
    expected = contents(whole)
    for stops in ([137], sorted(random.Random(1).sample(range(1, 239), 2))):
        for number, stop in enumerate(stops):
            again = (resume, (path, 1)) if number else (simulate, (pulled(), path, options))
            again[0](*again[1], watch=lambda progress, stop=stop: progress.step == stop).close()
        resume(path, 1).close()
        found = contents(path)
        assert [table for table in expected if found[table] != expected[table]] == []


def slowly() -> Model:
    """The strip under a slow pull, in two load steps."""
    rest = Static(load_steps=2, floating=True)
    usual: dict[str, Any] = {"time_step": None, "steps": 1000, "every": 50, "ledger": None}
    model = pulled(ParticleRules(toughness=5e5, most=5), 31, solver="static", static=rest, **usual)
    ramp = ((0.0, 0.0), (1.0, 1.0))
    loads = tuple(msgspec.structs.replace(load, profile=ramp) for load in model.settings.conditions)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, conditions=loads))


def test_a_crack_at_rest_grows_by_its_intensities(tmp_path: Path) -> None:
    """Straight on, as far as it may; gone on with after a load step it does the same."""
    whole, path, options = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", Options(threads=1)
    simulate(slowly(), whole, options).close()
    with Results.open(whole) as results:
        place, step = results.particles().place, results.particles().step
        assert results.summary()["balance"] == pytest.approx(0, abs=1e-6)
    print(place, step)
    assert place[2:] == pytest.approx(np.column_stack([10.2e-3 + 1e-3 * np.arange(1, 6), np.zeros(5)]), abs=1e-9)
    simulate(slowly(), path, options, watch=lambda progress: progress.step == 1 and progress.going is None).close()
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
    resume(path, 1).close()
    assert contents(path) == contents(whole)


def test_the_hoop_stress_of_an_inclined_pull_turns_a_crack() -> None:
    """Uniform tension at an angle t to the normal of the way: the crack turns by t, both ways, and by the axis too."""
    rng = np.random.default_rng(0)
    position = rng.uniform(-2, 2, (4000, 2))
    for angle in np.radians([-30, -12, 0, 20]):
        n = np.array([-np.sin(angle), np.cos(angle)])
        stress = np.tile([n[0] ** 2, n[1] ** 2, n[0] * n[1]], (4000, 1))
        at = Sampled(position, np.ones(4000), np.zeros((4000, 2, 2)), np.zeros((4000, 3)), stress)
        for direction, off in (("hoop", 2.0), ("principal", 1e-6)):
            rules = ParticleRules(criterion="stress", strength=0.5, direction=direction)
            found = by_stress(at, np.zeros(2), np.array([1.0, 0.0]), 1.0, rules, True)
            assert found.share == pytest.approx(2.0)
            assert np.degrees(found.angles) == pytest.approx([np.degrees(angle)], abs=off)


@pytest.mark.parametrize(
    ("second", "apart", "branch", "expected"),
    [
        (1.0, 60, 0.95, [-30, 30]),
        (0.96, 60, 0.95, [-30, 30]),
        (0.94, 60, 0.95, [-30]),
        (1.0, 30, 0.95, [0]),  # nearer than cracks can be: one between them
        (1.0, 60, np.inf, [0]),  # a crack that may not fork
        (0.96, 60, np.inf, [-30]),
    ],
)
def test_a_second_maximum_forks_a_crack(second: float, apart: float, branch: float, expected: list[float]) -> None:
    degrees = np.degrees(ANGLES)
    lobes = (np.exp(-(((degrees - side * apart / 2) / 8) ** 2)) for side in (-1, 1))
    first, other = lobes
    assert np.degrees(_maxima(np.maximum(first, second * other), branch)).tolist() == pytest.approx(expected)


@pytest.mark.parametrize("law", ["bond", pytest.param("correspondence", marks=pytest.mark.slow)])
def test_bonds_go_round_the_tips_of_cracks_that_grow(law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who is bonded and how much each counts is as if the crack had been drawn so: measured to round-off. Stopped and
    gone on with it comes to the same bits."""
    monkeypatch.setattr("pdsolve.simulation.PATIENCE", 1.0)
    material = {"sight": "diffraction", "gamma": 1.5} | ({"model": law, "nu": 0.3} if law != "bond" else {})
    model, options = of(pulled(steps=100), material), Options(threads=1)
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    prepared = prepare(model, options)
    growth, operator = prepared.system.growth, prepared.system.operator
    assert growth is not None
    assert isinstance(operator, Listed)
    for step in range(1, 101):
        prepared.march(step, step + 1)
        if step % 4 == 0:
            growth.look(prepared.state, step + 1)
    assert len(growth.particles.place) > 8
    grid = dataclasses.replace(model.grid, cracks=arms(growth.particles))
    drawn = SCHEMES["conservative"].fill(dataclasses.replace(model, grid=grid)).whole().bonds
    source, target = operator.bonds()
    assert np.array_equal(source, np.repeat(np.arange(len(grid)), np.diff(drawn.start)))
    assert np.array_equal(target, drawn.neighbour)
    if law != "bond":  # whose bonds at faces are made stiffer where they were drawn
        assert operator.columns.weight[operator.columns.broken == 0] == pytest.approx(drawn.weight, rel=1e-12)
    simulate(model, whole, options).close()
    simulate(model, path, options, watch=lambda progress: progress.step == 63).close()
    resume(path, 1).close()
    assert contents(path) == contents(whole)


def of(model: Model, material: dict[str, Any]) -> Model:
    """The same of another material."""
    changed = msgspec.structs.replace(model.materials[0], **material)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, material=changed))


REFUSED = [
    ({"particles": ParticleRules(criterion="stress")}, {}, "strength: found none"),
    ({"particles": ParticleRules(strength=1.0)}, {}, "strength: found 1, expected none"),
    ({"particles": ParticleRules(direction="principal")}, {}, "direction: found principal"),
    ({"adapt": "hybrid"}, {}, "run.adapt: found hybrid, expected none"),
    (
        {},
        {"model": "correspondence", "nu": 0.3, "solid": "neo hooke"},
        "solid: found neo hooke",
    ),
]


@pytest.mark.parametrize(("run", "material", "said"), REFUSED)
def test_what_cannot_be_is_refused_in_one_line(run: dict[str, Any], material: dict[str, Any], said: str) -> None:
    model = pulled(**{"rules": BY_STRESS, **{"rules" if k == "particles" else k: v for k, v in run.items()}})
    with pytest.raises(ModelError, match=said) as error:
        prepare(of(model, material), Options(threads=1))
    assert "\n" not in str(error.value)


def test_a_crack_needs_a_tip_and_a_ring_needs_room() -> None:
    with pytest.raises(ModelError, match="found no tip of a crack inside the plate"):
        prepare(pulled(crack=40.5e-3), Options(threads=1))
    with pytest.raises(ModelError, match=r"found nodes of a load or grip 0.0095 m .* expected room of 0.0105 m"):
        prepare(pulled(ParticleRules()), Options(threads=1))


def test_particles_are_not_denser_than_nodes() -> None:
    with pytest.raises(msgspec.ValidationError, match=r">= 1\.0"):
        msgspec.convert({"cracks": "particles", "particles": {"spacing": 0.5}}, Run)
