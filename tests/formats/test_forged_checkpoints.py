"""Checkpoints of anyone's making, their checksums right: a run goes on from what a run has written alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from forged_checkpoints import stopped
from forged_databases import apart
from messages import mentions
from tampered_databases import tampered

from benchmarks.kinds_of_run import KINDS
from pdsolve.__main__ import main as pdsolve

SOON = (
    "bonds",
    "bonds, listed",
    "bilinear",
    "particles",
    "at rest",
    "split",
    "dissolution",
    "dissolution, kinetic",
)  # seconds to compile


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of runs that were stopped half way, one of each kind that is soon compiled."""
    folder = tmp_path_factory.mktemp("halves")
    stopped(folder, {name: KINDS[name]() for name in SOON})
    return folder


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where a forged one is."""
    return tmp_path / "forged.sqlite"


def put(path: Path, name: str, values: np.ndarray) -> None:  # type: ignore[type-arg]
    """Let an array of a checkpoint be another."""
    with tampered(path) as connection:
        connection.execute(
            "UPDATE checkpoint SET type = ?, data = ? WHERE name = ?", (values.dtype.str, values.tobytes(), name)
        )


def taken(path: Path, name: str) -> np.ndarray:  # type: ignore[type-arg]
    """An array of a checkpoint."""
    with tampered(path) as connection:
        kind, data = connection.execute("SELECT type, data FROM checkpoint WHERE name = ?", (name,)).fetchone()
    return np.frombuffer(data, dtype=kind).copy()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name", "change", "found", "expected"),
    [
        ("bonds", "value", lambda values: values[:-1], ("'value'", "values"), ()),
        ("bonds", "rate", lambda values: values * np.nan, ("nan", "'rate'"), "numbers"),
        ("bonds", "second", lambda values: values.astype("<f4"), ("'second'", "float32"), "float64"),
        ("bonds", "held_force", lambda values: np.zeros(7), ("'held_force'", "7"), ()),
        ("bonds", "worst_source", lambda values: np.array([3], dtype=np.int64), ("'worst_source'", "1"), "0"),
        ("bilinear", "worst_target", lambda values: values - 10**6, "'worst_target'", "0"),
        ("bilinear", "worst_target", lambda values: values * 0, "row", "model"),
        ("bilinear", "worst", lambda values: values[:-1], "values", ()),
        ("at rest", "rested", lambda values: values[:-5], "'rested'", "20"),
        ("at rest", "rested", lambda values: values + 1, "load steps", "checkpoint"),
        ("particles", "particle_parent", lambda values: values + 5, "'particle_parent'", "numbers"),
        ("particles", "particle_step", lambda values: values + 1, ("particles", "pre-cracks"), "first"),
        ("particles", "particle_place", lambda values: values * 1000, "'particle_place'", "numbers"),
        ("particles", "particle_remarks", lambda values: values[:-1], "'particle_remarks'", ()),
        ("split", "ids", lambda values: values[::-1], "cells", "leaves"),
        ("split", "ids", lambda values: values * 2**40, "cells", "leaves"),
        ("split", "calm", lambda values: values - 10**6, "'calm'", "0"),
        ("split", "made", lambda values: values * np.inf, "'made'", ()),
        ("split", "broken_target", lambda values: values + 10**9, "row", ()),
        ("split", "broken_step", lambda values: values + 10**9, "step", "20"),
        ("dissolution", "value", lambda values: values / 0.0, "'value'", "numbers"),
        ("dissolution, kinetic", "solid", lambda values: values + 2, "'solid'", "1"),
        ("dissolution", "work", lambda values: values[:1], ("'work'", "1"), "384"),
    ],
)
def test_what_no_run_has_written_is_named(
    halves: Path, path: Path, capsys: pytest.CaptureFixture[str], *, kind, name, change, found, expected
) -> None:  # type: ignore[no-untyped-def]
    """Before anything of it is used."""
    shutil.copy(halves / f"{kind}.sqlite", path)
    with np.errstate(all="ignore"):
        put(path, name, change(taken(path, name)))
    assert pdsolve(["--resume", str(path), "-q"]) == 2
    said = capsys.readouterr().err
    assert mentions(said, path, "checkpoint", found=found, expected=expected)
    assert said.count("\n") == 1


@pytest.mark.slow
def test_a_particle_that_grew_from_itself_is_named(
    halves: Path, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A crack is followed from its tip to where it began."""
    shutil.copy(halves / "particles.sqlite", path)
    for name, value in (("place", (9e-3, 8e-3)), ("normal", (0.0, 1.0)), ("parent", (2,)), ("step", (3,))):
        values = taken(path, f"particle_{name}")
        put(path, f"particle_{name}", np.append(values, np.array(value, dtype=values.dtype)))
    assert pdsolve(["--resume", str(path), "-q"]) == 2
    assert mentions(capsys.readouterr().err, "checkpoint", found="grew", expected="before")


@pytest.mark.slow
@pytest.mark.parametrize("kind", SOON)
def test_arrays_that_are_missing_are_named(
    halves: Path, path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with tampered(halves / f"{kind}.sqlite") as connection:
        names = [name for (name,) in connection.execute("SELECT name FROM checkpoint")]
    for name in names:
        shutil.copy(halves / f"{kind}.sqlite", path)
        with tampered(path) as connection:
            connection.execute("DELETE FROM checkpoint WHERE name = ?", (name,))
        assert pdsolve(["--resume", str(path), "-q"]) == 2, name
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("sql", "found"),
    [
        ("UPDATE checkpoint SET step = 1000", "1000"),
        ("UPDATE bond_break SET neighbour = (SELECT max(node) FROM node) WHERE rowid = 1", "row"),
        ("INSERT INTO bond_break SELECT * FROM bond_break WHERE rowid = 1", "twice"),
    ],
)
def test_bonds_and_steps_that_do_not_agree_are_named(
    halves: Path, path: Path, sql: str, found: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(halves / "bonds.sqlite", path)
    with tampered(path) as connection:
        connection.execute(sql)
        rows = connection.execute("SELECT * FROM bond_break ORDER BY step, rowid").fetchall()
        connection.execute("DELETE FROM bond_break")
        connection.executemany(f"INSERT INTO bond_break VALUES ({', '.join('?' * len(rows[0]))})", rows)
    assert pdsolve(["--resume", str(path), "-q"]) == 2
    said = capsys.readouterr().err
    assert mentions(said, path, found=found)
    assert said.count("\n") == 1


@pytest.mark.slow
def test_forged_checkpoints(halves: Path) -> None:
    """One of each kind, in turn."""
    assert apart("forged_stops", halves, 1, len(SOON), module="forged_checkpoints") == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.endurance)])
def test_many_forged_checkpoints(count: int, tmp_path: Path) -> None:
    """Of every kind of run that there is; those that are sound go on."""
    stopped(tmp_path, {name: make() for name, make in KINDS.items()})
    assert apart("sound_stops", tmp_path, module="forged_checkpoints") == []
    assert apart("forged_stops", tmp_path, 2, count, module="forged_checkpoints", limit=3000) == []
