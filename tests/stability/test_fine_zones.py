"""Fine zones that move."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable

import msgspec
from failures import Said
from plates import plate
from zones import again, rectangle, struck

from pdmesh.model.cloud import Grid
from pdmesh.model.document import Horizon, Load, Run
from pdsolve.adaptive.lattice import COARSE, FINE
from pdsolve.model import Model
from pdsolve.system import Options, prepare

RAMP = ((0.0, 0.0), (2e-6, 1.0))


def first_break(adapt: str, tips: bool = True) -> tuple[int, float]:
    """The step in which the struck plate's first bond breaks, and energy that refining made until then over the work;
    with its tips coarse at the start, if wanted."""
    problem = prepare(struck(adapt), Options(threads=1))
    shown = problem.system.hybrid
    if shown is not None and not tips:
        shown.hybrid.zone.cells[shown.hybrid.zone.cells == FINE] = COARSE
        again(shown.hybrid)
    for step in range(1, 170, 8):
        problem.march(step, step + 8)
        broken = problem.system.operator.broken().step
        if len(broken):
            _, work, made = shown.hybrid.spent if shown is not None else (0.0, 1.0, 0.0)
            return int(broken.min()), made / work
    return 170, 0.0


def test_tips_under_load(failure: Callable[..., None]) -> None:
    """Tips that become fine under load.

    Next to the tip of a crack displacements turn within a spacing. Coarse nodes do not know that, so new fine nodes
    between them start in the wrong places, and bonds that should wait break, or the other way round.
    """
    uniform, _ = first_break("none")
    ahead, made = first_break("hybrid")
    late, made_late = first_break("hybrid", tips=False)
    assert abs(ahead - uniform) <= 1
    assert abs(late - uniform) >= 4  # measured
    assert abs(made_late) > 10 * abs(made)
    failure(
        fails=f"A struck plate whose tips are coarse until they are stretched breaks its first bond in step {late}, the"
        f" uniform one in step {uniform}; making its tips fine has changed its energy by {abs(made_late):.1%} of the"
        " work done.",
        noticed="By the energy that refining makes: in the summary, and in `history`.",
        cure=f"Cells within 12 h of all tips are fine before they are loaded: step {ahead}, and {abs(made):.2%}.",
    )


def test_a_border_that_is_stretched(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Bonds stretched at the border of a fine zone.

    Clipped bonds do not break. Where a plate is pulled so suddenly that it tears everywhere, damage is at the border
    of the fine zone before more becomes fine.
    """
    grid, pull = rectangle(40, 30, 1e-3), 60e6 / 1.5e-3
    loads = (
        Load(box=(-1.0, -1.0, 1.0, 1.1e-3), body_force=(0.0, -pull), profile=RAMP),
        Load(box=(-1.0, 28.9e-3, 1.0, 1.0), body_force=(0.0, pull), profile=RAMP),
    )
    models = [plate_of(grid, loads, adapt) for adapt in ("hybrid", "none")]
    stopped, whole = (pdsolve(model) for model in models)
    assert (stopped.code, whole.code) == (3, 0)
    assert len(stopped.err) == 1
    assert "found a bond at the border of the fine zone stretched to" in stopped.err[0]
    failure(
        fails="A plate pulled at its edges by 60 MPa within two microseconds tears faster than its fine zone grows.",
        noticed="The run is stopped (exit code 3), its frames so far kept.",
        says=stopped.err,
        cure="`--adapt none`: where much of a plate breaks at once, little would stay coarse.",
    )


def test_zones_too_narrow(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Zones that are narrow for their horizon.

    Cells become fine within 8 spacings of what breaks. A horizon of 5 or 6 of them is most of that: bonds that may
    break end beyond the zone, where they are clipped and cannot.
    """
    runs = {ratio: pdsolve(with_horizon(struck("hybrid", steps=85), ratio), "--json") for ratio in (4.0, 5.0, 6.0)}
    assert [said.code for said in runs.values()] == [0, 3, 3]
    for ratio in (5.0, 6.0):
        assert "found a bond at the border of the fine zone stretched to" in runs[ratio].err[-1]
    stretch = json.loads("\n".join(runs[4.0].out))["hybrid"]["clipped_stretch"]
    assert stretch < 0.6  # measured 0.52
    failure(
        fails="The struck plate with horizons of 5 and 6 spacings.",
        noticed="The run is stopped (exit code 3), its frames so far kept.",
        says=[runs[5.0].err[-1], runs[6.0].err[-1]],
        cure="Horizons of 3 or 4 spacings, as here: 4 spacings go on, no clipped bond beyond"
        f" {stretch:.2f} of its limit. Or `--adapt none`.",
    )


def with_horizon(model: Model, ratio: float) -> Model:
    """The same with another horizon over the spacing."""
    settings = msgspec.structs.replace(model.settings, horizon=Horizon(ratio))
    return dataclasses.replace(model, settings=settings)


def plate_of(grid: Grid, loads: tuple[Load, ...], adapt: str) -> Model:
    """A plate of glass under these loads."""

    return plate(grid, 4, conditions=loads, run=Run(time_step=1e-7, steps=60, every=20, adapt=adapt))
