"""Which law a model's bonds have, and what is said of one that they cannot have."""

from __future__ import annotations

import msgspec
import pytest
from messages import naming
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Region, Run
from pdsolve.laws import law_of, ordinary
from pdsolve.laws.pair_laws import bilinear, brittle
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.initial_states import start_in_static_equilibrium
from pdsolve.run.prepare import prepare

SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)
STATE_BASED = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2)


def of(material: Material, other: Material | None = None) -> Model:
    """A plate, its right half of another material."""
    regions = (Region(box=(4.1e-3, -1.0, 1.0, 1.0), material=other),) if other else ()
    return plate(square_grid(9, 8), material=material, regions=regions)


def test_springs_mix_and_have_the_law_that_both_follow() -> None:
    assert law_of(of(GLASS)) is brittle.LAW
    assert law_of(of(SOFT)) is bilinear.LAW
    assert law_of(of(GLASS, SOFT)) is bilinear.LAW
    assert law_of(of(STATE_BASED)) is ordinary.LAW
    assert prepare(of(STATE_BASED), Options()).system.operator.name == "blocks"


@pytest.mark.quick_cases(11)
@pytest.mark.parametrize(
    ("material", "other", "says"),
    [
        ({"law": "elastic"}, None, naming("$.material.law", found="'elastic'", expected=("brittle", "bilinear"))),
        ({"law": "ordinary"}, None, naming("law", found="'ordinary'", expected="material.model = 'ordinary'")),
        ({}, {"law": "elastic"}, naming("$.regions[0].material.law", found="'elastic'")),
        ({}, {"model": "ordinary", "nu": 0.2}, naming("law", found=("brittle", "ordinary"))),
        ({"model": "ordinary"}, None, naming("$.material.nu", found="missing", expected=("Poisson's", "below 0.5"))),
        ({"model": "ordinary", "nu": 0.5}, None, naming("$.material.nu", found="0.5", expected="below 0.5")),
        ({"model": "ordinary", "nu": 0.2, "kr": 2.0}, None, naming("kr", found="2", expected="model 'ordinary'")),
        ({"order": 2}, None, naming("order", found="'2'", expected="model 'bond'")),
        ({"model": "micropolar", "nu": 0.35}, None, naming("nu", found="0.35", expected="0.3333")),
        ({"model": "correspondence", "nu": 0.2, "order": 7}, None, naming("order", found="7")),
        ({"model": "correspondence", "nu": 0.2, "solid": "j2"}, None, naming("yield_stress", found="missing")),
        (
            {"model": "correspondence", "nu": 0.2, "hardening": -1.0},
            None,
            naming("hardening", found="-1", expected="0 Pa"),
        ),
        ({"failure": "none"}, None, naming("failure", found="'none'", expected="model 'bond'")),
    ],
)
def test_laws_that_cannot_be_are_refused(material: dict[str, object], other: dict[str, object], says: str) -> None:
    made = [None if given is None else msgspec.structs.replace(GLASS, **given) for given in (material, other)]
    with pytest.raises(ModelError, match=says):
        prepare(of(*made), Options())  # type: ignore[arg-type]


def test_the_fast_kernel_does_not_know_all_laws() -> None:
    beams = msgspec.structs.replace(GLASS, model="micropolar", nu=0.2)
    assert prepare(of(beams), Options()).system.operator.name == "listed"
    with pytest.raises(ModelError, match=naming("kernel", found="blocks", expected=("listed", "law"))):
        prepare(of(beams), Options(kernel="blocks"))


@pytest.mark.parametrize(
    ("material", "says"),
    [
        (
            {"model": "correspondence", "nu": 0.2, "form": "rate"},
            naming("failure", found="'stretch'", expected=("'none'", "'rate'", "static")),
        ),
        ({"model": "micropolar", "nu": 0.2, "failure": "none"}, naming("model", found="'micropolar'")),
    ],
)
def test_what_is_not_followed_at_rest_is_refused(material: dict[str, object], says: str) -> None:
    pulled = (
        Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=-1e-6, y=0.0),
        Displacement(box=(7.9e-3, -1.0, 1.0, 1.0), x=0.0),
    )
    kind = msgspec.structs.replace(GLASS, **material)
    made = plate(square_grid(9, 8), material=kind, conditions=pulled, run=Run(solver="static"))
    with pytest.raises(ModelError, match=says):
        prepare(made, Options())


@pytest.mark.parametrize(
    ("material", "says"),
    [
        ({"form": "rate"}, naming("form", found="'rate'", expected=("total", "static"))),
        ({"solid": "j2", "yield_stress": 1e8}, naming("solid", found="'j2'", expected=("'linear'", "static"))),
    ],
)
def test_a_run_does_not_begin_at_rest_where_nodes_remember(material: dict[str, object], says: str) -> None:
    """It would remember nothing of it."""
    held = Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0)
    pull = Load(box=(7.9e-3, -1.0, 1.0, 1.0), body_force=(1e6, 0.0))
    kind = msgspec.structs.replace(GLASS, **({"model": "correspondence", "nu": 0.2, "failure": "none"} | material))
    made = plate(square_grid(9, 8), material=kind, conditions=(held, pull), run=Run(start="static"))
    with pytest.raises(ModelError, match=says):
        start_in_static_equilibrium(prepare(made, Options()))
