"""Sets of Abaqus files: members that are no numbers, sets that name each other, ranges that name all numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from abaqus_files import NO_NUMBER, PARTS, PLATE, refusal, written

from pdmesh.drawing.abaqus import read_abaqus


@pytest.mark.parametrize("lines", ["*ELSET, ELSET=a\nWORD", "*NSET, NSET=a\n1, WORD", "*SURFACE, NAME=a\nWORD, S1"])
def test_members_that_are_no_numbers(lines: str, tmp_path: Path) -> None:
    for word in filter(None, NO_NUMBER):
        message = refusal(tmp_path, PLATE + lines.replace("WORD", word))
        assert f"line 9: {lines.split(',')[0]}: '{word[:60]}" in message


@pytest.mark.parametrize("side", ["S\u00b2", "S" + "1" * 5000, "S", "SPOS"])
def test_sides_that_are_no_numbers(side: str, tmp_path: Path) -> None:
    mesh = read_abaqus(written(tmp_path, f"{PLATE}*SURFACE, NAME=a\n7, {side}\n7, S2\n"))
    assert [block.data.tolist() for block in mesh.cells] == [[[0, 1, 2, 3]], [[1, 2]]]


def test_ranges_cost_what_there_is(tmp_path: Path) -> None:
    most = 10**18 - 1
    rows = f"{-most},{most},1\n{most},{-most},-1\n" + "1,1000000000000,1\n" * 1000
    mesh = read_abaqus(
        written(tmp_path, f"{PLATE}*ELSET, ELSET=a, GENERATE\n{rows}*NSET, NSET=b, GENERATE\n2,{most},2")
    )
    assert mesh.cell_sets["a"][0].tolist() == [0]
    assert mesh.point_sets["b"].tolist() == [1, 3]


@pytest.mark.parametrize("members", ["S{0}", "S{0}, S{0}", "S{0}, S{1}"])
@pytest.mark.parametrize("level", ["part", "assembly", "file"])
def test_long_chains_of_sets(level: str, members: str, tmp_path: Path) -> None:
    """The last set comes first, so that resolving it goes through all others, each once and not 2^1500 times."""
    chain = "".join(f"*ELSET, ELSET=S{k}\n{members.format(k - 1, k - 2)}\n" for k in range(1500, 1, -1))
    chain += "*ELSET, ELSET=S1\nS0\n*ELSET, ELSET=S0{}\n7\n".format(", INSTANCE=one" * (level == "assembly"))
    before = {"part": "*END PART", "assembly": "*END ASSEMBLY", "file": ""}[level]
    text = PARTS.replace("ROW\n", "").replace(before, chain + before) if before else PLATE + chain
    sets = read_abaqus(written(tmp_path, text)).cell_sets
    assert len(sets) == 1501
    assert [rows.tolist() for rows in sets["S1500"]] == [[0]]


@pytest.mark.parametrize("level", ["part", "file"])
def test_sets_in_a_circle(level: str, tmp_path: Path) -> None:
    circle = "".join(f"*ELSET, ELSET=S{k}\n7, S{k - 1}\n" for k in range(1, 1500)) + "*ELSET, ELSET=S0\ns1499\n"
    text = PLATE + circle if level == "file" else PARTS.replace("ROW\n", "").replace("*END PART", circle + "*END PART")
    assert "*ELSET: '" in (message := refusal(tmp_path, text))
    assert "is defined by itself" in message


def test_members_of_an_instance_by_number_and_name(tmp_path: Path) -> None:
    text = PARTS.replace("ROW\n", "").replace("*END PART", "*ELSET, ELSET=whole\n7\n*END PART")
    rows = "*ELSET, ELSET=a\none.7\n*ELSET, ELSET=b\nONE.whole, a\n"
    sets = read_abaqus(written(tmp_path, text.replace("*END ASSEMBLY", rows + "*END ASSEMBLY"))).cell_sets
    assert {name: rows[0].tolist() for name, rows in sets.items()} == {"whole": [0], "a": [0], "b": [0]}
    assert "line 16: *ELSET: '.7'" in refusal(tmp_path, text.replace("*END ASSEMBLY", "*ELSET, ELSET=a\n.7\n"))


def test_names_in_quotes(tmp_path: Path) -> None:
    text = f'{PLATE}*ELSET, ELSET="my set"\n7\n*ELSET, ELSET=b\n"MY set",\n*SURFACE, NAME=c\n"my set", S2\n'
    sets = read_abaqus(written(tmp_path, text)).cell_sets
    assert {name: [rows.tolist() for rows in blocks] for name, blocks in sets.items()} == {
        "my set": [[0], []],
        "b": [[0], []],
        "c": [[], [0]],
    }
