"""Files of every kind, something of each changed: refused in a line, or read as if nothing were.

Most changes are those that the tests make (`tests/forged_databases.py` and its like), so that this tries more of what
they try.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import sqlite3
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.kills import contents, forked, module_of_tests
from benchmarks.kinds_of_run import KINDS
from benchmarks.models import with_run
from pdmesh.__main__ import main as pdmesh
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.results import remove
from pdsolve.run.simulation import resume, simulate

COUNT, BATCH = 200, 5  # files of a kind; of them in one process
FINISHED = ("bonds", "particles", "dissolution")
STOPPED = ("bonds", "bilinear", "ordinary", "particles", "at rest", "dissolution")
REFUSED = 2  # the exit code
STUDY = 'drawing = "plate.json"\nvary.model.material.G0 = [3, 4, 5, 6]\n'


class Batch(NamedTuple):
    """What became of some files of a kind."""

    kind: str
    tried: int
    fell: list[str]  # what ended in a traceback, in no line or not at all, with the file
    wrong: list[str]  # what was read otherwise than it was written


Tried = tuple[list[str], list[str]]  # what fell, what is wrong


def batches(folder: Path, until: Callable[[float], bool]) -> Iterator[Batch]:
    """All kinds in turns, until there are enough of each or no time is left."""
    jobs = _jobs(folder)
    for seed in range(1, COUNT // BATCH + 1):
        for kind, job in jobs.items():
            if not until(15.0):
                return
            answer, code = forked(lambda job=job, seed=seed: json.dumps(job(seed)))  # type: ignore[misc]
            fell, wrong = ([f"seed {seed}: ended with {code} {answer.strip()}"], []) if code else json.loads(answer)
            yield Batch(kind, BATCH, fell, wrong)


def _jobs(folder: Path) -> dict[str, Callable[[int], Tried]]:
    """By kind of file: what tries a batch of them, by its seed."""
    forged = module_of_tests("forged_databases")
    folders = {name: folder / name for name in ("finished", "stopped", "study", "grids")}
    for path in folders.values():
        path.mkdir()
    for kind in FINISHED:
        model, options = KINDS[kind]()
        simulate(model, folders["finished"] / f"{kind}.sqlite", options).close()
    bonds = folders["finished"] / "bonds.sqlite"
    bonds.rename(bonds.with_stem("whole"))  # as one of the commands names it

    def finished(seed: int) -> Tried:
        return [str(failure) for failure in forged.forged_runs(folders["finished"], seed, BATCH, 1)], []

    return {
        "finished databases": finished,
        "stopped databases": partial(_stopped, folders["stopped"], forged, _halves(folders["stopped"])),
        "grid files": partial(_grid_files, folders["grids"], forged),
        "tables of studies": partial(_tables, folders["study"], forged, _solved_study(folders["study"])),
    }


def _halves(folder: Path) -> list[tuple[Path, dict[str, Any]]]:
    """Databases of runs that were stopped half way, each with what is in that of one that was not."""
    halves = []
    for kind in STOPPED:
        model, options = KINDS[kind]()
        path, half = folder / f"{kind}.whole", model.settings.run.steps // 2
        simulate(model, path, options, lambda *now, half=half: getattr(now[0], "step", now[0]) >= half).close()  # type: ignore[misc]
        data = path.read_bytes()
        resume(path).close()
        expected = contents(path)
        path.write_bytes(data)
        halves.append((path, expected))
    return halves


def _stopped(folder: Path, forged: Any, halves: list[tuple[Path, dict[str, Any]]], seed: int) -> Tried:
    """Bytes of stopped runs are others: refused, or gone on with to the same end."""
    fell, wrong, path = [], [], folder / "x.sqlite"
    for number in range(BATCH):
        chance = random.Random(f"{seed} {number}")
        whole, expected = chance.choice(halves)
        remove(path)
        path.write_bytes(forged.damaged(whole.read_bytes(), chance))
        name = f"{whole.stem}, {seed} {number}"
        code, stderr = _run_command(pdsolve, "--resume", str(path), "-q")
        if code:
            fell += [f"{name}: {stderr}"] if code != REFUSED or stderr.count("\n") != 1 else []
        elif contents(path) != expected:
            wrong.append(name)
    return fell, wrong


def _grid_files(folder: Path, forged: Any, seed: int) -> Tried:
    """Values of grid files are others: refused in a line, or what they now say."""
    fell, path = [], folder / "x.json"
    for number in range(BATCH):
        chance = random.Random(f"{seed} {number}")
        kind = chance.choice(STOPPED)
        model, _ = KINDS[kind]()
        write_file(document_of(model.grid, model.settings), path)
        path.write_text(forged.forged_json(path.read_text(), chance), "utf-8", errors="replace")
        for main, *words in ((pdsolve, str(path), "--dry-run", "-q"), (pdmesh, "info", str(path))):
            code, stderr = _run_command(main, *words)
            lines = [line for line in stderr.splitlines() if " warning: " not in line and not line.startswith("  ")]
            if code not in (0, 1, REFUSED, 3) or len(lines) != bool(code):
                fell.append(f"{kind}, {seed} {number}, {words}: {code} {stderr}")
    return fell, []


def _solved_study(folder: Path) -> Path:
    """The table of a study that is solved, with its runs beside it."""
    model, _ = KINDS["bonds"]()
    write_file(document_of(model.grid, with_run(model, steps=10).settings), folder / "plate.json")
    (folder / "study.toml").write_text(STUDY)
    with contextlib.chdir(folder):
        code, stderr = _run_command(pdsolve, "study", "study.toml", "-q", "--workers", "1")
    if code:
        raise RuntimeError(stderr)
    return (folder / "study.sqlite").rename(folder / "whole.sqlite")


def _tables(folder: Path, forged: Any, whole: Path, seed: int) -> Tried:
    """Bytes of the table of a study are others, or values: refused, or read and gone on with as it was."""
    fell, wrong, path = [], [], folder / "study.sqlite"
    expected = _rows(whole)
    with contextlib.chdir(folder):
        for number in range(BATCH):
            chance = random.Random(f"{seed} {number}")
            remove(path)
            path.write_bytes(whole.read_bytes())
            if chance.random() < 0.5:
                path.write_bytes(forged.damaged(path.read_bytes(), chance))
            else:
                _edit(path, forged.EVIL, chance)
            for main, *words in (
                (pdpost, "study", path.name, "-o", "x.png", "--force"),
                (pdsolve, "study", "study.toml"),
            ):
                code, stderr = _run_command(main, *words, "-q")
                if code and (code not in (1, REFUSED) or stderr.count("\n") != 1):
                    fell.append(f"{seed} {number}, {words}: {code} {stderr}")
                elif not code and path.stat().st_size and _rows(path) != expected:
                    wrong.append(f"{seed} {number}, {words}")
    return fell, wrong


def _edit(path: Path, values: Sequence[Any], chance: random.Random) -> None:
    """Another value in some place of a table of a study, by other means."""
    with contextlib.suppress(sqlite3.Error, OverflowError), contextlib.closing(sqlite3.connect(path)) as connection:
        table = chance.choice(("run", "run", "study", "column_unit", "checksum"))
        columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
        ((row,),) = connection.execute(f"SELECT rowid FROM {table} ORDER BY random() LIMIT 1")
        changed = (f'UPDATE {table} SET "{chance.choice(columns)}" = ? WHERE rowid = ?', (chance.choice(values), row))
        connection.execute(*chance.choice((changed, changed, (f"DELETE FROM {table} WHERE rowid = ?", (row,)))))
        connection.commit()


def _rows(path: Path) -> list[tuple[Any, ...]]:
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return connection.execute("SELECT * FROM run ORDER BY number").fetchall()


def _run_command(main: Callable[[list[str]], int], *words: str) -> tuple[int, str]:
    """The exit code of a command, and what it says on stderr; an error that it does not expect is raised."""
    err = io.StringIO()
    with contextlib.redirect_stderr(err), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            code = main(list(words))
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, err.getvalue()
