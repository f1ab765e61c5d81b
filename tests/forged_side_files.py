"""Forged files beside databases, tables of studies and folders of studies; and the commands that meet them.

Each case has a folder of its own, beside one of marker files: files of a user, which forgeries name, link to or copy.
A command ends in one line or an answer, and the markers stay as they are. Otherwise as `forged_databases.py`.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import sqlite3
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec
from forged_databases import EVIL, damaged, outcome

from benchmarks.kinds_of_run import KINDS as KINDS_OF_RUN
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.results.side_files import LOGS, MAGIC
from pdsolve.run.simulation import simulate
from pdsolve.study import dispatch, one_run

PATIENCE = 60  # s until a command has no end, waiting included
ANSWERS = 0, 1, 2, 3
MARKS = ("thesis.txt", "0001.sqlite", "photo.png", "keys", "far/0002.sqlite")
STUDY = 'drawing = "plate.json"\nvary.model.material.G0 = [3, 4, 5]\n'
DRAWN, FOLLOWED = Path("out.png"), ("link", "link to no file")
ENDS = ("-journal", "-journal", "-journal", "-wal", "-shm", "-lock")

Main = Callable[[list[str]], int]
Command = tuple[Main, list[str]]


class Case(NamedTuple):
    """A folder to forge something in, and the markers beside it."""

    folder: Path
    markers: Path
    chance: random.Random

    def marker(self) -> Path:
        """One of the markers."""
        return self.markers / self.chance.choice(MARKS)

    def replace(self, place: Path) -> str:
        """Let something else be at a place: a link, a hard link, a folder, a pipe, a copy of a marker, or nothing.

        What commands name with -o is no link to a marker: they follow it.
        """
        clear(place)
        kinds: dict[str, Callable[[], object]] = {
            "link": lambda: place.symlink_to(self.marker().resolve()),
            "link to no file": lambda: place.symlink_to((self.markers / "new").resolve()),
            "link to a folder": lambda: place.symlink_to(self.markers.resolve(), target_is_directory=True),
            "link to itself": lambda: place.symlink_to(place.name),
            "hard link": lambda: place.hardlink_to(self.marker()),
            "folder": place.mkdir,
            "pipe": lambda: os.mkfifo(place),
            "another file": lambda: shutil.copy(self.marker(), place),
            "bytes": lambda: place.write_bytes(self.chance.randbytes(self.chance.choice((1, 40, 5000)))),
            "zeros": lambda: os.truncate(place, 2**33) if not place.touch() else None,
            "nothing": lambda: None,
        }
        kind = self.chance.choice([kind for kind in kinds if place != DRAWN or kind not in FOLLOWED])
        kinds[kind]()
        return f"{place.name}: {kind}"


def clear(place: Path) -> None:
    """Let nothing be at a place."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)


def prepare(folder: Path) -> None:
    """Put sound files into a folder: results that are finished and stopped, and a study with its runs."""
    model, options = KINDS_OF_RUN["bonds"]()
    short = msgspec.structs.replace(model.settings.run, steps=10, every=5, ledger=5)
    write_file(document_of(model.grid, msgspec.structs.replace(model.settings, run=short)), folder / "plate.json")
    simulate(model, folder / "finished.sqlite", options).close()
    half = model.settings.run.steps // 2
    simulate(model, folder / "stopped.sqlite", options, lambda progress: progress.step >= half).close()
    (folder / "study.toml").write_text(STUDY)
    with contextlib.chdir(folder), in_this_process():
        from pdsolve.__main__ import main

        if main(["study", "study.toml", "-q"]):
            raise RuntimeError("the study that is to be forged was not solved")


@contextlib.contextmanager
def in_this_process() -> Iterator[None]:
    """A context in which the runs of a study are solved here."""
    here = contextlib.nullcontext(partial(map, one_run.solve_and_measure))
    before, dispatch.task_solver = dispatch.task_solver, lambda workers: here
    try:
        yield
    finally:
        dispatch.task_solver = before


# ---- what is forged


def super_journal(case: Case, path: Path) -> bytes:
    """A journal that names a marker as its super-journal, in one of several ways."""
    chance, head = case.chance, path.read_bytes()[:32].ljust(32, b"\0")
    page = struct.unpack_from(">H", head, 16)[0] or 4096
    pages = chance.choice((struct.unpack_from(">I", head, 28)[0], 0, 1, 2**31))
    name = os.fsencode(chance.choice((case.marker().resolve(), case.marker())))
    sector = chance.choice((512, 4096, 32, 65536, 0, 7))
    records = chance.choice((0, 1, 2**32 - 1))
    header = struct.pack(">8s5I", MAGIC, records, 0, pages, sector, page).ljust(max(sector, 28), b"\0")
    end = name + struct.pack(">2I", len(name), sum(byte - 256 * (byte > 127) for byte in name) & 0xFFFFFFFF) + MAGIC
    between = chance.choice((struct.pack(">I", 0x40000000 // page + 1), b"", bytes(4096), header))
    return header + between + end


def genuine(path: Path, end: str) -> bytes:
    """A journal or a log of a transaction that has not ended."""
    copy = path.with_name("copy.sqlite")
    shutil.copy(path, copy)
    with contextlib.closing(sqlite3.connect(copy, isolation_level=None)) as connection:
        connection.execute(f"PRAGMA journal_mode = {'WAL' if end == '-wal' else 'DELETE'}")
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("CREATE TABLE more (x)")
        connection.execute("INSERT INTO more VALUES (zeroblob(100000))")
        if end == "-wal":
            connection.execute("COMMIT")
        data = Path(f"{copy}{end}").read_bytes()
        shutil.copy(copy, path)
    for beside in path.parent.glob("copy.sqlite*"):
        beside.unlink()
    return data


def forged_log(data: bytes, chance: random.Random) -> bytes:
    """A log with other salts, checksums, sizes of pages or of the database."""
    log = bytearray(data)
    for _ in range(chance.randint(1, 3)):
        at = chance.choice((8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, 52))
        if at + 4 <= len(log):
            log[at : at + 4] = struct.pack(">I", chance.choice((0, 1, 512, 2**31, 2**32 - 1, chance.randrange(2**32))))
    if chance.random() < 0.2:
        log[:4] = chance.choice((*LOGS, b"\0\0\0\0", b"mine"))
    return bytes(log)


def beside(case: Case, path: Path) -> str:
    """Forge a file beside a database."""
    chance, end = case.chance, case.chance.choice(ENDS)
    place, how = Path(f"{path}{end}"), case.chance.random()
    if chance.random() < 0.15:
        path.write_bytes(b"")
    elif end in ("-wal", "-shm") and path.stat().st_size and chance.random() < 0.7:
        data = bytearray(path.read_bytes())
        data[18:20] = b"\2\2"
        path.write_bytes(data)
    clear(place)  # not to write through a link of the first time
    if end == "-journal" and how < 0.5:
        place.write_bytes(super_journal(case, path))
        return f"{place.name}: super-journal"
    if end in ("-journal", "-wal") and how < 0.8 and path.stat().st_size:
        data = genuine(path, end)
        data = forged_log(data, chance) if end == "-wal" and chance.random() < 0.5 else damaged(data, chance)
        if end == "-journal" and chance.random() < 0.3:
            name = os.fsencode(case.marker().resolve())
            data += name + struct.pack(">2I", len(name), sum(name)) + MAGIC
        place.write_bytes(data)
        return f"{place.name}: damaged"
    return case.replace(place)


def side_files(case: Case) -> tuple[str, list[Command]]:
    """One or two files beside the results of a run."""
    from pdpost.__main__ import main as pdpost
    from pdsolve.__main__ import main as pdsolve

    name = case.chance.choice(("finished", "stopped"))
    done = [beside(case, Path(f"{name}.sqlite")) for _ in range(case.chance.choice((1, 1, 2)))]
    file, drawn = f"{name}.sqlite", ["-o", str(DRAWN), "--force"]
    every: list[Command] = [
        (pdpost, ["sql", file]),
        (pdpost, ["crack", file, "--json"]),
        (pdpost, ["damage", file, *drawn]),
        (pdpost, ["verify", file]),
        (pdpost, ["watch", file, "--patience", "0.1", *drawn]),
        (pdpost, ["report", file, "-o", "out.html", "--force"]),
        (pdsolve, ["--resume", file, "--dry-run"]),
    ]
    last: list[Command] = [(pdsolve, ["--resume", file, "-q"]), (pdsolve, ["plate.json", "-o", file, "--force", "-q"])]
    return " ".join(done), [*case.chance.sample(every, 2), *case.chance.sample(last, case.chance.choice((1, 2)))]


def study_commands(case: Case) -> list[Command]:
    """Commands that read a study, and such that go on with it."""
    from pdpost.__main__ import main as pdpost
    from pdsolve.__main__ import main as pdsolve

    drawn = ["-o", str(DRAWN), "--force"]
    reads: list[Command] = [
        (pdpost, ["study", "study.sqlite", *drawn]),
        (pdpost, ["crack", "study.sqlite", *drawn]),
        (pdpost, ["compare", "study.sqlite", *drawn]),
    ]
    ways = case.chance.sample((["--force"], ["--again"], []), 2)
    return [case.chance.choice(reads), *((pdsolve, ["study", "study.toml", "-q", *way]) for way in ways)]


def study_tables(case: Case) -> tuple[str, list[Command]]:
    """Values of a study's table, whose checksums agree, or files beside it."""
    chance, path = case.chance, Path("study.sqlite")
    if chance.random() < 0.3:
        return beside(case, path), study_commands(case)
    if chance.random() < 0.2:
        path.write_bytes(damaged(path.read_bytes(), chance))
        return "bytes", study_commands(case)
    files = ("../markers/0001.sqlite", "markers.runs/0001.sqlite", "study.runs/../0001.sqlite", "/etc/0001.sqlite")
    values = (*EVIL, *files, "other.runs/0001.sqlite", "waiting", "finished", "failed", str(case.marker().resolve()))
    done = []
    with contextlib.closing(sqlite3.connect(path)) as connection:
        for _ in range(chance.randint(1, 3)):
            table = chance.choice(("run", "run", "run", "study", "column_unit"))
            column = chance.choice([row[1] for row in connection.execute(f"PRAGMA table_info({table})")])
            value = chance.choice(values)
            done.append(f"{column} of {table}: {value!r}"[:60])
            with contextlib.suppress(sqlite3.Error, OverflowError):
                row = "rowid = (SELECT min(rowid) + ? FROM " + table + ")"
                connection.execute(f'UPDATE {table} SET "{column}" = ? WHERE {row}', (value, chance.randrange(3)))
        with contextlib.suppress(Exception):
            connection.execute("DROP TABLE checksum")
            if chance.random() < 0.7:
                table.begin(connection)
        connection.commit()
    return ", ".join(done), study_commands(case)


def study_folders(case: Case) -> tuple[str, list[Command]]:
    """Files of a study, and in the folder of its runs, are others."""
    chance, runs = case.chance, Path("study.runs")
    places = [runs / f"{number:04d}.sqlite" for number in (1, 2, 3, 7)]
    places += [runs / "0001.sqlite-wal", runs / "0002.sqlite-journal", runs / "0003.sqlite-lock", runs / "notes.txt"]
    places += [runs, runs, Path("study.sqlite"), Path("study.sqlite-lock"), DRAWN, Path("other.runs")]
    chosen = sorted(set(chance.sample(places, chance.choice((1, 1, 2)))), key=runs.__eq__)  # the folder itself last
    done = [case.replace(place) for place in chosen]
    if chance.random() < 0.2:
        Path("study.sqlite").unlink(missing_ok=True)
        done.append("no table")
    if runs not in chosen and chance.random() < 0.2 and (runs / "0002.sqlite").is_file():
        with contextlib.suppress(OSError):
            clear(runs / "0003.sqlite")
            shutil.copy(runs / "0002.sqlite", runs / "0003.sqlite")
            done.append("0003.sqlite: another run")
    return " ".join(done), study_commands(case)


# Forgeries of environment variables go here: a function of a case, as those above, that sets them with `os.environ`
# (`meet` puts the variables back) and returns what it did and the commands that meet it.
KINDS: dict[str, Callable[[Case], tuple[str, list[Command]]]] = {
    "side files": side_files,
    "tables of studies": study_tables,
    "folders of studies": study_folders,
}
TURNS = ("side files", "side files", "tables of studies", "folders of studies")  # of four cases


# ---- what becomes of it


def mark(folder: Path) -> None:
    """Put the markers into a folder."""
    (folder / "far").mkdir(parents=True)
    for name in MARKS:
        (folder / name).write_bytes(b"a file of the user: " + name.encode() * 50)


def tree(folder: Path) -> dict[str, bytes]:
    """Files in a folder, by name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def meet(folder: Path, seed: int, number: int, kind: str) -> list[dict[str, str]]:
    """Forge one case beside the sound files in a folder, and run its commands; what went wrong."""
    case = Case(folder / "case", folder / "markers", random.Random(f"{seed} {number} {kind}"))
    for place in (case.folder, case.markers):
        shutil.rmtree(place, ignore_errors=True)
    mark(case.markers)
    shutil.copytree(folder / "sound", case.folder)
    before, wrong, variables = tree(case.markers), [], dict(os.environ)
    case = case._replace(markers=Path("../markers"))
    try:
        with contextlib.chdir(case.folder), in_this_process():
            done, commands = KINDS[kind](case)
            assert tree(case.markers) == before, "forging itself has changed a marker"
            file = f"{seed} {number}: {kind}: {done}"
            (folder / "last.txt").write_text(file)
            for main, words in commands:
                found = _ended(main, words)
                intact = tree(case.markers) == before
                if found or not intact:
                    said = found or "a file of the user is another"
                    wrong.append({"file": file, "command": " ".join(words), "wrong": said, "intact": str(intact)})
                if not intact:
                    break
    finally:
        os.environ.clear()
        os.environ.update(variables)
    return wrong


def _ended(main: Main, words: list[str]) -> str:
    """What is wrong with how a command ended; waiting for long is, too."""

    def too_long(*_: object) -> None:
        raise TimeoutError(f"no end within {PATIENCE} s")

    before = [(number, signal.signal(number, too_long)) for number in (signal.SIGALRM, signal.SIGPROF)]
    signal.alarm(PATIENCE)
    try:
        return outcome(main, words, ANSWERS, PATIENCE)
    finally:
        signal.alarm(0)
        for number, handler in before:
            signal.signal(number, handler)


def forged_cases(folder: Path, seed: int, count: int, first: int = 0) -> list[dict[str, str]]:
    """So many cases of all kinds in turn, from number `first` on; `folder` has the sound files in ``sound``."""
    folder = folder.resolve()
    return [
        found
        for number in range(first, first + count)
        for found in meet(folder, seed, number, TURNS[number % len(TURNS)])
    ]


def main(words: Sequence[str]) -> None:
    """For those who look for more: FOLDER SEED COUNT, where FOLDER is new."""
    folder = Path(words[0])
    (folder / "sound").mkdir(parents=True)
    prepare(folder / "sound")
    found = forged_cases(folder, *map(int, words[1:]))
    for one in found:
        print(*one.values(), sep="\n", end="\n\n")
    print(f"{words[2]} cases, {len(found)} wrong")


if __name__ == "__main__":
    main(sys.argv[1:])
