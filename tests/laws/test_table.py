"""Which law a model's bonds have, and what is said of one that they cannot have."""

from __future__ import annotations

import msgspec
import pytest
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Region, Run
from pdsolve.laws import bilinear, brittle, law_of, ordinary
from pdsolve.model import Model, ModelError
from pdsolve.starts import started
from pdsolve.system import Options, prepare

SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)
STATE_BASED = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2)


def of(material: Material, other: Material | None = None) -> Model:
    """A plate, its right half of another material."""
    regions = (Region(box=(4.1e-3, -1.0, 1.0, 1.0), material=other),) if other else ()
    return plate(square_grid(9, 8), material=material, regions=regions)


def test_springs_mix_and_have_the_law_that_both_follow() -> None:
    assert law_of(of(GLASS)) is brittle
    assert law_of(of(SOFT)) is bilinear
    assert law_of(of(GLASS, SOFT)) is bilinear
    assert law_of(of(STATE_BASED)) is ordinary
    assert prepare(of(STATE_BASED), Options()).system.operator.name == "blocks"


@pytest.mark.parametrize(
    ("material", "other", "says"),
    [
        ({"law": "elastic"}, None, r"\$\.material\.law: found 'elastic', expected one of brittle, bilinear"),
        ({"law": "ordinary"}, None, r"law: found 'ordinary', expected .* \(or material\.model = 'ordinary'\)"),
        ({}, {"law": "elastic"}, r"\$\.regions\[0\]\.material\.law: found 'elastic', expected one of"),
        ({}, {"model": "ordinary", "nu": 0.2}, "law: found brittle and ordinary in one plate, expected one of them"),
        ({"model": "ordinary"}, None, r"\$\.material\.nu: found none, expected Poisson's ratio below 0\.5"),
        ({"model": "ordinary", "nu": 0.5}, None, r"\$\.material\.nu: found 0\.5, expected .* below 0\.5"),
        ({"model": "ordinary", "nu": 0.2, "kr": 2.0}, None, r"\.kr: found 2, expected none with model 'ordinary'"),
        ({"order": 2}, None, r"\.order: found '2', expected none with model 'bond'"),
        ({"model": "micropolar", "nu": 0.35}, None, r"\.nu: found 0\.35, expected 0\.3333 at most"),
        ({"model": "correspondence", "nu": 0.2, "order": 7}, None, r"order: found 7, expected \d at most"),
        ({"model": "correspondence", "nu": 0.2, "solid": "j2"}, None, r"yield_stress: found none"),
        (
            {"model": "correspondence", "nu": 0.2, "hardening": -1.0},
            None,
            r"hardening: found -1, expected 0 Pa or more",
        ),
        ({"failure": "none"}, None, r"\.failure: found 'none', expected one of stretch with model 'bond'"),
    ],
)
def test_laws_that_cannot_be_are_refused(material: dict[str, object], other: dict[str, object], says: str) -> None:
    made = [None if given is None else msgspec.structs.replace(GLASS, **given) for given in (material, other)]
    with pytest.raises(ModelError, match=says):
        prepare(of(*made), Options())  # type: ignore[arg-type]


def test_the_fast_kernel_does_not_know_all_laws() -> None:
    beams = msgspec.structs.replace(GLASS, model="micropolar", nu=0.2)
    assert prepare(of(beams), Options()).system.operator.name == "listed"
    with pytest.raises(ModelError, match=r"kernel: found .* a law that blocks do not know"):
        prepare(of(beams), Options(kernel="blocks"))


@pytest.mark.parametrize(
    ("material", "says"),
    [
        ({"model": "ordinary", "nu": 0.2}, r"failure: found 'stretch', expected 'none' at rest with 'ordinary'"),
        ({"model": "micropolar", "nu": 0.2, "failure": "none"}, r"model: found 'micropolar', expected one without"),
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
        ({"form": "rate"}, r"form: found 'rate', expected 'total' at rest with 'correspondence'"),
        ({"solid": "j2", "yield_stress": 1e8}, r"solid: found 'j2', expected one that does not flow at rest"),
    ],
)
def test_a_run_does_not_begin_at_rest_where_nodes_remember(material: dict[str, object], says: str) -> None:
    """It would remember nothing of it."""
    held = Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0)
    pull = Load(box=(7.9e-3, -1.0, 1.0, 1.0), body_force=(1e6, 0.0))
    kind = msgspec.structs.replace(GLASS, **({"model": "correspondence", "nu": 0.2, "failure": "none"} | material))
    made = plate(square_grid(9, 8), material=kind, conditions=(held, pull), run=Run(start="static"))
    with pytest.raises(ModelError, match=says):
        started(prepare(made, Options()))
