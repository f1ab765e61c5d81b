"""Fine nodes near cracks alone or everywhere, chosen before the first step; and fine nodes that come too late."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import mentions, naming
from plates import GLASS, plate, shipped, square_grid
from zoned_plates import rectangle

from pdmesh.drawing.additions import ADAPT
from pdmesh.model.document import Acceleration, Hybrid, InitialDisplacement, InitialVelocity, Load, Pin, Run, Velocity
from pdmesh.model.material import Material
from pdmesh.model.material_constants import pressure_speed
from pdsolve.adaptivity.hybrid.adaptivity_choice import (
    _estimate_largest_strain,
    choose_adaptivity,
    predict_zone_size_and_cost,
)
from pdsolve.errors import UnstableError
from pdsolve.model import Model, ModelWarning
from pdsolve.results import Results
from pdsolve.run.simulation import Options, prepare, resume, simulate

# Cost of the steps over that with fine nodes everywhere, as docs/verification/adaptivity.md has it
MEASURED = {
    "duran50.geo": 1.17,
    "duran_metre.py": 0.33,
    "figure_18.geo": 1.6,
    "figure_19.py": 0.40,
    "kalthoff_winkler.geo": 1.5,
    "kalthoff_winkler_steel.py": 0.53,
    "oblique_crack.geo": 1.18,
    "plate_with_hole.geo": 1.6,
    "v_notch.geo": 0.41,
}


def scene(name: str) -> Model:
    """A shipped scene that is to be solved as costs less."""
    built = shipped(name, [(ADAPT, "auto")])
    return Model(built.grid, built.settings, name)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", MEASURED)
def test_what_costs_less_is_taken(name: str) -> None:
    """Within a tenth of the cheaper one: where the two cost as much, either may be taken."""
    with pytest.warns(ModelWarning, match=naming(name, "$.run.adapt")):
        how = choose_adaptivity(scene(name), Options()).settings.run.adapt
    assert how == ("hybrid" if MEASURED[name] < 1 else "none")


@pytest.mark.slow
def test_the_strain_of_conditions_is_counted() -> None:
    """A struck edge gives v / c_p, a pulled one twice the stress over E; the stretch that makes cells fine is known."""
    built = shipped("kalthoff_winkler_steel.py", [(ADAPT, "hybrid")])
    found = predict_zone_size_and_cost(Model(built.grid, built.settings), Options())
    np.testing.assert_allclose(found.strain_over_refinement_strain, 16.5 / 5353 / (0.7 * 9.562e-3), rtol=1e-3)  # 0.4605
    np.testing.assert_allclose(found.fine_share_at_start, 0.054, atol=5e-4)


def test_the_strain_of_accelerations_spins_and_initial_displacements_is_counted() -> None:
    """A plate of 24 x 20 mm: of a ramp of 1 mm, of 1e9 m/s^2 along x, and of 1e5 rad/s."""
    grid, speed = square_grid(24, 20), pressure_speed(GLASS)
    everywhere = tuple(range(1, 481))
    strains = [
        _estimate_largest_strain(plate(grid, conditions=(condition,)))
        for condition in (
            InitialDisplacement(nodes=everywhere, x=1e-3),
            Acceleration(nodes=everywhere, x=1e9),
            InitialVelocity(nodes=everywhere, spin=1e5),
        )
    ]
    length = 23e-3
    assert strains == pytest.approx(
        [1e-3 / length, 2 * 1e9 * length / speed**2, 2 * (1e5 * length / speed) ** 2 / 8], rel=1e-12
    )


def test_a_total_force_strains_as_its_traction_does() -> None:
    """On the top of a plate 23 mm wide between its outermost nodes."""
    top = (-1.0, 19e-3 - 1e-4, 1.0, 1.0)
    loads = Load(box=top, traction=(0.0, 2e6)), Load(box=top, force=(0.0, 2e6 * 23e-3))
    found = [_estimate_largest_strain(plate(square_grid(24, 20), conditions=(load,))) for load in loads]
    assert found[0] == pytest.approx(found[1])
    assert found[0] == pytest.approx(2 * 2e6 / GLASS.E)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"area_rule": "square"}, ("$.area_rule", "square")),
        ({"conditions": (Pin(box=(5e-3, 5e-3, 9e-3, 9e-3), centre=(7e-3, 7e-3)),)}, ("$.conditions[0]", "pin")),
        (
            {"material": Material(E=65e9, rho=2235.0, G0=204.0, model="ordinary", nu=0.2)},
            ("none", "families"),
        ),
        ({"material": msgspec.structs.replace(GLASS, law="cohesive", f_t=3e7)}, ("none", "bilinear")),
    ],
)
def test_what_a_moving_zone_refuses_is_fine_everywhere(changes: dict[str, object], words: tuple[str, ...]) -> None:
    model = plate(square_grid(24, 20), **({"run": Run(steps=1, adapt="auto")} | changes))
    with pytest.warns(ModelWarning, match=naming("$.run.adapt", *words)):
        found = prepare(model, Options()).system
    assert found.moving_zone_operator is None
    assert found.requested_model.settings.run.adapt == "none"


def test_nodes_on_no_lattice_are_solved_as_they_are() -> None:
    grid = square_grid(24, 20)
    grid = dataclasses.replace(grid, position=grid.position * np.array([1.0, 1.01]))
    with pytest.warns(ModelWarning, match=naming("$.run.adapt", "$.nodes")):
        assert prepare(plate(grid, run=Run(steps=1, adapt="auto")), Options()).system.moving_zone_operator is None


def stretched(speed: float, adapt: str = "hybrid", kappa: float = 0.7, begins: float = 0.0) -> Model:
    """A cracked plate whose ends move apart at twice this `speed`, m/s, all at once at the time `begins`, s."""
    grid = rectangle(60, 100, 5e-4, [(0, 50.5, 12.5, 50.5)])
    profile = ((0.0, 0.0), (begins, 0.0), (1.001 * begins, 1.0)) if begins > 0 else ()
    ends = [
        Velocity(box=(-1.0, y - 1.2e-3, 1.0, y + 1.2e-3), y=way * speed, profile=profile)
        for y, way in ((0.05, 1.0), (0.0, -1.0))
    ]
    run = Run(steps=120, every=40, adapt=adapt, hybrid=Hybrid(kappa=kappa))
    return plate(grid, 4.0, conditions=tuple(ends), run=run)


def jerked(kappa: float = 0.7) -> Model:
    """The same, whose ends move so fast, and at such a moment, that their wave strains the border within 8 steps."""
    return stretched(7.0, kappa=kappa, begins=6.913e-6)


@pytest.mark.slow
def test_fine_cells_that_come_too_late_come_earlier(tmp_path: Path) -> None:
    """From the last frame before that on: until then the run is as it was. It is the same to the bit if it was stopped
    before or after it has gone back, or has no file."""
    late, stopped, again = (tmp_path / f"{name}.sqlite" for name in ("late", "stopped", "again"))
    warned = naming("step 71", "goes back to step 0", "run.hybrid.kappa 0.5", "from step 40 on")
    with pytest.warns(ModelWarning, match=warned):
        simulate(jerked(), late).close()
    simulate(jerked(), stopped, watch=lambda progress: progress.step == 40).close()
    with pytest.warns(ModelWarning, match=naming("step 71", "goes back to step 40", "from step 40 on")):
        resume(stopped, watch=lambda progress: progress.step == 80).close()
    with resume(stopped) as results:
        assert results.meta()["status"] == "finished"
    assert contents(stopped) == contents(late)
    with pytest.warns(ModelWarning, match=warned):
        simulate(jerked(), again, watch=lambda progress: progress.step == 80).close()
    resume(again).close()
    assert contents(again) == contents(late)
    with pytest.warns(ModelWarning, match=warned):
        kept = simulate(jerked())
    with Results.open(late) as results:
        assert np.array_equal(kept.breaks().node, results.breaks().node)
        assert results.history()["fine_share"][-1] == kept.history()["fine_share"][-1] == 1.0


def with_run(model: Model, **changes: object) -> Model:
    """The same with other settings of the run."""
    run = msgspec.structs.replace(model.settings.run, **changes)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))


@pytest.mark.slow
def test_a_checkpoint_after_that_frame_is_none_to_go_back_to(tmp_path: Path) -> None:
    """The steps from the frame on were taken without the cells that are to come sooner: all are taken anew."""
    late, stopped = (tmp_path / f"{name}.sqlite" for name in ("late", "stopped"))
    model = with_run(jerked(), ledger=8)
    warned = naming("step 71", "goes back to step 0", "from step 40 on")
    with pytest.warns(ModelWarning, match=warned):
        simulate(model, late).close()
    simulate(model, stopped, watch=lambda progress: progress.step == 56).close()
    with Results.open(stopped) as results:
        assert results.checkpoint_step() == 56
    with pytest.warns(ModelWarning, match=warned):
        resume(stopped).close()
    assert contents(stopped) == contents(late)


@pytest.mark.slow
def test_a_run_that_is_late_at_its_start_begins_anew_with_cells_that_come_earlier(tmp_path: Path) -> None:
    """It is a run with that trigger to the bit."""
    late, wider = (tmp_path / f"{name}.sqlite" for name in ("late", "wider"))
    with pytest.warns(ModelWarning, match=naming("step 36", "begins anew", "run.hybrid.kappa 0.5")):
        simulate(stretched(5.0), late).close()
    simulate(stretched(5.0, kappa=0.5), wider).close()
    assert contents(late) == contents(wider)


@pytest.mark.slow
@pytest.mark.parametrize("every", [30, 120])
def test_the_frames_of_a_run_change_no_cells_that_come_earlier(every: int) -> None:
    """They come from the same step on, to the same end."""
    breaks, balances = [], []
    for interval in (40, every):
        with pytest.warns(ModelWarning, match=naming("step 71", "from step 40 on")):
            results = simulate(with_run(jerked(), every=interval))
        breaks.append(results.breaks())
        balances.append(results.summary()["energy"])
        results.close()
    assert len(breaks[0].step) > 0
    assert all(np.array_equal(*columns) for columns in zip(*breaks, strict=True))
    assert balances[0] == balances[1]


@pytest.mark.slow
def test_a_struck_plate_has_its_fine_cells_in_time() -> None:
    """Bonds at the border that come near their limit make cells fine; without that, they are late at step 31."""
    spacings = [("Zones/fine/Spacing", "2.83e-3"), ("Zones/coarse/Spacing", "5.66e-3")]
    built = shipped("kalthoff_winkler.geo", [(ADAPT, "hybrid"), *spacings])
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", ModelWarning)
        results = simulate(Model(built.grid, built.settings, "struck"), None, Options(threads=1))
    assert not [each for each in found if mentions(each.message, "too late")]
    assert len(results.breaks().step) > 8000  # measured: 8802


@pytest.mark.slow
def test_no_wider_zone_cures_steps_that_are_too_long(tmp_path: Path) -> None:
    """Twice the surely stable step stretches what lies at the border; the run ends, and does not begin anew."""
    model = stretched(3.0)
    sure = prepare(model, Options(threads=1)).system.stable_time_step
    run = msgspec.structs.replace(model.settings.run, time_step=2 * sure)
    model = Model(model.grid, msgspec.structs.replace(model.settings, run=run))
    with (
        pytest.warns(ModelWarning) as found,
        pytest.raises(UnstableError, match=naming("time step", f"{sure:.3g} s")),
    ):
        simulate(model, tmp_path / "long.sqlite")
    with Results.open(tmp_path / "long.sqlite") as results:
        assert results.meta()["status"] == "unstable"
    assert not [each for each in found if mentions(each.message, "kappa") or mentions(each.message, "adapt none")]


@pytest.mark.slow
def test_in_the_end_all_nodes_are_fine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the widest trigger is too late as well, the run is that without a moving zone."""
    monkeypatch.setattr("pdsolve.adaptivity.hybrid.adaptivity_choice.WIDER", (0.69,))  # at 0.5 this zone grows in time
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", ModelWarning)
        one = simulate(stretched(5.0))
    said = [str(each.message) for each in found if mentions(each.message, "step 36")]
    assert all(
        mentions(line, word) for line, word in zip(said, ("run.hybrid.kappa 0.69", "run.adapt none"), strict=True)
    )
    other = simulate(stretched(5.0, "none"))
    for name in ("energy", "broken_bonds", "balance", "kernel"):
        assert one.summary()[name] == other.summary()[name]


def test_a_plate_stretched_everywhere_is_not_tried() -> None:
    """Ends pulled apart so fast that their wave alone makes cells fine."""
    found = predict_zone_size_and_cost(stretched(8.0), Options())
    load = Load(box=(-1.0, -1.0, 1.0, 1.0), body_force=(0.0, 1e9))
    assert found.strain_over_refinement_strain > 1
    assert found.fine_share_at_end == 1
    settings = msgspec.structs.replace(stretched(8.0).settings, conditions=(load,))
    pulled = predict_zone_size_and_cost(dataclasses.replace(stretched(8.0), settings=settings), Options())
    np.testing.assert_allclose(
        pulled.strain_over_refinement_strain / found.strain_over_refinement_strain,
        2 * 1e9 * 0.05 / 65e9 / (8.0 / 5720),
        rtol=1e-2,
    )
