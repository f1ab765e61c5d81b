"""Files that are not what was written: refused, or nothing comes of it; never other numbers."""

from __future__ import annotations

import lzma
import random
import re
import sqlite3
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents
from messages import naming
from tampered_databases import tampered

from pdsolve.model import Model
from pdsolve.results import DamagedError, Results, ResultsError, remove
from pdsolve.results.checksums import Checksum, select_schema
from pdsolve.results.schema import TABLES
from pdsolve.results.writer import PAGE
from pdsolve.run.simulation import resume, simulate


def zeroed_page(data: bytearray, dice: random.Random) -> None:
    at = dice.randrange(len(data) // PAGE) * PAGE
    data[at : at + PAGE] = bytes(PAGE)


def turned_bit(data: bytearray, dice: random.Random) -> None:
    data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)


def turned_bit_at_the_head_of_a_page(data: bytearray, dice: random.Random) -> None:
    at = dice.randrange(len(data) // PAGE) * PAGE + dice.randrange(100)
    data[at] ^= 1 << dice.randrange(8)


def zeroed_bytes(data: bytearray, dice: random.Random) -> None:
    at, count = dice.randrange(len(data)), dice.choice([16, 512, 4096])
    data[at : at + count] = bytes(min(count, len(data) - at))


def cut_short(data: bytearray, dice: random.Random) -> None:
    del data[dice.randrange(len(data)) :]


def swapped_pages(data: bytearray, dice: random.Random) -> None:
    one, other = (dice.randrange(len(data) // PAGE) * PAGE for _ in range(2))
    data[one : one + PAGE], data[other : other + PAGE] = data[other : other + PAGE], data[one : one + PAGE]


DAMAGE: tuple[Callable[[bytearray, random.Random], None], ...] = (
    zeroed_page,
    turned_bit,
    turned_bit_at_the_head_of_a_page,
    zeroed_bytes,
    cut_short,
    swapped_pages,
)


@pytest.fixture
def stopped(probed: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """The file of a run that was interrupted between two entries of the ledger, bonds broken."""
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    path = tmp_path / "stopped.sqlite"
    with simulate(probed, path, watch=lambda progress: progress.step == 33) as results:
        assert results.checkpoint()[0] == 33
        assert 0 < results.breaks().step.max() <= 33
    monkeypatch.undo()
    return path.read_bytes()


@pytest.fixture(params=[2, 3, 4, 5, 6])
def older(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A file of an older schema, written by the program of that time: a small plate stopped at step 50 of 60."""
    path = tmp_path / "older.sqlite"
    path.write_bytes(lzma.decompress(Path(__file__).with_name(f"schema_{request.param}.sqlite.xz").read_bytes()))
    return path


def everything(results: Results) -> list[bytes | str]:
    """All that can be read, as bytes."""
    steps, times = results.frames()
    fields = [results.field(name, int(step)) for step in steps for name in results.stored(int(step))]
    tables = [results.history(), results.probes(), results.reactions(), results.cracks(), steps, times]
    step, state = results.checkpoint()
    arrays = [*fields, *tables, *results.nodes(), *results.families(), *results.breaks(), np.array(step)]
    return [*(array.tobytes() for array in [*arrays, *state.values()]), results.model(), repr(results.meta())]


def compared(path: Path, data: bytes, count: int, use: Callable[[Path], object], expected: object) -> Counter[bool]:
    """Damage a file again and again: how often using it was refused, and how often it made no difference."""
    dice, found = random.Random(0), Counter[bool]()
    for number in range(count):
        damage, spoilt, said = DAMAGE[number % len(DAMAGE)], bytearray(data), ""
        damage(spoilt, dice)
        remove(path)
        path.write_bytes(spoilt)
        try:
            assert use(path) == expected, (damage.__name__, number)
        except ResultsError as error:
            said = str(error)
        assert said == "" or (str(path) in said and "\n" not in said)
        found[bool(said)] += 1
    return found


@pytest.mark.slow
def test_a_damaged_run_is_refused_or_goes_on_as_if_nothing_had_been(
    probed: Model, stopped: bytes, tmp_path: Path
) -> None:
    """Two hundred times."""
    simulate(probed, tmp_path / "whole.sqlite").close()
    expected = contents(tmp_path / "whole.sqlite")

    def resumed(path: Path) -> object:
        resume(path).close()
        return contents(path)

    found = compared(tmp_path / "spoilt.sqlite", stopped, 200, resumed, expected)
    assert min(found.values()) > 30, found


@pytest.mark.slow
def test_what_is_read_is_what_was_written(stopped: bytes, tmp_path: Path) -> None:
    path = tmp_path / "spoilt.sqlite"

    def read(path: Path) -> list[bytes | str]:
        with Results.open(path) as results:
            return everything(results)

    path.write_bytes(stopped)
    found = compared(path, stopped, 300, read, read(path))
    assert min(found.values()) > 60, found


# of a small plate; see test_epochs, test_space and test_particles
EMPTY = ("checksum", "node_death", "crack_face", "crack_particle", "mass")


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("table", [name for name in TABLES if name not in EMPTY])
def test_a_table_less_a_row_is_refused(stopped: bytes, tmp_path: Path, table: str) -> None:
    """What SQLite itself cannot see."""
    path = tmp_path / "less.sqlite"
    path.write_bytes(stopped)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"DELETE FROM {table} WHERE rowid = (SELECT min(rowid) FROM {table})")
        connection.commit()
    with pytest.raises(DamagedError, match=naming(found=(table, "damaged"))):
        resume(path)


@pytest.mark.parametrize(("table", "column"), [("field_chunk", "data"), ("checkpoint", "data"), ("meta", "value")])
def test_a_large_value_that_is_another_is_refused(stopped: bytes, tmp_path: Path, table: str, column: str) -> None:
    path = tmp_path / "other.sqlite"
    path.write_bytes(stopped)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"UPDATE {table} SET {column} = x'00' WHERE rowid = (SELECT max(rowid) FROM {table})")
        connection.commit()
    with pytest.raises(DamagedError, match=naming(found=(table, "damaged"))):
        resume(path)


def test_a_field_less_a_chunk_is_not_a_shorter_one(small_results: Path) -> None:
    with closing(sqlite3.connect(small_results)) as connection:
        connection.execute("UPDATE checksum SET rows = 2000 WHERE name = 'node'")
        connection.commit()
    with (
        Results.open(small_results) as results,
        pytest.raises(DamagedError, match=naming(found=("field_chunk", "damaged"))),
    ):
        results.field("ux", 20)


@pytest.mark.slow
def test_a_vacuum_does_no_harm(probed: Model, stopped: bytes, tmp_path: Path) -> None:
    """What a user does to a file of his own."""
    path = tmp_path / "kept.sqlite"
    path.write_bytes(stopped)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("VACUUM")
    with resume(path) as resumed, simulate(probed) as whole:
        assert everything(resumed)[:-1] == everything(whole)[:-1]


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize(
    "sql",
    [
        "CREATE TABLE mine (x)",
        "CREATE INDEX quicker ON bond_break (node)",
        "CREATE VIEW other AS SELECT * FROM node",
        "CREATE TRIGGER hidden AFTER INSERT ON meta BEGIN DELETE FROM node; END",
        "ALTER TABLE node ADD COLUMN more",
        "DROP VIEW node_state",
        "DROP TABLE crack; CREATE VIEW crack AS SELECT x AS x0, y AS y0, x AS x1, y AS y1 FROM node",
    ],
)
def test_what_is_not_ours_is_refused(stopped: bytes, tmp_path: Path, sql: str) -> None:
    """Tables, indexes, views and triggers of others, and our own tables otherwise; checksums agree."""
    path = tmp_path / "other.sqlite"
    path.write_bytes(stopped)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(sql)
        schema = Checksum().of("schema", connection.execute(select_schema()))
        connection.execute("UPDATE checksum SET rows = ?, crc = ? WHERE name = 'schema'", schema)
        connection.commit()
    with pytest.raises(DamagedError, match=naming("other.sqlite", expected="pdsolve")):
        Results.open(path)


@pytest.mark.parametrize("version", [2, 4])  # one bit of it
def test_a_file_with_checksums_does_not_pass_for_an_older_one(stopped: bytes, tmp_path: Path, version: int) -> None:
    path = tmp_path / "turned.sqlite"
    path.write_bytes(stopped)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"PRAGMA user_version = {version}")
    with pytest.raises(DamagedError, match=naming(found=("schema", "damaged"))):
        Results.open(path)


def test_changed_checksums_are_those_of_the_changed_tables(stopped: bytes, tmp_path: Path) -> None:
    """What other tests change databases with."""
    path = tmp_path / "changed.sqlite"
    path.write_bytes(stopped)
    with tampered(path) as connection:
        connection.execute("UPDATE meta SET value = 'changed' WHERE key = 'provenance'")
        connection.execute("DELETE FROM bond_break WHERE rowid > 7")
    with Results.open(path) as results:
        results.verify()
        assert (results.meta()["provenance"], len(results.breaks().step)) == ("changed", 7)


def test_files_of_older_schemas_are_read(older: Path) -> None:
    """As the program of that time read them: what plain SQL says."""
    with Results.open(older) as results, closing(sqlite3.connect(older)) as plain:
        nodes, breaks, history = results.nodes(), results.breaks(), results.history()
        query = "SELECT node, x, y, delta, area, family, cut FROM node"
        columns = zip(*(column.tolist() for column in (nodes.ids, *nodes.position.T, *nodes[2:])), strict=True)
        assert list(columns) == plain.execute(query).fetchall()
        assert (results.epochs().tolist(), results.rows(40).tolist()) == ([0], list(range(72)))
        query = "SELECT step, node, neighbour FROM bond_break ORDER BY step, rowid"
        assert list(zip(*(column.tolist() for column in breaks), strict=True)) == plain.execute(query).fetchall()
        assert history.tolist() == plain.execute("SELECT * FROM history ORDER BY step").fetchall()
        assert results.probes().tolist() == plain.execute("SELECT * FROM probe ORDER BY step").fetchall()
        assert results.reactions()["condition"].tolist() == [0] * 6 + [1] * 6
        assert results.stored(40) == ["ux", "uy", "vx", "vy", "damage"]
        found = [row[0] for row in plain.execute("SELECT uy FROM node_state WHERE step = 40 ORDER BY node")]
        assert results.field("uy", 40).tolist() == found
        assert np.diff(results.families().start).tolist() == (nodes.family - nodes.cut).tolist()
        assert (results.checkpoint()[0], results.meta()["status"]) == (50, "interrupted")
        kept = results.checkpoint()[1]
        assert kept["u" if "u" in kept else "value"].size == 2 * 72
        assert '"notch"' in results.model()


def test_files_of_older_schemas_are_not_gone_on_with(older: Path) -> None:
    before = older.read_bytes()
    with pytest.raises(ResultsError, match=naming(re.compile(r"version \d"), expected="7")):
        resume(older)
    assert older.read_bytes() == before
