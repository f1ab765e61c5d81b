"""Materials in other units, and laws whose bonds push when they are stretched."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from messages import mentions, naming
from node_clouds import cubic_grid
from plates import GLASS, STEEL, plate, square_grid

from pdmesh import Material, Scene, box, build
from pdmesh.model.document import Region, Run
from pdsolve.checks import refuse_fields
from pdsolve.laws import LAWS
from pdsolve.laws.law import Limits, Pair, Sizes, Softening
from pdsolve.laws.material_checks import negative_secant, remarks
from pdsolve.model import ModelError
from pdsolve.run.accounts import instability_message


def test_E_in_GPa_is_noticed() -> None:
    """Bonds of glass with E = 65 Pa would stretch to 43 times their length; those of glass and steel say nothing."""
    wrong = Material(E=65.0, rho=2235.0, G0=204.0)
    (said,) = remarks(plate(square_grid(5, 5), material=wrong))
    assert mentions(said, "$.material", "E = 65 Pa", "0.1")
    region = Region(material=wrong, nodes=(3,))
    (said,) = remarks(plate(square_grid(5, 5), regions=(region,)))
    assert mentions(said, "$.regions[0].material", "E = 65 Pa")
    for material in (GLASS, STEEL):
        assert remarks(plate(square_grid(5, 5), material=material)) == []
    assert mentions("".join(build(Scene(box(0, 0, 0.02, 0.01), 1e-3, wrong)).notes), "material", "E = 65")


def test_a_small_scaled_problem_is_built() -> None:
    built = build(Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=1e-3, rho=1e-20, G0=1e-12)))
    assert mentions("".join(built.notes), "waves", "m/s")


def limits(material: Material, bonds: Sizes) -> Limits:
    return Limits(bonds.critical, bonds.critical)


@pytest.mark.parametrize(
    ("secant", "found"),
    [
        (lambda law, stretch, worst, peak, limit: 1 - 2 * stretch / limit, "0.52 of the limit"),
        (lambda law, stretch, worst, peak, limit: stretch * np.nan, "0.016 of the limit"),
        (lambda law, stretch, worst, peak, limit: 1 - stretch / limit, None),
        (lambda law, stretch, worst, peak, limit: 1 + 2 * stretch / limit, "-0.52 of the limit"),
    ],
)
def test_a_negative_secant_is_named(secant: object, found: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    pair = Pair(limits=limits, secant=secant)  # type: ignore[arg-type]
    said = negative_secant(pair, "brittle", 1e-3, 1e-3)
    assert said is None if found is None else said is not None and mentions(said, "law 'brittle'", found)


def test_a_softened_bond_is_looked_at_in_compression_where_it_has_its_secant_there() -> None:
    """A secant of 1 under tension and -worst / limit under compression."""
    nothing: Any = lambda *_: 0.0  # noqa: E731

    def secant(law: Any, stretch: Any, worst: Any, peak: float, limit: float) -> Any:
        return np.where(stretch > 0, 1.0, -worst / limit)

    softening = Softening(nothing, nothing, nothing)
    pair = Pair(limits=limits, secant=secant, softening=softening)
    said = negative_secant(pair, "bilinear", 1e-3, 4e-3)
    assert said is not None
    assert mentions(said, "-0.016 of the limit", "pull where they are compressed")
    one_sided = Pair(limits=limits, secant=secant, softening=softening, elastic_in_compression=True)
    assert negative_secant(one_sided, "bilinear", 1e-3, 4e-3) is None


def test_an_unstable_run_names_the_law_whose_secant_turns_negative(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not loads; without such a law these are named."""
    model = plate(square_grid(5, 5), material=GLASS)
    scheme = SimpleNamespace(symmetric=True, name="conservative")
    bonds = SimpleNamespace(intact_stiffness_bound=lambda: None)  # pairs
    system: Any = SimpleNamespace(model=model, time_step=1.0, stable_time_step=2.0, scheme=scheme, operator=bonds)
    system.initial_energy, system.ranks = 0.0, None
    books: Any = SimpleNamespace(step=3, time=3.0, work=1.0, kinetic=5.0, strain=0.0)
    assert "check loads" in instability_message(system, books, 1.0, 7)
    wrong = Pair(limits=limits, secant=lambda law, stretch, worst, peak, limit: 1 - 2 * stretch / limit)
    monkeypatch.setitem(LAWS, "brittle", replace(LAWS["brittle"], pair=wrong))
    said = instability_message(system, books, 1.0, 7)
    assert mentions(said, "unstable at step 3", "the law 'brittle'")
    assert "check loads" not in said


def test_no_shipped_law_has_one() -> None:
    for name, law in LAWS.items():
        assert law.pair is not None
        assert negative_secant(law.pair, name, 1e-3, 3e-3) is None


def test_fields_along_z_may_be_asked_of_a_body() -> None:
    """And not of a plate; an operator without fields of its own."""
    operator: Any = SimpleNamespace(fields=lambda _: {})
    run = Run(steps=1, fields=("ux", "uz", "vz", "az"))
    glass = msgspec.structs.replace(GLASS, plane="space")
    refuse_fields(plate(cubic_grid(3), 2.0, material=glass, run=run), operator, None)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=naming("$.run.fields", found="'uz'")):
        refuse_fields(plate(square_grid(3, 3), run=run), operator, None)  # type: ignore[arg-type]
