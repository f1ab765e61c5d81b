"""Files beside a database: what SQLite left is put back as SQLite does, all else is refused and stays as it is."""

from __future__ import annotations

import os
import random
import re
import shutil
import sqlite3
import struct
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from messages import naming

import pdsolve
from pdsolve.results import ResultsError, opening, remove, side_files, state_of
from pdsolve.results.opening import for_writing, log_of, read_only, recover
from pdsolve.results.pieces import pieces_of
from pdsolve.results.side_files import MAGIC, roll_back

MARK = b"a file of the user\n" * 50


def journalled(folder: Path, chance: random.Random) -> Path:
    """A database in the middle of a transaction that has been written in several parts, with its journal."""
    own, killed = folder / "own.sqlite", folder / "killed.sqlite"
    with closing(sqlite3.connect(own, isolation_level=None)) as connection:
        connection.execute(f"PRAGMA page_size = {chance.choice((512, 4096, 16384))}")
        connection.execute("CREATE TABLE t (x)")
        connection.execute("BEGIN")
        connection.executemany("INSERT INTO t VALUES (?)", [(chance.randbytes(300),) for _ in range(150)])
        connection.execute("COMMIT")
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN IMMEDIATE")
        for first in range(0, 150, 30):
            connection.execute("UPDATE t SET x = zeroblob(?) WHERE rowid > ?", (chance.randrange(900), first))
        for end in ("", "-journal"):
            shutil.copy(f"{own}{end}", f"{killed}{end}")
        connection.execute("ROLLBACK")
    return killed


@pytest.fixture
def killed(tmp_path: Path) -> Path:
    """A database with a hot journal."""
    return journalled(tmp_path, random.Random(1))


def rolled_back_by_sqlite(path: Path) -> bytes:
    """What SQLite makes of a copy."""
    copy = path.with_name("copy.sqlite")
    for end in ("", "-journal"):
        shutil.copy(f"{path}{end}", f"{copy}{end}")
    with closing(sqlite3.connect(copy)) as connection:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    assert not Path(f"{copy}-journal").exists()
    return copy.read_bytes()


@pytest.mark.parametrize("seed", range(6))
def test_a_journal_is_rolled_back_as_sqlite_does_it(tmp_path: Path, seed: int) -> None:
    """Bit by bit; also one that was cut short, or of which a record is damaged."""
    chance = random.Random(seed)
    killed = journalled(tmp_path, chance)
    journal = Path(f"{killed}-journal")
    data = bytearray(journal.read_bytes())
    if seed % 3 == 1:
        del data[chance.randrange(len(data) // 2, len(data)) :]
    if seed % 3 == 2:
        data[chance.randrange(len(data) // 2, len(data))] ^= 1
    journal.write_bytes(data)
    expected = rolled_back_by_sqlite(killed)
    assert killed.read_bytes() != expected
    assert roll_back(killed)
    assert killed.read_bytes() == expected
    assert not journal.exists()


@pytest.mark.parametrize("written", [1, 6, 7])
def test_a_journal_is_dropped_of_whose_magic_a_part_is_written(killed: Path, written: int) -> None:
    """SQLite completes the magic before it changes the database, so that a killed program may leave a part of it."""
    journal = Path(f"{killed}-journal")
    data = journal.read_bytes()
    journal.write_bytes(MAGIC[:written] + bytes(12 - written) + data[12:])
    expected = rolled_back_by_sqlite(killed)
    recover(killed)
    assert killed.read_bytes() == expected
    assert not journal.exists()


def contents(connection: sqlite3.Connection) -> list[tuple[bytes]]:
    return connection.execute("SELECT x FROM t ORDER BY rowid").fetchall()


def test_reading_rolls_back_in_memory_and_writing_in_the_file(killed: Path) -> None:
    expected = rolled_back_by_sqlite(killed)
    files = (killed, Path(f"{killed}-journal"))
    before = [file.read_bytes() for file in files]
    with closing(read_only(killed)) as connection:
        read = contents(connection)
    assert len(read) == 150
    assert [file.read_bytes() for file in files] == before
    with closing(for_writing(killed)) as connection:
        assert contents(connection) == read
    assert killed.read_bytes() == expected
    assert not files[1].exists()


@pytest.mark.parametrize("pages", [0, 1])
def test_a_journal_empties_no_database(tmp_path: Path, pages: int) -> None:
    """One of nothing but a shorter size, as a new database has that is whole but for its journal's end."""
    path, journal = tmp_path / "plate.sqlite", tmp_path / "plate.sqlite-journal"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE t (x)")
        connection.execute("INSERT INTO t VALUES (zeroblob(3000))")
    whole = path.read_bytes()
    journal.write_bytes(MAGIC + struct.pack(">5I", 0, 1, pages, 512, 4096) + bytes(484))
    with closing(read_only(path)) as connection:
        assert contents(connection) == [(bytes(3000),)]
    assert path.read_bytes() == whole
    assert journal.exists()
    recover(path)
    assert path.read_bytes() == whole
    assert not journal.exists()


def test_a_new_database_that_is_not_whole_is_emptied(tmp_path: Path) -> None:
    path, journal = tmp_path / "plate.sqlite", tmp_path / "plate.sqlite-journal"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE t (x)")
        connection.executemany("INSERT INTO t VALUES (?)", [(bytes(3000),)] * 5)
    path.write_bytes(path.read_bytes()[:4096] + bytes(len(path.read_bytes()) - 4096))
    journal.write_bytes(MAGIC + struct.pack(">5I", 0, 1, 0, 512, 4096) + bytes(484))
    with closing(read_only(path)) as connection:
        assert connection.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
    recover(path)
    assert path.read_bytes() == b""


def test_the_journal_of_a_run_that_lives_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "live.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None)) as writer:
        writer.execute("CREATE TABLE t (x)")
        writer.execute("BEGIN IMMEDIATE")
        writer.execute("INSERT INTO t VALUES (1)")
        journal = Path(f"{path}-journal").read_bytes()
        with closing(read_only(path)) as reader:
            assert reader.execute("SELECT count(*) FROM t").fetchone() == (0,)
        recover(path)
        assert Path(f"{path}-journal").read_bytes() == journal
        writer.execute("COMMIT")
    with closing(read_only(path)) as reader:
        assert reader.execute("SELECT count(*) FROM t").fetchone() == (1,)


def named(name: bytes, sums: int | None = None) -> bytes:
    """The end of a journal that names a super-journal, with another checksum if one is given."""
    signed = sum(byte - 256 * (byte > 127) for byte in name) & 0xFFFFFFFF
    return name + struct.pack(">2I", len(name), signed if sums is None else sums) + MAGIC


def joined(path: Path, victim: Path, page: int = 4096) -> dict[str, bytes]:
    """Journals of the database at `path` that name a super-journal, each in another way."""
    whole = Path(f"{path}-journal").read_bytes() if Path(f"{path}-journal").exists() else b""
    pages = path.stat().st_size // page
    header = struct.pack(">8s5I", MAGIC, 0, 0, pages, 512, page).ljust(512, b"\0")
    number, name = struct.pack(">I", 0x40000000 // page + 1), os.fsencode(victim)
    return {
        "as a forger writes it": header + number + named(name),
        "without the number of its page": header + named(name),
        "after other sectors": header + bytes(4096) + number + named(name),
        "behind pages": whole + number + named(name),
        "with another checksum": header + number + named(name, 7),
        "as a record among others": header[:8] + b"\xff" * 4 + header[12:] + number + bytes(page + 4) + bytes(64),
        "in a second part": header.ljust(1024, b"\0")[:512] + header + number + named(name),
    }


@pytest.mark.parametrize("how", list(joined(Path(__file__), Path("x"))))
def test_a_super_journal_is_refused_and_stays(killed: Path, how: str) -> None:
    victim = killed.with_name("victim")
    victim.write_bytes(MARK)
    page = struct.unpack(">H", killed.read_bytes()[16:18])[0]
    journal = joined(killed, victim, page)[how]
    Path(f"{killed}-journal").write_bytes(journal)
    before = killed.read_bytes()
    for use in (read_only, for_writing, recover):
        with pytest.raises(ResultsError, match=naming("killed.sqlite", found="super-journal")):
            use(killed)
    assert (victim.read_bytes(), killed.read_bytes()) == (MARK, before)
    assert Path(f"{killed}-journal").read_bytes() == journal


def test_a_journal_that_is_exchanged_after_the_check_deletes_nothing(
    killed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    victim, check = killed.with_name("victim"), opening.expect_sound
    victim.write_bytes(MARK)

    def exchange(path: Path) -> None:
        check(path)
        Path(f"{path}-journal").write_bytes(joined(path, victim, 512)["as a forger writes it"])

    monkeypatch.setattr(opening, "expect_sound", exchange)
    with pytest.raises(ResultsError, match="super-journal"):
        read_only(killed)
    assert victim.read_bytes() == MARK


def test_a_journal_does_not_make_a_database_larger_than_what_there_is(killed: Path) -> None:
    size = killed.stat().st_size
    header = struct.pack(">8s5I", MAGIC, 0, 0, 2**31, 512, 65536).ljust(512, b"\0")
    Path(f"{killed}-journal").write_bytes(header)
    with pytest.raises(ResultsError, match=naming("killed.sqlite", found=f"{2**31} pages")):
        read_only(killed)
    assert killed.stat().st_size == size


def pipe(place: Path, victim: Path) -> None:
    os.mkfifo(place)


KINDS: dict[str, Callable[[Path, Path], object]] = {
    "a link": lambda place, victim: place.symlink_to(victim),
    "a hard link": lambda place, victim: place.hardlink_to(victim),
    "a folder": lambda place, victim: place.mkdir(),
    "a pipe": pipe,
    "another file": lambda place, victim: place.write_bytes(MARK),
}


@pytest.mark.parametrize("end", ["-journal", "-wal", "-shm"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [None, 0])
def test_what_sqlite_has_not_left_is_refused_and_stays(tmp_path: Path, end: str, kind: str, size: int | None) -> None:
    """Beside a database with a log, and beside an empty one, whose log SQLite would remove."""
    path, victim = tmp_path / "plate.sqlite", tmp_path / "victim"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("CREATE TABLE t (x)")
    if size is not None:
        path.write_bytes(b"")
    victim.write_bytes(MARK)
    KINDS[kind](Path(f"{path}{end}"), victim)
    before = sorted(entry.name for entry in tmp_path.iterdir())
    for use in (read_only, for_writing, recover):
        with pytest.raises(ResultsError, match=naming(f"plate.sqlite{end}", expected="move")):
            use(path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == before
    assert victim.read_bytes() == MARK
    if kind == "another file":
        assert Path(f"{path}{end}").read_bytes() == MARK


def test_a_log_beside_a_database_without_one_is_refused(tmp_path: Path) -> None:
    """SQLite would read it, and remove it after the next transaction."""
    path, other = tmp_path / "plate.sqlite", tmp_path / "other.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None)) as one, closing(sqlite3.connect(other)) as two:
        one.execute("CREATE TABLE t (x)")
        two.execute("PRAGMA journal_mode = WAL")
        two.execute("CREATE TABLE u (x)")
        shutil.copy(f"{other}-wal", f"{path}-wal")
    with pytest.raises(ResultsError, match=naming("plate.sqlite-wal", expected="move")):
        read_only(path)


@pytest.mark.endurance
def test_readers_beside_a_writer_are_never_refused(tmp_path: Path) -> None:
    """While its log, its index and its journal come and go."""
    path, ends = tmp_path / "plate.sqlite", threading.Event()
    with closing(sqlite3.connect(path)) as first:
        first.execute("CREATE TABLE t (x)")

    def write() -> None:
        for _ in range(40):
            with closing(sqlite3.connect(path, isolation_level=None)) as writer:
                writer.execute("PRAGMA synchronous = OFF")
                writer.execute("PRAGMA journal_mode = WAL")
                writer.execute("INSERT INTO t VALUES (1)")
                writer.execute("PRAGMA journal_mode = DELETE")
        ends.set()

    thread = threading.Thread(target=write)
    thread.start()
    try:
        while not ends.is_set():
            side_files.expect_sound(path)
    finally:
        thread.join()


def test_no_database_joins_another(tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    with closing(for_writing(path)) as connection, pytest.raises(sqlite3.OperationalError, match="too many attached"):
        connection.execute("ATTACH ? AS other", (str(tmp_path / "other.sqlite"),))


def test_one_module_opens_databases() -> None:
    root = Path(pdsolve.__file__).parent.parent
    files = [file for package in ("pdmesh", "pdsolve", "pdpost") for file in (root / package).rglob("*.py")]
    opens = [file.name for file in files if re.search(r"sqlite3\.connect|Connection\(", file.read_text("utf-8"))]
    assert opens == ["opening.py"]


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.parametrize("end", ["-journal", "-wal", "-shm", ".0-1", ".0-0-wal"])
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_removed_where_something_is_another_file(tmp_path: Path, end: str, kind: str) -> None:
    path, victim = tmp_path / "plate.sqlite", tmp_path / "victim"
    path.touch()
    victim.write_bytes(MARK)
    Path(f"{path}.0-0").touch()
    KINDS[kind](Path(f"{path}{end}"), victim)
    before = names(tmp_path)
    with pytest.raises(ResultsError, match=naming(f"plate.sqlite{end}")):
        remove(path)
    assert names(tmp_path) == before
    assert victim.read_bytes() == MARK


def test_a_database_is_removed_with_what_is_its_own_alone(tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    own = ["", "-wal", "-shm", "-journal", ".0-0", ".0-1", ".1-12", ".0-1-wal", ".0-1-shm"]
    others = [".0-1.png", ".0-notes", ".1backup-2026", ".json", "-copy", "x.0-1"]
    for end in own + others:
        Path(f"{path}{end}").touch()
    (tmp_path / "other.sqlite.0-1").touch()
    remove(path)
    assert names(tmp_path) == sorted(["other.sqlite.0-1", *(f"plate.sqlite{end}" for end in others)])


def test_only_databases_that_name_an_index_are_removed_with_it(tmp_path: Path) -> None:
    """A copy of a user may have the name that a rank's database has."""
    path = tmp_path / "plate.sqlite"
    indices = {".2025-11": None, ".0-0": "plate.sqlite", ".0-1": "other.sqlite"}
    for end, index in indices.items():
        with closing(sqlite3.connect(f"{path}{end}")) as connection, connection:
            connection.execute("CREATE TABLE meta (key, value)")
            if index is not None:
                connection.execute("INSERT INTO meta VALUES ('piece_of', ?)", (index,))
    remove(path)
    assert names(tmp_path) == ["plate.sqlite.0-1", "plate.sqlite.2025-11"]


def test_a_link_of_the_name_of_a_rank_is_refused(tmp_path: Path) -> None:
    Path(tmp_path / "plate.sqlite.1-2").symlink_to(tmp_path / "nothing")
    with pytest.raises(ResultsError, match=naming("plate.sqlite.1-2")):
        remove(tmp_path / "plate.sqlite")


@pytest.mark.parametrize("end", ["-journal", "-wal", "-shm"])
def test_a_second_name_of_a_file_is_refused_whatever_is_in_it(tmp_path: Path, end: str) -> None:
    """SQLite would write into it: an index that is not in use is all zeros, as a file of a user may be."""
    path, victim = tmp_path / "plate.sqlite", tmp_path / "victim"
    path.touch()
    victim.write_bytes(bytes(4096))
    os.link(victim, f"{path}{end}")
    with pytest.raises(ResultsError, match=naming(f"plate.sqlite{end}", found="hard link")):
        side_files.expect_sound(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_no_database_with_a_log(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "p.sqlite")
    (tmp_path / "p.sqlite-wal").write_bytes(side_files.LOGS[0] + bytes(40))
    with pytest.raises(ResultsError, match=naming("p.sqlite-wal")):
        side_files.expect_sound(tmp_path / "p.sqlite")


@pytest.mark.parametrize("end", ["-journal", "-wal"])
def test_a_run_does_not_begin_where_another_has_left_something(tmp_path: Path, end: str) -> None:
    path = tmp_path / "plate.sqlite"
    with closing(sqlite3.connect(tmp_path / "other.sqlite", isolation_level=None)) as connection:
        connection.execute(f"PRAGMA journal_mode = {'WAL' if end == '-wal' else 'DELETE'}")
        connection.execute("CREATE TABLE t (x)")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("INSERT INTO t VALUES (1)")
        shutil.copy(tmp_path / f"other.sqlite{end}", f"{path}{end}")
    with pytest.raises(ResultsError, match=naming("plate.sqlite", found=f"plate.sqlite{end}")):
        state_of(path)


@pytest.mark.parametrize("file", ["notes.sqlite", "../results.0-0", "plate.sqlite.0-0/x", "plate.sqlite.0-0.png"])
def test_only_databases_of_ranks_are_pieces(file: str) -> None:
    """An index may come from anyone, and what it names is opened and may be written."""
    assert pieces_of('[[0, ["plate.sqlite.0-0"]]]', "plate.sqlite")
    with pytest.raises(ResultsError, match=naming("pieces")):
        pieces_of(f'[[0, ["{file}"]]]', "plate.sqlite")


def test_a_long_log_of_nothing_is_not_counted_for_ever(tmp_path: Path) -> None:
    """A sparse file takes no disk, and as long as a full one to read."""
    path = tmp_path / "plate.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("CREATE TABLE t (x)")
        shutil.copy(path, tmp_path / "copy.sqlite")
        shutil.copy(f"{path}-wal", tmp_path / "copy.sqlite-wal")
    copy = tmp_path / "copy.sqlite"
    for whole in (True, False):
        if not whole:
            os.truncate(f"{copy}-wal", 0)
        os.truncate(f"{copy}-wal", 2**33)
        with closing(read_only(copy)) as connection:
            assert log_of(connection, copy) == (int(whole), 0)
