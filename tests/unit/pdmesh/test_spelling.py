"""Names are known by their meaning, and by their letters."""

from __future__ import annotations

import pytest

from pdmesh.drawing.parameters import NAMES
from pdmesh.model.document import Settings
from pdmesh.model.suggestions import dotted_names
from pdmesh.spelling import OTHER_NAMES, meant

OPTIONS = ("--output", "--force", "--threads", "--resume", "--static", "--every", "--window", "--largest", "--rate")


@pytest.mark.parametrize(
    ("word", "known", "other"),
    [
        ("material.young", dotted_names(Settings), "material.E"),
        ("--dt", dotted_names(Settings), "run.time_step"),
        ("poisson", dotted_names(Settings), "material.nu"),
        ("density", dotted_names(Settings), "material.rho"),
        ("toughness", ("E", "rho", "G0"), "G0"),
        ("Gc", dotted_names(Settings), "material.G0"),
        ("dx", NAMES, "Zones/NAME/Spacing"),
        ("--cores", OPTIONS, "--threads"),
        ("--overwrite", OPTIONS, "--force"),
        ("--restrt", OPTIONS, "--resume"),
        ("--quasi-static", OPTIONS, "--static"),
        ("--zoom", OPTIONS, "--window"),
        ("--fps", OPTIONS, "--rate"),
        ("--vmax", OPTIONS, "--largest"),
        ("--outptu", OPTIONS, "--output"),
        ("Peridynamics/material/rhoo", [f"Peridynamics/{name}" for name in NAMES], "Peridynamics/Material/rho"),
        ("Peridynamics/Zones/fine/dx", ["Peridynamics/Zones/fine/Spacing", "Peridynamics/Bodies/fine/Spacing"],
         "Peridynamics/Zones/fine/Spacing"),
        ("Fixes/right/Displacment", [f"Fixes/right/Displacement {axis}" for axis in "zxy"],
         "Fixes/right/Displacement x"),  # the first of several that are as near
        ("xyzzy", OPTIONS, ""),
        ("--field", OPTIONS, ""),  # no misspelt --file, which is another word for --output
        ("--material", OPTIONS, ""),  # nor interval, for --every
        ("--frame", OPTIONS[:5], ""),  # nor --force
        ("--overwrit", OPTIONS, "--force"),
    ],
)  # fmt: skip
def test_a_name_is_known_by_its_meaning_or_its_letters(word: str, known: tuple[str, ...], other: str) -> None:
    assert meant(word, known) == other


def test_other_names_lead_to_names_that_exist() -> None:
    """A key of the table that nothing is called any more would suggest nothing."""
    from pdmesh.__main__ import parser as of_pdmesh
    from pdpost.__main__ import parser as of_pdpost
    from pdsolve.__main__ import parser as of_pdsolve

    names = {name.rsplit(".", 1)[-1] for name in dotted_names(Settings)} | {name.split("/")[-1] for name in NAMES}
    for program in (of_pdmesh(), of_pdpost(), of_pdsolve()):
        commands = [action.choices for action in program._actions if isinstance(action.choices, dict)]
        for parser in (program, *(command for choices in commands for command in choices.values())):
            names |= {option.removeprefix("--") for option in parser._option_string_actions}
    values = {
        "bond",
        "ordinary",
        "correspondence",
        "j2",
        "brittle",
        "neo hooke",
        "orthotropic",
        "svk",
        "explicit",
        "static",
    }
    known = {name.lower().replace(" ", "_") for name in names} | {"cmap", "size", "figsize"}
    assert {own for own in OTHER_NAMES if own.lower().replace(" ", "_") not in known} <= values | {"horizon"}
