"""What the names of physical groups mean, and what is said of those that mean nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from messages import mentions, naming

from pdmesh.drawing import body_of_groups, plate_of_groups
from pdmesh.drawing.group_names import MOST, Meaning, Physical, meaning
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.quantities import UNITS
from pdmesh.scene.shapes import SceneError

ZONE = Physical("zone:plate", 2, 1)
SPACED = {"Zones/plate/Spacing": 1e-3}


def plate(*groups: Physical, values: Mapping[str, Any] = SPACED, zones: Any = ()) -> Meaning:
    given = {PREFIX + name: value for name, value in values.items()}
    return meaning(groups, zones, plate_of_groups.KINDS, Parameters(given, UNITS["m"]))


@pytest.mark.parametrize(
    ("group", "shown"),
    [
        (Physical("", 1, 5), "Physical Curve(5)"),
        (Physical("Inlet", 1, 2), 'Physical Curve("Inlet")'),
        (Physical("Embedded point", 0, 3), 'Physical Point("Embedded point")'),
        (Physical("My surface", 2, 7), 'Physical Surface("My surface")'),
        (Physical("", 3, 9), "Physical Volume(9)"),
        (Physical("Öffnung oben", 1, 4), 'Physical Curve("Öffnung oben")'),
        (Physical("wall:1", 1, 4), 'Physical Curve("wall:1")'),
    ],
)
def test_groups_of_others_are_said_not_to_be_used(group: Physical, shown: str) -> None:
    found = plate(ZONE, group)
    assert found.groups["zone"] == {"plate": 0}
    (note,) = found.notes
    assert note == f"not used: {shown}"


@pytest.mark.parametrize(
    ("name", "dimension", "meant"),
    [
        ("Load/top", 1, "load:top"),
        ("Loads/top", 1, "load:top"),
        ("zone/fine", 2, "zone:fine"),
        ("Zone:fine", 2, "zone:fine"),
        ("zones:fine", 2, "zone:fine"),
        ("Fixes/left", 1, "fix:left"),
        ("craks:a", 1, "crack:a"),
        ("laod : top", 1, "load:top"),
        ("load:", 1, "load:NAME"),
        ("crack", 1, "crack:NAME"),
        ("crack:a", 2, "crack:a"),
        ("zone:fine", 1, "zone:fine"),
        ("ZONE:fine", 2, "zone:fine"),
    ],
)
def test_a_name_that_is_almost_ours_is_refused_with_its_spelling(name: str, dimension: int, meant: str) -> None:
    shape = ("Point", "Curve", "Surface")[dimension]
    with pytest.raises(SceneError, match=naming(f'{shape}("{name}")', expected=f'("{meant}")')) as caught:
        plate(ZONE, Physical(name, dimension, 2))
    assert len(str(caught.value)) < 120  # and not every form that there is


@pytest.mark.parametrize(
    ("name", "meant"),
    [("crack tip", "crack:tip"), ("load_top", "load:top"), ("Fix-1", "fix:1"), ("Material", "material:NAME")],
)
def test_words_that_others_use_too_are_asked_about(name: str, meant: str) -> None:
    (note,) = plate(ZONE, Physical(name, 1, 2)).notes
    assert mentions(note, "not used", f'("{name}")', f'"{meant}"')


def test_a_kind_alone_is_a_plain_word_in_a_drawing_of_others() -> None:
    zones = [{"name": "plate", "groups": []}]
    whole, unused = plate(ZONE, Physical("solid", 1, 2), zones=zones).notes
    assert mentions(whole, "zone 'plate'", "all surfaces")
    assert mentions(unused, 'Curve("solid")')


def test_many_groups_are_one_short_line() -> None:
    (note,) = plate(ZONE, *(Physical("x" * 1000, 1, number) for number in range(2, 102))).notes
    assert mentions(note, f"and {100 - MOST} more groups")
    assert len(note) < 1000


def test_a_name_in_two_dimensions() -> None:
    """Names of others may be in several; of ours, which of the two is meant is not clear."""
    (note,) = plate(ZONE, Physical("rim", 1, 2), Physical("rim", 2, 3)).notes
    assert mentions(note, 'Curve("rim")', 'Surface("rim")')
    with pytest.raises(SceneError, match=naming('"load:a"', found=("curve", "surface"))):
        plate(ZONE, Physical("load:a", 1, 2), Physical("load:a", 2, 3))
    with pytest.raises(SceneError, match=naming('"load:a"', found=("point", "curve"))):
        plate(ZONE, Physical("load:a", 0, 2), Physical("load:a", 1, 3))


def test_a_group_that_parameters_name_is_used() -> None:
    """Without a kind in its name it is what the parameters say, unless they place the condition themselves."""
    inlet, steel = Physical("Inlet", 1, 2), Physical("steel", 2, 3)
    found = plate(ZONE, inlet, steel, values={**SPACED, "Loads/Inlet/Traction x": 1.0, "Materials/steel/E": 2e11})
    assert (found.groups["load"], found.groups["material"]) == ({"Inlet": 1}, {"steel": 2})
    assert found.notes == ()
    placed = plate(ZONE, inlet, values={**SPACED, "Loads/Inlet/Traction x": 1.0, "Loads/Inlet/Edge": "left"})
    assert placed.groups["load"] == {}
    assert mentions(placed.notes, "not used", 'Curve("Inlet")')


def test_a_group_of_a_zone_may_be_a_region_too() -> None:
    steel, glass = Physical("steel", 2, 2), Physical("glass", 2, 3)
    zones = [{"name": "plate", "groups": [2, 3]}]
    found = plate(ZONE, steel, glass, values={**SPACED, "Materials/steel/E": 2e11}, zones=zones)
    assert found.groups["material"] == {"steel": 1}
    (note,) = found.notes
    assert mentions(note, "zone 'plate'", 'Surface("steel")', 'Surface("glass")')


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"Loads/top/Traction x": 1.0}, 'Physical Curve("load:top")'),
        ({"Zones/fine/Spacing": 1e-3}, 'Physical Surface("zone:fine")'),
        ({"Loads/steel/Traction x": 1.0}, 'Physical Curve("load:steel")'),  # not that of the volume
    ],
)
def test_the_group_that_is_missing_is_named(values: dict[str, float], named: str) -> None:
    groups = (ZONE, Physical("Inlet", 1, 2), Physical("steel", 3, 3))
    with pytest.raises(SceneError, match=naming(named, found="missing")):
        plate(*groups, values={**SPACED, **values})


def test_a_drawing_without_zones_and_spacing_is_told_both() -> None:
    zones = [{"name": "plate", "groups": []}]
    with pytest.raises(SceneError, match=naming("zones", expected=("zone:NAME", "Zones/plate/Spacing="))):
        plate(ZONE, values={}, zones=zones)


def test_groups_of_plates_are_refused_in_bodies() -> None:
    groups = (Physical("zone:body", 3, 1), Physical("pin:a", 2, 2))
    parameters = Parameters({f"{PREFIX}Zones/body/Spacing": 1.0}, UNITS["m"])
    kinds, others = body_of_groups.KINDS, body_of_groups.KINDS_OF_PLATES
    with pytest.raises(SceneError, match=naming('Surface("pin:a")', found=("'pin:'", "body"), expected="crack")):
        meaning(groups, [], kinds, parameters, others)
    flat = (groups[0], Physical("", 1, 2), Physical("Top & right", 2, 100))
    (note,) = meaning(flat, [], kinds, parameters, others).notes
    assert note == 'not used: Physical Curve(2), Physical Surface("Top & right")'


def test_a_name_with_a_slash_has_no_parameters() -> None:
    with pytest.raises(SceneError, match=naming('Curve("load:a/b")', found="'/'")):
        plate(ZONE, Physical("load:a/b", 1, 2))
    assert plate(ZONE, Physical("crack:a/b", 1, 2)).groups["crack"] == {"a/b": 1}  # which have none anyway
