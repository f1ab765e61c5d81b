"""Plates solved at rest: cracks that grow slowly, what nothing supports, what cannot be asked, stops and starts."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from messages import mentions, naming
from plates import GLASS, STEEL, plate, square_grid

from pdmesh.model.document import AnyCondition, Displacement, Load, Run, Static, Velocity
from pdsolve.estimate import estimate_run
from pdsolve.model import Model, ModelError
from pdsolve.results import Results
from pdsolve.run.simulation import NotConvergedError, Options, Progress, resume, simulate

OPEN = 1e-4  # m


FOOT = Displacement(box=(0.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0)
PULL = Load(box=(0.0295, -1.0, 1.0, 1.0), body_force=(1e9, 0.0))
NEVER = Load(box=(0.0295, -1.0, 1.0, 1.0), body_force=(1e9, 0.0), profile=((0.0, 0.0), (1.0, 0.0)))


def cantilever(static: Static | None = None, opening: float = OPEN, **changes: Any) -> Model:
    """A cracked plate of 31 x 16 nodes whose left corners are pulled apart."""
    grid = dataclasses.replace(square_grid(31, 16, y0=-7.5e-3), cracks=np.array([[-1e-3, 0.0, 10e-3, 0.0]]))
    ramp = ((0.0, 0.0), (1.0, 1.0))
    conditions = tuple(
        Displacement(box=(-1e-4, y - 1e-4, 1e-4, y + 1e-4), x=0.0, y=float(np.sign(y)) * opening / 2, profile=ramp)
        for y in (7.5e-3, -7.5e-3)
    )
    run = Run(solver="static", static=static or Static(load_steps=6))
    return plate(grid, 3, **{"conditions": conditions, "run": run} | changes)


def conditions_of(model: Model, *conditions: AnyCondition) -> Model:
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, conditions=conditions))


def breaks(results: Results, model: Model) -> set[tuple[float, ...]]:
    """All broken bonds: step, and where both ends are, to a thousandth of a spacing."""
    found = results.breaks()
    place = {
        number: at for number, at in zip(model.grid.ids.tolist(), model.grid.position.round(6).tolist(), strict=True)
    }
    return {
        (step, *place[one], *place[other])
        for step, one, other in zip(found.step.tolist(), found.node.tolist(), found.neighbour.tolist(), strict=True)
    }


@pytest.fixture(scope="module")
def grown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("grown") / "grown.sqlite"
    simulate(cantilever(), path, Options(threads=1)).close()
    return path


@pytest.mark.slow
def test_work_is_what_is_held_and_spent(grown: Path) -> None:
    with Results.open(grown) as results:
        history, summary = results.history(), results.summary()
    assert history["dissipated"][-1] > 0.2 * history["work"][-1]
    assert 0.05 < history["damped"][-1] / history["work"][-1] < 0.25  # measured 0.12
    missing = history["strain"] + history["dissipated"] + history["damped"] - history["work"]
    assert np.abs(missing).max() < 1e-6 * history["work"][-1]  # measured: 3e-9
    assert [step["step"] for step in summary["load_steps"]] == list(range(1, 7))
    assert max(step["residual"] for step in summary["load_steps"]) < 1e-8
    assert sum(step["breaks"] for step in summary["load_steps"]) > 10
    assert summary["method"] == "Newton's method with factors"


@pytest.mark.slow
def test_bonds_of_no_lattice_are_spent_once() -> None:
    model, random = cantilever(), np.random.default_rng(5)
    moved = model.grid.position + random.uniform(-5e-5, 5e-5, model.grid.position.shape)
    with simulate(dataclasses.replace(model, grid=dataclasses.replace(model.grid, position=moved))) as results:
        spent, summary = results.history()["dissipated"][-1], results.summary()
    assert (spent > 1.0, summary["kernel"]) == (True, "listed")
    assert abs(summary["balance"]) < 1e-6  # measured: 1e-10; with each bond twice 0.5


def test_where_all_that_may_break_is_broken() -> None:
    """A column that is torn, in a plate that is to hold."""
    held = (
        Displacement(box=(-1.0, -1.0, 1.0, 1e-4), x=0.0, y=0.0),
        Displacement(box=(-1.0, 9.9e-3, 1.0, 1.0), x=0.0, y=1e-3, profile=((0.0, 0.0), (1.0, 1.0))),
        Load(box=(-1.0, -1.0, 4.5e-3, 1.0), body_force=(0.0, 0.0), breakable=False),
        Load(box=(5.5e-3, -1.0, 1.0, 1.0), body_force=(0.0, 0.0), breakable=False),
    )
    model = plate(square_grid(11, 11), 3, conditions=held, run=Run(solver="static", static=Static(load_steps=4)))
    with simulate(model) as results:
        column = np.flatnonzero(np.abs(model.grid.position[:, 0] - 5e-3) < 1e-4)
        found = results.breaks()
        assert set(found.node.tolist()) == set(model.grid.ids[column[1:10]].tolist())


@pytest.mark.slow
def test_the_crack_is_the_same_however_nodes_are_numbered(grown: Path) -> None:
    model = cantilever()
    order = np.random.default_rng(3).permutation(len(model.grid))
    columns = {name: getattr(model.grid, name)[order] for name in ("ids", "position", "delta", "border", "hole_id")}
    mixed = dataclasses.replace(model, grid=dataclasses.replace(model.grid, **columns))
    with Results.open(grown) as results, simulate(mixed, None, Options(threads=1)) as others:
        assert breaks(others, mixed) == breaks(results, model)
        work, other = (each.history()["work"][-1] for each in (results, others))
    assert other == pytest.approx(work, rel=1e-7)


@pytest.mark.slow
def test_the_crack_is_the_same_by_relaxation(grown: Path) -> None:
    model = cantilever(Static(load_steps=6, method="relaxation"))
    with Results.open(grown) as results, simulate(model, None, Options(threads=1)) as others:
        assert breaks(others, model) == breaks(results, model)
        history = others.history()
    missing = history["strain"] + history["dissipated"] + history["damped"] - history["work"]
    assert np.abs(missing).max() < 1e-6 * history["work"][-1]


@pytest.mark.slow
def test_a_crack_between_its_mirror_images_grows_straight(grown: Path) -> None:
    with Results.open(grown) as results:
        found = breaks(results, cantilever())
    assert found == {(step, x, -y, u, -v) for step, x, y, u, v in found}
    assert all(y * v < 0 for _, _, y, _, v in found)


@pytest.mark.slow
def test_a_run_interrupted_in_its_first_load_step_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    path, model = tmp_path / "stopped.sqlite", cantilever(Static(), conditions=(FOOT, PULL))
    with pytest.raises(KeyboardInterrupt):
        simulate(model, path, Options(threads=1), lambda progress: progress.load_step_progress is not None)
    resume(path, 1).close()
    with simulate(model, None, Options(threads=1)) as results, Results.open(path) as others:
        assert results.history().tolist() == others.history().tolist()
        assert results.history()["work"][-1] > 0


@pytest.mark.slow
def test_an_interrupted_run_goes_on_to_the_same_bits(grown: Path, tmp_path: Path) -> None:
    path = tmp_path / "stopped.sqlite"

    def stop(progress: Progress) -> bool:
        return progress.step >= 4 and progress.load_step_progress is not None

    with pytest.raises(KeyboardInterrupt):
        simulate(cantilever(), path, Options(threads=1), stop)
    resume(path, 1).close()
    with Results.open(grown) as results, Results.open(path) as others:
        for table in ("history", "reactions", "breaks"):
            assert np.array_equal(np.array(getattr(results, table)()), np.array(getattr(others, table)())), table
        for name in ("ux", "uy", "damage"):
            assert np.array_equal(results.field(name, 6), others.field(name, 6))
        assert results.summary()["load_steps"] == others.summary()["load_steps"]


@pytest.mark.slow
def test_a_plate_that_is_let_go_balances_over_the_most_that_was_put_in(tmp_path: Path) -> None:
    """Without a warning, from start to end or stopped on the way: of the work next to nothing is left."""
    there_and_back = ((0.0, 0.0), (1.0, 1.0), (2.0, 0.0))
    opened = [
        Displacement(box=(-1e-4, y - 1e-4, 1e-4, y + 1e-4), x=0.0, y=y * 1e-4, profile=there_and_back)
        for y in (7.5e-3, -7.5e-3)
    ]
    model = cantilever(Static(load_steps=4), conditions=tuple(opened))
    with simulate(model, None, Options(threads=1)) as results:
        whole, work = results.summary(), results.history()["work"]
    assert abs(work[-1]) < 1e-6 * work[2]
    assert abs(whole["balance"]) < 1e-6  # measured: 1.3e-9
    path = tmp_path / "stopped.sqlite"
    simulate(model, path, Options(threads=1), lambda now: now.step == 3).close()
    with resume(path, 1) as results:
        assert results.summary()["balance"] == whole["balance"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"conditions": (PULL,)}, naming(found=("whole", "around", "can move"), expected="--float")),
        ({"conditions": ()}, naming(found=("loads", "plate"))),
        ({"conditions": (FOOT,)}, naming(found=("loads", "plate"))),
        ({"conditions": (FOOT, NEVER)}, naming(found=("loads", "plate"))),
        (
            {"conditions": (FOOT, Displacement(box=(0.0, 0.0, 1.0, 1e-3), y=1e-6))},
            naming("conditions[1].y", found="$.conditions[0]", expected="displacement"),
        ),
        (
            {"conditions": (Velocity(box=(0.0, -1.0, 1e-4, 1.0), x=1.0),)},
            naming(found="velocity", expected=("load", "displacement")),
        ),
        (
            {"static": Static(load_steps=3), "conditions": (FOOT, PULL)},
            naming("load_steps", found="3", expected="1"),
        ),
        (
            {"static": Static(method="relaxation", floating=True)},
            naming("floating", found="true", expected=("false", "method")),
        ),
        ({"run": Run(solver="static", damping=3.0)}, naming("damping", found="3", expected="leave it out")),
        ({"run": Run(solver="static", start="static")}, naming("start", found="static", expected="leave it out")),
    ],
)
def test_what_cannot_be_solved_at_rest(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        simulate(cantilever(**{"static": Static()} | changes), None, Options(threads=1))


def test_single_precision_is_refused() -> None:
    with pytest.raises(ModelError, match=naming(found="float32", expected="float64")):
        simulate(cantilever(), None, Options(precision="float32"))


def test_a_supported_plate_may_not_turn() -> None:
    hinge = Displacement(box=(-1e-4, -1e-3, 1e-4, 0.0), x=0.0, y=0.0)
    with pytest.raises(ModelError, match=naming(found="whole plate")):
        simulate(conditions_of(cantilever(Static()), hinge, PULL), None, Options(threads=1))


def test_a_free_plate_floats_where_its_loads_balance() -> None:
    pulls = tuple(
        Load(box=(x - 1e-4, -1.0, x + 1e-4, 1.0), body_force=(sign * 1e9, 0.0)) for x, sign in ((0.0, -1), (0.03, 1))
    )
    run = Run(solver="static", static=Static(floating=True))
    with simulate(conditions_of(cantilever(run=run), *pulls), None, Options(threads=1)) as results:
        ux, uy = results.field("ux", 1).reshape(16, 31), results.field("uy", 1).reshape(16, 31)
    assert 0 < np.ptp(ux) < 1e-6
    assert np.allclose(ux, ux[::-1], atol=1e-6 * np.abs(ux).max())
    assert np.allclose(uy, -uy[::-1], atol=1e-6 * np.abs(uy).max())
    with pytest.raises(ModelError, match=naming("496 nodes", "balance")):
        simulate(conditions_of(cantilever(run=run), pulls[0]), None, Options(threads=1))


def halves(**static: Any) -> Model:
    """A plate that is held below and pulled up at one node above, until it is in two."""
    grid = dataclasses.replace(
        square_grid(9, 16, y0=-7.5e-3), cracks=np.array([[-1e-3, 0.0, 2.5e-3, 0.0], [5.5e-3, 0.0, 9e-3, 0.0]])
    )
    held = Displacement(box=(-1.0, -7.6e-3, 1.0, -7.4e-3), x=0.0, y=0.0)
    up = Displacement(box=(3.9e-3, 7.4e-3, 4.1e-3, 7.6e-3), x=0.0, y=2e-4, profile=((0.0, 0.0), (1.0, 1.0)))
    run = Run(solver="static", static=Static(load_steps=6, **static))
    return plate(grid, 3, conditions=(held, up), run=run)


@pytest.mark.filterwarnings("ignore:.*snap-back")
@pytest.mark.parametrize("floating", [False, True])
def test_a_pull_until_a_piece_is_cut_free_ends_without_force(floating: bool) -> None:
    """Named in a warning, unless it was asked for; there is no support that could be missing."""
    with warnings.catch_warnings(record=True) as said:
        warnings.filterwarnings("always", ".*can turn")
        warnings.filterwarnings("ignore", ".*snap-back")
        with simulate(halves(floating=floating), None, Options(threads=1)) as results:
            history, forces = results.history(), results.reactions()
            uy = results.field("uy", 6).reshape(16, 9)
    assert [mentions(each.message, "broke", found="can turn") for each in said] == [True] * (not floating)
    assert uy[8:].mean() == pytest.approx(2e-4, rel=0.1)  # it has turned a little
    pull = np.abs(forces["force_y"][forces["condition"] == forces["condition"].max()])
    assert pull[-1] <= 1e-6 * pull.max()  # measured
    assert history["strain"][-1] < 1e-3 * history["work"][-1]
    spent = history["dissipated"][-1] + history["damped"][-1]
    assert spent == pytest.approx(history["work"][-1], rel=1e-3)


@pytest.mark.filterwarnings("ignore:.*snap-back")
def test_a_piece_that_is_cut_free_under_loads_is_named_and_the_frames_before_are_kept(tmp_path: Path) -> None:
    path, model = tmp_path / "torn.sqlite", halves()
    weight = Load(box=(-1.0, 5e-3, 1.0, 1.0), body_force=(1e3, 0.0))
    with pytest.raises(NotConvergedError, match=naming(re.compile(r"load step \d"), "broke", "balance")):
        simulate(conditions_of(model, *model.settings.conditions, weight), path, Options(threads=1))
    with Results.open(path) as results:
        assert results.meta()["status"] == "unsettled"
        assert len(results.frames()[0]) > 1


def test_relaxation_that_does_not_settle_says_after_how_many_iterations(tmp_path: Path) -> None:
    path = tmp_path / "unsettled.sqlite"
    static = Static(load_steps=3, method="relaxation", iterations=40)
    with pytest.raises(NotConvergedError, match=naming("load step 1", found="40 iterations")):
        simulate(cantilever(static), path, Options(threads=1))
    with Results.open(path) as results:
        assert results.frames()[0].tolist() == [0]


@pytest.mark.slow
def test_bonds_that_soften_are_followed() -> None:
    """Measured: 368 bonds gone and a balance of 8.8e-3, over 19 steps; below the first peak one step, nothing spent."""
    steel = msgspec.structs.replace(STEEL, E=65e9, G0=204)
    with simulate(cantilever(material=steel), None, Options(threads=1)) as results:
        found = results.summary()
    assert found["method"].startswith("path following")
    assert found["broken_bonds"] > 150
    assert abs(found["balance"]) < 2e-2
    with simulate(cantilever(material=steel, opening=1e-7), None, Options(threads=1)) as results:
        found, spent = results.summary(), results.history()["dissipated"][-1]
    assert (found["steps"], found["broken_bonds"], spent) == (1, 0, 0)


def test_a_plan_breaks_nothing() -> None:
    found = estimate_run(cantilever(), Options(threads=1))
    assert (found.steps, found.steps_are_load_steps) == (6, True)
    assert found.wall_time > 0


def strip(**changes: Any) -> Model:
    """A cracked plate of glass that never breaks, held stretched."""
    tough = msgspec.structs.replace(GLASS, G0=1e12)
    ends = tuple(Displacement(box=(-1.0, y - 1e-4, 1.0, y + 1e-4), x=0.0, y=y * 1e-3) for y in (7.5e-3, -7.5e-3))
    run = Run(steps=300, every=100, **changes)
    return cantilever(conditions=ends, material=tough, run=run)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("kernel", ["blocks", "listed"])
def test_a_run_starts_at_rest(kernel: str, tmp_path: Path) -> None:
    with simulate(strip(start="static"), None, Options(threads=1, kernel=kernel)) as results:
        history, before, after = results.history(), results.field("uy", 0), results.field("uy", 300)
        kept = results.meta()["initial_energy"]
    assert history["strain"][0] == pytest.approx(kept, rel=1e-9)
    assert history["kinetic"].max() < 1e-12 * kept  # measured: 1e-17
    assert np.abs(history["strain"] + history["kinetic"] - history["work"] - kept).max() < 1e-6 * kept
    assert np.allclose(before, after, atol=1e-6 * np.abs(before).max())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*which no crack dissipated")
def test_damping_brings_a_plate_to_the_same_rest() -> None:
    with simulate(strip(start="static"), None, Options(threads=1)) as results:
        rest = results.field("uy", 0)
    damped = strip(damping=2e5)
    run = msgspec.structs.replace(damped.settings.run, steps=2000, every=1000)
    damped = dataclasses.replace(damped, settings=msgspec.structs.replace(damped.settings, run=run))
    with simulate(damped, None, Options(threads=1)) as results:
        history, found = results.history(), results.field("uy", 2000)
    assert np.allclose(found, rest, atol=1e-3 * np.abs(rest).max())
    missing = history["strain"] + history["kinetic"] + history["damped"] - history["work"]
    assert not history["dissipated"].any()
    assert abs(missing[-1]) < 1e-3 * history["work"][-1]


def test_a_run_in_single_precision_starts_at_rest_in_double() -> None:
    with simulate(strip(start="static"), None, Options("conservative", "float32", 1)) as results:
        assert abs(results.summary()["balance"]) < 1e-5  # measured: 5e-7
        assert results.summary()["energy"]["kinetic"] < 1e-6 * results.summary()["energy"]["strain"]


def test_loads_that_balance_at_the_start_may_be_others_later() -> None:
    less = ((0.0, 1.0), (1e-7, 1.0), (2e-7, 0.5))
    ends = (
        Load(box=(0.0295, -1.0, 1.0, 1.0), body_force=(1e8, 0.0)),
        Load(box=(-1.0, -1.0, 5e-4, 1.0), body_force=(-1e8, 0.0), profile=less),
    )
    run = Run(start="static", steps=4, time_step=1e-7, static=Static(floating=True))
    with simulate(cantilever(conditions=ends, run=run), None, Options(threads=1)) as results:
        assert results.history()["strain"][0] > 0


@pytest.mark.slow
def test_iterations_are_those_that_were_allowed() -> None:
    """Of a bar pulled to 1.6 times its length, the tangent at rest stalls; three new ones are enough, two are not."""
    far = Load(box=PULL.box, body_force=(5e13, 0.0))
    tough = msgspec.structs.replace(GLASS, G0=1e12)
    seen: list[int] = []

    def look(now: Progress) -> bool:
        seen.extend([] if now.load_step_progress is None else [now.load_step_progress.iterations])
        return False

    def pulled(iterations: int) -> Model:
        return cantilever(Static(iterations=iterations), conditions=(FOOT, far), material=tough)

    with pytest.raises(NotConvergedError, match=naming("2 iterations", "Newton", expected="load steps")) as error:
        simulate(pulled(2), None, Options(threads=1), look)
    assert seen[-3:] == [0, 1, 2]
    assert "support" not in str(error.value)  # which were looked at before
    with simulate(pulled(3), None, Options(threads=1)) as results:
        assert results.field("ux", 1).max() == pytest.approx(0.0184924, rel=1e-5)


@pytest.mark.slow
def test_supports_are_named_where_bodies_are_held_softly() -> None:
    """Of a bar that floats, one Newton step is too few where its halves turn."""
    ends = (
        Load(box=(0.0295, -1.0, 1.0, 1.0), body_force=(1e11, 0.0)),
        Load(box=(-1.0, -1.0, 5e-4, 1.0), body_force=(-1e11, 0.0)),
    )
    model = cantilever(Static(iterations=1, floating=True), conditions=ends)
    with pytest.raises(NotConvergedError, match=naming("1 iterations", "Newton", expected="--float")):
        simulate(model, None, Options(threads=1))
