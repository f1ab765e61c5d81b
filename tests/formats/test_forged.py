"""Databases of results of anyone's making: one line or an answer, never a traceback, a signal or no end."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import tracemalloc
import zlib
from pathlib import Path

import diffusion_models
import numpy as np
import pytest
from crack_particle_strips import pulled
from forged_databases import COMMANDS, apart
from messages import mentions, naming
from plates import plate, square_grid
from tampered_databases import tampered

from pdmesh.model.document import Load, ParticleRules, Run
from pdpost.__main__ import main as pdpost
from pdpost.__main__ import parser
from pdsolve.results import DamagedError, Results, ResultsError, tables
from pdsolve.run.simulation import Options, simulate


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of databases: a plate that breaks, one whose cracks are particles, and a disc that dissolves."""
    folder = tmp_path_factory.mktemp("whole")
    grid = dataclasses.replace(square_grid(14, 8, y0=-3.5e-3), cracks=np.array([[0.0, 0.0, 5e-3, 0.0]]))
    ends = tuple(
        Load(name=name, box=(0.0, low, 13e-3, low + 1.2e-3), body_force=(0.0, pull))
        for name, low, pull in (("top", 2.4e-3, 9e10), ("bottom", -3.6e-3, -9e10))
    )
    run = Run(time_step=50e-9, steps=60, every=20, ledger=5, probes=((0.0, 0.0), (1e-2, 0.0)))
    for name, model in (
        ("whole", plate(grid, conditions=ends, run=run)),
        ("grown", pulled(ParticleRules(criterion="stress", strength=2.5e7))),
        ("disc", diffusion_models.disc(0.5, 20)),
    ):
        simulate(model, folder / f"{name}.sqlite", Options(threads=1)).close()
    return folder


@pytest.fixture
def path(whole: Path, tmp_path: Path) -> Path:
    """The plate's, to change."""
    return Path(shutil.copy(whole / "whole.sqlite", tmp_path))


def packed(*numbers: int) -> bytes:
    """Bonds as a database has them."""
    return zlib.compress(np.array(numbers, dtype="<i4").tobytes())


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("ahead", [10**6, -(10**6), 2**31 - 1, 112, -1])
def test_neighbours_that_do_not_exist(path: Path, ahead: int, capsys: pytest.CaptureFixture[str]) -> None:
    """SciPy would follow them out of its arrays."""
    with Results.open(path) as results:
        bonds = len(results.families().neighbour)
    with tampered(path) as connection:
        connection.execute("UPDATE family_chunk SET ahead = ?", (packed(*[ahead] * bonds),))
    assert pdpost(["bonds", str(path), "-o", str(path.with_suffix(".png"))]) == 2
    said = capsys.readouterr().err
    assert mentions(said, "family_chunk", found=("neighbours", "not exist"))
    assert said.count("\n") == 1


@pytest.mark.slow
def test_what_inflates_to_more_than_there_are_bonds_is_not_inflated(path: Path) -> None:
    bomb = zlib.compress(bytes(2**28))
    for column in ("ahead", "bonds"):
        with tampered(path) as connection:
            connection.execute(f"UPDATE family_chunk SET {column} = ?", (bomb,))
        tracemalloc.start()
        with Results.open(path) as results, pytest.raises(DamagedError, match=naming("family_chunk")):
            results.families()
        assert tracemalloc.get_traced_memory()[1] < 2**24
        tracemalloc.stop()


@pytest.mark.slow
def test_pages_that_lead_in_circles_end(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A query is given up that takes more operations than a file of its size can ask for."""
    monkeypatch.setattr(tables, "LEAST", 0)
    monkeypatch.setattr(tables, "OPERATIONS", 100)
    monkeypatch.setattr(tables, "PER_BYTE", 0)
    with pytest.raises(ResultsError, match=naming("pages", "circles", expected="whole")):
        Results.open(path)


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize(
    ("sql", "said"),
    [
        ("UPDATE node SET x = 1e300 WHERE row = 5", naming("node", found="node 6")),
        ("UPDATE node SET delta = -1", naming("node", found="node 1")),
        ("UPDATE node SET area = 9e999", naming("node", found="node 1")),
        ("UPDATE bond_break SET neighbour = 999", naming("bond_break", found="node 999")),
        ("UPDATE bond_break SET step = 2 WHERE rowid = 200", naming("bond_break", found=("bonds", "break"))),
        ("UPDATE frame SET time = 9e999 WHERE step = 60", naming("frame", found=("time", "inf"))),
        ("UPDATE frame SET time = -1 WHERE step = 60", naming("frame", found=("frames", "times"))),
        ("UPDATE history SET work = 1e200", naming("history", found="1e+200")),
        ("UPDATE history SET strain = 'x'", naming("history", found=("str", "strain"), expected="REAL")),
        ("UPDATE field_chunk SET data = substr(data, 5)", naming(found="field_chunk")),
        ("UPDATE meta SET value = 0 WHERE key = 'time_step'", naming("meta", found=("'0'", "time_step"))),
        ("DELETE FROM meta WHERE key = 'initial_energy'", naming("meta", found="initial_energy")),
        ("UPDATE reaction SET condition = 7 WHERE condition = 1", naming(found="condition 7")),
        ("UPDATE meta SET value = '{}' WHERE key = 'model'", naming("model", found="missing")),
        ("DELETE FROM node", naming("node", found="node")),
        ("UPDATE epoch SET step = 3", naming("epoch", found="[3]")),
    ],
)
def test_what_cannot_be_is_named(path: Path, sql: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Although the checksums agree."""
    with tampered(path) as connection:
        connection.execute(sql)
    assert pdpost(["report", str(path), "-o", str(path.with_suffix(".html"))]) == 2
    found = capsys.readouterr().err
    assert re.search(said, found)
    assert found.count("\n") == 1


def test_a_whole_archive_is_verified(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in whole.glob("*.sqlite"):
        assert pdpost(["verify", str(path)]) == 0
        said = capsys.readouterr().out
        assert said.count("\n") == 1
        assert said.startswith(f"{path}: ok: ")
    assert pdpost(["verify", str(whole / "whole.sqlite"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["ok"], found["nodes"], found["frames"], found["last"]) == (True, 112, 4, 60)


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize(
    ("sql", "said"),
    [
        ("UPDATE history SET strain = strain * 1.01", "strain energy of the nodes"),
        ("UPDATE history SET broken = broken + 1 WHERE step = 60", "energy balance: 337 bonds are broken at step 60"),
        ("UPDATE history SET time = time * 1.001", "time is"),
        ("DELETE FROM history WHERE step = 20", "energy balance: there is no entry of step 20"),
        ("DELETE FROM bond_break WHERE rowid = 3", "292 bonds are broken at step 15"),
        (
            "INSERT INTO bond_break SELECT * FROM bond_break ORDER BY rowid DESC LIMIT 1",
            "breaks twice",
        ),
        ("UPDATE frame SET step = 21 WHERE step = 20", "no frame of step 20|expected one every 20|no entry"),
        ("UPDATE node SET cut = cut + 1, family = family + 1 WHERE row = 3", "damage of node 4 at step 0 is 0"),
        ("UPDATE mass SET inside = inside * 2 WHERE step > 0", "table mass"),
        ("DELETE FROM meta WHERE key = 'summary'", "finished without a summary"),
        ("UPDATE meta SET value = '[]' WHERE key = 'summary'", "table meta: the summary is none"),
    ],
)
def test_parts_that_do_not_agree_are_named(
    whole: Path, path: Path, sql: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each of them is whole."""
    if "mass" in sql:
        shutil.copy(whole / "disc.sqlite", path)
    with tampered(path) as connection:
        connection.execute(sql)
    assert pdpost(["verify", str(path)]) == 2
    found = capsys.readouterr().err
    assert re.search(said, found), found
    assert found.startswith(f"pdpost: {path}: ")


def test_a_bit_that_has_turned_is_found(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = bytearray(path.read_bytes())
    data[-5000] ^= 1
    path.write_bytes(data)
    assert pdpost(["verify", str(path)]) == 2
    assert "its" in capsys.readouterr().err


def test_every_command_is_run() -> None:
    actions = parser()._subparsers._group_actions[0].choices  # type: ignore[union-attr]
    assert set(COMMANDS) == set(actions or ())


@pytest.mark.slow
def test_forged_results(whole: Path) -> None:
    """Some files, some commands for each, so that all have their turns."""
    assert apart("forged_runs", whole, 1, 18, 1) == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.endurance)])
def test_many_forged_results(count: int, whole: Path) -> None:
    assert apart("forged_runs", whole, 2, count, 2, limit=3000) == []
