"""What kinds of materials say of themselves is whole, and is what the pages say."""

from __future__ import annotations

from typing import get_args, get_type_hints

import pytest

from benchmarks.combinations import ALL, PAGE, combinations, every_feature, instead, parameters
from benchmarks.pages import read_block
from pdmesh.model.document import Material
from pdmesh.model.materials import KINDS
from pdmesh.model.materials.solids import SOLIDS

SHARED = {"E", "rho", "G0", "critical_stretch", "nu", "alpha", "T0", "model", "micromodulus", "plane", "sight"}
SHARED |= {"gamma", "failure", "calibration", "coarse"}


def test_every_setting_is_shared_or_of_a_kind() -> None:
    own = {parameter for kind in KINDS.values() for parameter in kind.parameters}
    assert own | SHARED == set(Material.__struct_fields__)
    assert not own & SHARED


def test_every_word_of_the_file_is_a_kind_and_a_solid() -> None:
    hints = get_type_hints(Material)
    assert set(get_args(hints["model"])) == set(KINDS)
    assert set(get_args(hints["solid"])) == set(SOLIDS)
    assert set(get_args(hints["failure"])) == {word for kind in KINDS.values() for word in kind.failures}


def test_the_page_of_combinations_is_what_the_table_says() -> None:
    assert read_block(ALL, "features") == every_feature()
    assert read_block(ALL, "instead") == instead()


@pytest.mark.parametrize(("name", "table"), [("settings", parameters()), ("combinations", combinations())])
def test_the_page_is_what_materials_say(name: str, table: str) -> None:
    assert read_block(PAGE, name) == table
