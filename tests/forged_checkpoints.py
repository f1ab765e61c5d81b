"""Databases of runs that were stopped, their checkpoints forged with checksums that agree; and `pdsolve --resume`.

As `forged_databases.py`, in a process of its own, as a checkpoint may break memory.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import sqlite3
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from forged_databases import WITHIN, Change, damaged, end_of, outcome
from tampered_databases import tampered

from pdsolve.model import Model
from pdsolve.results import remove
from pdsolve.run.simulation import Options, simulate

ANSWERS = (0, 2, 3)  # finished, refused, no physics any more
WILD = (-1, 0, 1, 5, 7, 1000, 10**6, 2**31 - 1, -(2**31), 2**62, -(2**63))
NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 1e30, 1e-320, -1.0, 0.0, 1e9)
FAILS = sqlite3.Error, TypeError, ValueError, OverflowError, IndexError  # of a change of what is changed already
TYPES = ("<f4", "<f8", "<i4", "<i8", "|u1", "|b1", "<i2")

Row = tuple[str, int, str, bytes]


def stopped(folder: Path, kinds: dict[str, tuple[Model, Options]]) -> None:
    """Put databases of runs of these kinds, that were stopped half way, into a folder."""
    for name, (model, options) in kinds.items():
        half = model.settings.run.steps // 2
        path = folder / f"{name}.sqlite"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            simulate(model, path, options, lambda now, half=half: now.step >= half).close()  # type: ignore[misc]


def _rows(connection: sqlite3.Connection) -> list[Row]:
    return connection.execute("SELECT name, step, type, data FROM checkpoint").fetchall()


def _put(connection: sqlite3.Connection, name: str, kind: str, data: bytes) -> None:
    connection.execute("UPDATE checkpoint SET type = ?, data = ? WHERE name = ?", (kind, data, name))


def _wild(kind: np.dtype[Any], chance: random.Random) -> Any:
    """A value that a run has seldom."""
    with np.errstate(all="ignore"):
        if kind.kind == "f":
            return kind.type(chance.choice(NUMBERS))
        return np.array(chance.choice(WILD)).astype(kind)


def _changed(values: np.ndarray[Any, Any], chance: random.Random) -> np.ndarray[Any, Any]:
    """An array of the same type, some of it others."""
    kind = values.dtype
    match chance.randrange(8):
        case 0:
            return values[: chance.randrange(len(values) + 1)]
        case 1:
            return np.concatenate([values, np.full(chance.choice((1, 3, 1000)), _wild(kind, chance))])
        case 2:
            return np.full(len(values), _wild(kind, chance))
        case 3:
            return np.frombuffer(chance.randbytes(values.nbytes), dtype=kind)
        case 4:
            return values[np.random.default_rng(chance.randrange(2**32)).permutation(len(values))]
        case 5 if kind.kind in "iu" and len(values):
            return values + np.array(chance.choice((1, -1, 16, -16, 100))).astype(kind)
        case 6 if len(values):
            return np.roll(values, chance.choice((1, -1, 7)))
        case _:
            values = values.copy()
            if len(values):
                values[chance.randrange(len(values))] = _wild(kind, chance)
            return values


def array(connection: sqlite3.Connection, chance: random.Random) -> None:
    """An array of the checkpoint is another: cut, longer, elsewhere, of wild values."""
    rows = _rows(connection)
    weights = [1 if kind in ("<f4", "<f8") else 3 for _, _, kind, _ in rows]  # rows of nodes, bonds and cells
    name, _, kind, data = chance.choices(rows, weights)[0]
    with np.errstate(all="ignore"):
        values = _changed(np.frombuffer(data, dtype=kind), chance)
    _put(connection, name, kind, values.tobytes())


def together(connection: sqlite3.Connection, chance: random.Random) -> None:
    """All arrays of as many values as one has are cut, or longer, alike."""
    rows = _rows(connection)
    _, _, kind, data = chance.choice(rows)
    size = len(data) // np.dtype(kind).itemsize
    left, more = chance.randrange(size + 1), chance.random() < 0.5
    for name, _, kind, data in rows:
        values = np.frombuffer(data, dtype=kind)
        if len(values) == size:
            _put(connection, name, kind, (np.concatenate([values, values[:left]]) if more else values[:left]).tobytes())


def kind_of(connection: sqlite3.Connection, chance: random.Random) -> None:
    """An array is of another type, as its bytes or its values say."""
    name, _, kind, data = chance.choice(_rows(connection))
    other = chance.choice(TYPES)
    if chance.random() < 0.5:
        with np.errstate(all="ignore"):
            data = np.frombuffer(data, dtype=kind).astype(other).tobytes()
    _put(connection, name, other, data)


def step(connection: sqlite3.Connection, chance: random.Random) -> None:
    """The checkpoint is of another step."""
    connection.execute("UPDATE checkpoint SET step = ?", (chance.choice((0, 1, 5, 21, 39, 41, 10**6, 2**31, -1)),))


def name_of(connection: sqlite3.Connection, chance: random.Random) -> None:
    """Arrays are missing, or have each other's names."""
    rows = _rows(connection)
    (one, _, kind, data), (other, _, others, values) = chance.choice(rows), chance.choice(rows)
    if chance.random() < 0.5:
        connection.execute("DELETE FROM checkpoint WHERE name = ?", (one,))
    else:
        _put(connection, one, others, values)
        _put(connection, other, kind, data)


CHANGES: tuple[Change, ...] = (array, array, array, array, together, kind_of, step, name_of)


def forge(path: Path, chance: random.Random) -> str:
    """Change the database at `path`; what was done to it."""
    if chance.random() < 0.1:
        path.write_bytes(damaged(path.read_bytes(), chance))
        return "bytes"
    done: list[str] = []
    with contextlib.suppress(*FAILS), tampered(path) as connection:
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            change = chance.choice(CHANGES if chance.random() < 0.8 else WITHIN)
            done.append(change.__name__)
            change(connection, chance)
            connection.commit()
    return " ".join(done)


def forged_stops(folder: Path, seed: int, count: int) -> list[dict[str, str]]:
    """Go on with so many forged runs, of the databases in a folder in turn; what went wrong."""
    from pdsolve.__main__ import main

    signal.signal(signal.SIGPROF, end_of)
    os.chdir(folder)
    whole = sorted(path for path in Path().glob("*.sqlite") if path.name != "forged.sqlite")
    wrong, path = [], Path("forged.sqlite")
    for number in range(count):
        chance, base = random.Random(f"{seed} {number}"), whole[number % len(whole)]
        remove(path)
        path.write_bytes(base.read_bytes())
        done = forge(path, chance)
        file = f"{seed} {number}: {base}: {done}"
        Path("last.txt").write_text(file)
        found = outcome(main, ["--resume", str(path), "-q"], ANSWERS)
        if found:
            wrong.append({"file": file, "command": "resume", "wrong": found})
    return wrong


def sound_stops(folder: Path) -> list[str]:
    """Go on with the runs in a folder as they are; what is refused."""
    from pdsolve.__main__ import main

    signal.signal(signal.SIGPROF, end_of)
    os.chdir(folder)
    refused, path = [], Path("forged.sqlite")
    for base in sorted(path for path in Path().glob("*.sqlite") if path.name != "forged.sqlite"):
        remove(path)
        path.write_bytes(base.read_bytes())
        with tampered(path):
            pass
        if outcome(main, ["--resume", str(path), "-q"], (0,)):
            refused.append(base.stem)
    return refused


def main(words: Sequence[str]) -> None:
    """For those who look for more: FOLDER SEED COUNT, over databases that are there."""
    for found in forged_stops(Path(words[0]), *map(int, words[1:])):
        print(found["file"], found["wrong"], sep="\n", end="\n\n")


if __name__ == "__main__":
    main(sys.argv[1:])
