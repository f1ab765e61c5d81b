"""Cracks that grow particle by particle: when, whither, what it does to bonds, and what is refused."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from crack_particle_strips import BY_STRESS, pulled
from database_contents import contents
from messages import mentions, naming

from pdmesh.model.document import Displacement, Load, ParticleRules, Run, Static
from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdmesh.model.visibility import Sight
from pdsolve.crack_growth.criteria import ANGLES, Verdict, _maxima, by_stress
from pdsolve.crack_growth.growth import every_of
from pdsolve.crack_growth.tips import CrackedPlate, tips_of
from pdsolve.fracture.crack_particles import arms, until
from pdsolve.fracture.domain_integrals import Ring, Sampled
from pdsolve.measures.cracks import find_crack_events
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.bond_list import BondList
from pdsolve.results import Results
from pdsolve.run.simulation import Options, prepare, resume, simulate
from pdsolve.run.system import Regridder
from pdsolve.schemes import SCHEMES


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cracking") / "pulled.sqlite"
    simulate(pulled(), path, Options(threads=1)).close()
    return path


@pytest.mark.slow
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
    pairs = prepare(model, Options(threads=1)).system.regridder.growth._near.pairs(np.arange(len(source)))
    no_fail = np.abs(nodes.position[:, 1]) > 9.3e-3
    cut = Sight(model.grid).parted(pairs, arms(until(particles, int(breaks.step.max())), after=0))
    cut &= ~(no_fail[pairs.source] | no_fail[pairs.target])
    expected = {(nodes.ids[pairs.source[k]], nodes.ids[pairs.target[k]]) for k in np.flatnonzero(cut)}
    assert set(zip(breaks.node.tolist(), breaks.neighbour.tolist(), strict=True)) == expected
    assert history["dissipated"][-1] > 0


@pytest.mark.slow
def test_what_changes_nodes_is_refused_beside_cracks_of_particles() -> None:
    with pytest.raises(ModelError, match=naming("$.run.cracks", found="adapt", expected="one of both")):
        simulate(pulled(), options=Options(threads=1), adapt=Regridder())


def test_energy_is_booked(solved: Path) -> None:
    """What the ledger misses at half of the stable step is 0.018 of what the crack takes."""
    with Results.open(solved) as results:
        summary = results.summary()
    assert abs(summary["balance"]) * summary["energy"]["work"] < 0.03 * summary["energy"]["dissipated"]


@pytest.mark.slow
@pytest.mark.parametrize("kernel", [None, pytest.param("listed", marks=pytest.mark.slow)])
def test_a_run_that_was_stopped_comes_to_the_same_bits(
    kernel: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
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


@pytest.mark.slow
def test_a_crack_at_rest_grows_by_its_intensities(tmp_path: Path) -> None:
    """Straight on, as far as it may; gone on with after a load step it does the same. That it would go on, and that it
    runs on by itself, is said, and stored."""
    whole, path, options = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", Options(threads=1)
    with pytest.warns(ModelWarning) as said:
        simulate(slowly(), whole, options).close()
    with Results.open(whole) as results:
        remarks = results.summary()["remarks"]
        assert [str(one.message) for one in said] == [f"model: {remark}" for remark in remarks]
        runs, most = remarks
        assert mentions(runs, "load step 1", found=("run on", "3 particles", "2.58", "2.01"))
        assert mentions(most, "0.0152")
        assert mentions(most, "5 particles", expected="run.particles.most")
        place = results.particles().place
        assert results.summary()["balance"] == pytest.approx(0, abs=1e-6)
    assert place[2:] == pytest.approx(np.column_stack([10.2e-3 + 1e-3 * np.arange(1, 6), np.zeros(5)]), abs=1e-9)
    with pytest.warns(ModelWarning):
        simulate(
            slowly(), path, options, watch=lambda progress: progress.step == 1 and progress.load_step_progress is None
        ).close()
    with Results.open(path) as results:
        assert results.meta()["status"] == "interrupted"
    resume(path, 1).close()
    assert contents(path) == contents(whole)


@pytest.mark.slow
def test_a_crack_by_intensities_reaches_the_edge(tmp_path: Path) -> None:
    """Between two grips that part slowly it goes straight through, by a smaller ring and by J where an edge is near,
    and the plate is in two."""
    model = slowly()
    rules = ParticleRules(toughness=5e5)
    run = msgspec.structs.replace(model.settings.run, particles=rules)
    grips = [
        Displacement(box=one.box, x=0.0, y=float(np.sign(one.body_force[1])) * 2.5e-6, profile=((0.0, 0.0), (1.0, 1.0)))
        for one in model.settings.conditions
        if isinstance(one, Load)
    ]
    settings = msgspec.structs.replace(model.settings, run=run, conditions=tuple(grips))
    path = tmp_path / "parted.sqlite"
    simulate(dataclasses.replace(model, settings=settings), path, Options(threads=1)).close()
    with Results.open(path) as results:
        place = results.particles().place
        assert place[-1] == pytest.approx([30.5e-3, 0.0], abs=1e-9)
        assert np.abs(place[:, 1]).max() < 1e-9
        assert find_crack_events(results).split is not None
        assert results.summary()["remarks"] == []


def test_a_crack_that_turns_back_on_itself_stops_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that turns by 60 degrees at each look, as intensities of an unstable crack may say: no loop comes of it."""
    prepared = prepare(pulled(), Options(threads=1))
    grown = prepared.system.regridder.growth
    assert grown is not None
    monkeypatch.setattr(grown, "judge", lambda *_: Verdict(1.0, (np.radians(60.0),)))
    said = pytest.warns(ModelWarning, match=naming("crack", "turns back", "stops there"))
    with said:
        grew = [grown.look(prepared.state, step) for step in range(1, 20)]
    assert not any(grew[8:])
    place = grown.particles.place
    assert np.hypot(*(place[:, None] - place).transpose(2, 0, 1))[np.triu_indices(len(place), 1)].min() > 0.9e-3
    assert len(grown.remarks) == 1
    again = prepare(pulled(), Options(threads=1)).system.regridder.growth
    assert again is not None
    again.restore(grown.checkpoint_arrays(), prepared.system.operator.broken())
    assert again.remarks == grown.remarks


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


@pytest.mark.slow
@pytest.mark.parametrize("law", ["bond", pytest.param("correspondence", marks=pytest.mark.slow)])
def test_bonds_go_round_the_tips_of_cracks_that_grow(law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who is bonded and how much each counts is as if the crack had been drawn so: measured to round-off. Stopped and
    gone on with it comes to the same bits."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    material = {"sight": "diffraction", "gamma": 1.5} | ({"model": law, "nu": 0.3} if law != "bond" else {})
    model, options = of(pulled(steps=100), material), Options(threads=1)
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    prepared = prepare(model, options)
    growth, operator = prepared.system.regridder.growth, prepared.system.operator
    assert growth is not None
    assert isinstance(operator, BondList)
    for step in range(1, 101):
        prepared.advance(step, step + 1)
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
    ({"particles": ParticleRules(criterion="stress")}, {}, "strength is missing"),
    ({"particles": ParticleRules(strength=1.0)}, {}, r"strength \(1\)"),
    ({"particles": ParticleRules(direction="principal")}, {}, "direction is principal"),
    ({"adapt": "hybrid"}, {}, r"run.adapt \('hybrid'\)"),
    (
        {},
        {"model": "correspondence", "nu": 0.3, "solid": "neo hooke"},
        "solid is 'neo hooke'",
    ),
]


@pytest.mark.parametrize(("run", "material", "said"), REFUSED)
def test_what_cannot_be_is_refused_in_one_line(run: dict[str, Any], material: dict[str, Any], said: str) -> None:
    model = pulled(**{"rules": BY_STRESS, **{"rules" if k == "particles" else k: v for k, v in run.items()}})
    with pytest.raises(ModelError, match=said) as error:
        prepare(of(model, material), Options(threads=1))
    assert "\n" not in str(error.value)


def test_a_crack_needs_a_tip_and_a_ring_needs_room() -> None:
    with pytest.raises(ModelError, match=naming(found=("tip", "inside"))):
        prepare(pulled(crack=40.5e-3), Options(threads=1))
    with pytest.raises(ModelError, match=naming(found="0.0095 m", expected="0.0105 m")) as refused:
        prepare(pulled(ParticleRules()), Options(threads=1))
    assert "nodes 0.0009 m apart" in str(refused.value)  # 1 mm apart, they need 3.5 horizons of 3 mm


def test_particles_are_not_denser_than_nodes() -> None:
    with pytest.raises(msgspec.ValidationError, match=r">= 1\.0"):
        msgspec.convert({"cracks": "particles", "particles": {"spacing": 0.5}}, Run)


def test_the_hoop_stress_is_compared_at_one_distance() -> None:
    """A field that falls with the root of the distance, largest at -20 degrees; nodes to the left are near the tip,
    those to the right far from it."""
    rng = np.random.default_rng(1)
    angle = rng.uniform(-1.2, 1.2, 6000)
    far = np.where(angle > 0, rng.uniform(0.55, 0.8, 6000), rng.uniform(1.1, 1.45, 6000))
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    hoop = (1 + 0.5 * np.cos(angle + np.radians(20))) / np.sqrt(far)
    stress = hoop[:, None] * np.column_stack([out[:, 1] ** 2, out[:, 0] ** 2, -out[:, 0] * out[:, 1]])
    at = Sampled(far[:, None] * out, np.ones(6000), np.zeros((6000, 2, 2)), np.zeros((6000, 3)), stress)
    rules = ParticleRules(criterion="stress", strength=0.5)
    found = by_stress(at, np.zeros(2), np.array([1.0, 0.0]), 1.0, rules, False)
    assert np.degrees(found.angles) == pytest.approx([-20.0], abs=3)


@pytest.mark.parametrize(
    ("room", "ring"), [(20e-3, (4e-3, 10e-3)), (9e-3, (4e-3, 7.2e-3)), (7e-3, (4e-3, 5.6e-3)), (5e-3, (1.6e-3, 4e-3))]
)
def test_a_ring_is_as_large_as_there_is_room(
    room: float, ring: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The horizon is 2 mm: from two to five of them; less where an edge is nearer, with J where it is too near."""
    prepared = prepare(slowly(), Options(threads=1))
    grown, asked = prepared.system.regridder.growth, list[tuple[str, Ring]]()
    assert grown is not None
    monkeypatch.setattr(grown, "_room", lambda *_: (room, "the edge of the plate"))
    for name in ("by_intensity", "by_release"):
        monkeypatch.setattr(
            f"pdsolve.crack_growth.growth.{name}",
            lambda *words, name=name: asked.append((name, words[3])) or Verdict(0.0, ()),
        )
    (tip,) = tips_of(grown.particles, CrackedPlate(prepared.system.model))
    grown.judge(tip, [tip], prepared.state)
    assert asked == [("by_release" if room < 7e-3 else "by_intensity", pytest.approx(Ring(*ring)))]


def test_bonds_that_are_held_together_are_not_cut() -> None:
    """An arm right through the loaded row cuts just those that neither end of which is in it."""
    prepared = prepare(pulled(), Options(threads=1))
    grown, model = prepared.system.regridder.growth, prepared.system.model
    assert grown is not None
    arm = np.array([[20.5e-3, 6e-3, 20.5e-3, 9.9e-3]])
    pairs = grown._near.pairs(np.arange(len(grown._near.source)))
    met = Sight(model.grid).parted(pairs, arm)
    held = np.abs(model.grid.position[:, 1]) > 9.3e-3
    apart = met & ~held[pairs.source] & ~held[pairs.target]
    assert met.sum() > apart.sum() > 0
    grown._cut(arm, prepared.state, 1)
    broken = prepared.system.operator.broken()
    assert set(zip(broken.source.tolist(), broken.target.tolist(), strict=True)) == set(
        zip(pairs.source[apart].tolist(), pairs.target[apart].tolist(), strict=True)
    )


def test_a_crack_looked_at_each_time_runs_just_below_rayleigh_waves() -> None:
    model = pulled()
    (material,) = model.materials
    rayleigh = rayleigh_speed(material.E, material.rho, material.plane, poisson(material))
    for step in (1e-8, 3e-8, 1.7e-7):
        every = every_of(model, step)
        assert 1e-3 / (every * step) <= rayleigh
        assert every == 1 or 1e-3 / ((every - 1) * step) > rayleigh
