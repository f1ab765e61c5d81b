"""Settings with which bonds do not tire and cracks do not grow as loads repeat."""

from __future__ import annotations

from collections.abc import Iterator

from pdmesh.model.document import Condition, Fatigue, ParticleRules, Settings
from pdmesh.model.refusals import Impossible, Places


def of_fatigue(settings: Settings, fatigue: Fatigue, every: Places) -> Iterator[Impossible]:
    """Settings with which bonds do not tire."""
    run, why = settings.run, "as loads repeat"
    yield from _of_lines(fatigue) if run.cracks == "bonds" else _of_growth(fatigue, run.particles)
    for name, value, usual in (
        ("static.floating", str(run.static.floating).lower(), "false"),
        ("static.load_steps", str(run.static.load_steps), "None"),
    ):
        if value != usual:
            yield Impossible(f"$.run.{name}", value, f"{usual}, {why}")
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, Condition) and condition.profile:
            place = f"$.conditions[{number}].profile"
            yield Impossible(place, f"{len(condition.profile)} points", "none, as loads are the largest of a cycle")
    if settings.physics != "mechanics":
        yield Impossible("$.physics", settings.physics, f"mechanics, {why}")
    for place, material in every:
        if material.model != "bond" and run.cracks == "bonds":
            yield Impossible(f"{place}.model", material.model, f"bond, {why}")
        elif material.law != "brittle":
            yield Impossible(f"{place}.law", material.law, f"brittle, {why}")


def _of_growth(fatigue: Fatigue, rules: ParticleRules) -> Iterator[Impossible]:
    """Settings with which cracks of particles do not grow by Paris's line."""
    usual, words = Fatigue(), "with cracks that are particles"
    for name in ("C", "m"):
        if getattr(fatigue, name) is None:
            yield Impossible(f"$.run.fatigue.{name}", "none", f"a number, {words}")
    for name in ("A", "A1", "m1", "endurance", "threshold", "damaged", "blocks"):
        if getattr(fatigue, name) != getattr(usual, name):
            yield Impossible(f"$.run.fatigue.{name}", f"{getattr(fatigue, name)}", f"none {words}")
    if rules.criterion != "intensity":
        yield Impossible("$.run.particles.criterion", rules.criterion, "intensity, as cracks grow by it")


def _of_lines(fatigue: Fatigue) -> Iterator[Impossible]:
    """Halves of a line of growth or initiation, and what is of particles."""
    for name in ("C", "threshold_K"):
        if getattr(fatigue, name):
            yield Impossible(f"$.run.fatigue.{name}", f"{getattr(fatigue, name):g}", "A in its place, as bonds tire")
    if fatigue.A is None and fatigue.A1 is None:
        yield Impossible("$.run.fatigue.A", "none", "a number, or A1")
    for pair in (("A", "m"), ("A1", "m1")):
        for name, partner in (pair, pair[::-1]):
            if getattr(fatigue, name) is None and getattr(fatigue, partner) is not None:
                yield Impossible(f"$.run.fatigue.{name}", "none", f"a number, with {partner}")
