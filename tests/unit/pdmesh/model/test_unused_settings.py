"""Settings that a run does not use are said, each in a line, and what is used is not."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from pdmesh.model.document import (
    Collocation,
    Material,
    Medium,
    ParticleRules,
    Region,
    Run,
    Settings,
    Split,
    Static,
)
from pdmesh.model.mechanical_conditions import Contact
from pdmesh.model.unused_settings import TABLE, remarks, value_of

STEEL = Material(E=2e11, rho=7800, G0=1e4)
KINKED = msgspec.structs.replace(STEEL, kr=3.0)
OF_GEL = Settings(
    physics="diffusion",
    medium=Medium(D=1.0, capped=False),
    run=Run(adapt="collocation", collocation=Collocation(kappa=0.5)),
)
# Used by every run, switches themselves, and what is refused where it would mean nothing
ALWAYS = {"fields", "probes", "gaps", "load_cells", "adapt", "cracks", "until", "quiet", "solver", "start", "damping"}
ALWAYS |= {"device", "damping_time"}


def of(run: Run, **more: Any) -> Settings:
    return Settings(**{"material": STEEL, "run": run, **more})


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            of(Run(theta=0.7)),
            ["$.run.theta (0.7) not used with run.solver explicit"],
        ),
        (
            of(Run(split=Split(levels=2, hold=3))),
            ["$.run.split.hold, $.run.split.levels (3, 2) not used with run.a"],
        ),
        (of(Run(collocation=Collocation(kappa=0.5))), ["$.run.collocation.kappa (0.5) not used with run.adapt"]),
        (of(Run(particles=ParticleRules(most=3))), ["with run.cracks bonds"]),
        (
            of(Run(static=Static(tolerance=1e-3))),
            ["$.run.static.tolerance (0.001) not used with run.solver exp"],
        ),
        (of(Run(static=Static(load_steps=3), start="static")), ["load_steps (3) not used with run.solver expl"]),
        (of(Run(static=Static(load_steps=3))), ["run.solver static (--static), or run.start static"]),
        (
            of(Run(solver="static", steps=7, every=3)),
            ["$.run.steps, $.run.every (7, 3) not used with run.solver"],
        ),
        (
            of(Run(steps=7, duration=1.0)),
            ["$.run.steps (7) not used with run.duration 1.0"],
        ),
        (of(Run(), material=KINKED), ["$.material.kr (3) not used with material.law brittle"]),
        (of(Run(), regions=(Region(nodes=(1,), material=KINKED),)), ["$.regions[0].material.kr (3)"]),
        (
            OF_GEL,
            [
                "$.medium.capped (false) not used with medium.di",
                "$.run.collocation.kappa (0.5) not used with ph",
            ],
        ),
        (
            Settings(physics="diffusion", medium=Medium(D=1.0), contact=Contact()),
            ["$.contact (some) not used with physics diffusion; use physics mechanics or physics thermoelastic"],
        ),
        (of(Run(steps=7, every=3, time_step=1e-9, ledger=1)), []),
        (of(Run(solver="static", static=Static(load_steps=3, tolerance=1e-3))), []),
        (of(Run(adapt="split", split=Split(levels=2))), []),
        (of(Run(adapt="collocation", collocation=Collocation(kappa=0.5))), []),
        (of(Run(cracks="particles", particles=ParticleRules("stress", strength=1.0, branch=0.5))), []),
        (of(Run(), material=msgspec.structs.replace(KINKED, law="bilinear")), []),
    ],
)
def test_what_is_not_used_is_said(settings: Settings, said: list[str]) -> None:
    found = remarks(settings)
    assert len(found) == len(said)
    assert all(any(part in line for line in found) for part in said)


def test_every_setting_of_a_run_is_in_the_table_or_always_used() -> None:
    named = {name.split(".")[1] for row in TABLE for name in row.names if name.startswith("run.")}
    assert named | ALWAYS == set(Run.__struct_fields__)
    assert not named & ALWAYS


def test_every_name_of_the_table_is_a_setting() -> None:
    settings = of(Run(), medium=Medium(D=1.0))
    for row in TABLE:
        for name in (*row.names, *(name for name, _ in row.switches)):
            value_of(settings, name)
