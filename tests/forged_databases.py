"""Databases of results that are forged: changed at random, most of them so that their checksums agree; and all commands
of pdpost over them.

A process of its own does that (`python forged.py FOLDER SEED COUNT EACH`), as a file may break memory; it prints what
went wrong as JSON.
"""

from __future__ import annotations

import contextlib
import faulthandler
import io
import json
import math
import os
import random
import re
import signal
import sqlite3
import struct
import subprocess
import sys
import traceback
import warnings
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tampered_databases import tampered

from pdsolve.results.checksums import Checksum, select_schema
from pdsolve.results.schema import TABLES

LONG = 60  # s of computing: what takes longer has no end
EVIL: tuple[Any, ...] = (
    *(-1, 0, 1, 7, 2, 1000, -(2**31), 2**31, 2**62, 2**63 - 1, -(2**63), 10**6),
    *(math.inf, -math.inf, 1e300, -1e300, 1e-320, 1e9, -1e9, 0.5, 1e30),
    *(None, "", "x", "\x1b[31m", "1", "nan", "[]", b"", b"\x00", b"\xff" * 64),
)
COMMANDS: dict[str, list[str]] = {  # the words behind a command
    "sql": ["--json"],
    "history": ["--at", "0,0", "--json"],
    "balance": ["--json"],
    **{name: ["--json"] for name in ("reaction", "crack", "sif", "fatigue", "notch")},
    "line": ["--from", "0,0", "--to", "0.01,0.003", "--json"],
    "export": ["-o", "out.csv"],
    "bonds": ["-o", "out.png"],
    "damage": ["-o", "out.png", "--scale", "auto"],
    "separation": ["-o", "out.png"],
    "verify": [],
    "content": ["-o", "out.png"],
    "concentration": ["-o", "out.png"],
    "solid": ["-o", "out.png"],
    "temperature": ["-o", "out.png"],
    "nodes": ["-o", "out.png"],
    "slice": ["-o", "out.png"],
    "strain": ["-o", "out.png"],
    "stress": ["-o", "out.png"],
    "displacement": ["-o", "out.png", "--scale", "3"],
    "velocity": ["-o", "out.png"],
    "acceleration": ["-o", "out.png"],
    "energy": ["-o", "out.png"],
    "plastic": ["-o", "out.png"],
    "rotation": ["-o", "out.png"],
    "volume": ["-o", "out.png"],
    "boundary": ["--box", "0,0,9,9mm", "--depth", "3mm", "-o", "out.csv"],
    "tradeoff": ["--reference", "whole.sqlite", "-o", "out.png"],
    "compare": ["whole.sqlite", "-o", "out.png"],
    "watch": ["-o", "out.png", "--patience", "0.1"],
    "study": ["-o", "out.png"],
    "render": ["-o", "out.png"],
    "report": ["-o", "out.html"],
    "view": ["-o", "out.html"],
    "animate": ["-o", "out.gif"],
}
XDMF = ["-o", "out.xdmf"]

Change = Callable[[sqlite3.Connection, random.Random], None]


def _some_row(connection: sqlite3.Connection, chance: random.Random) -> tuple[str, int, list[str]]:
    """A table with rows, one of them and the names of its columns."""
    tables = [name for name in TABLES if name not in ("checksum", "float32_prefix")]
    for table in chance.sample(tables, len(tables)):
        rows = [row for (row,) in connection.execute(f"SELECT rowid FROM {table} LIMIT 500")]
        if rows:
            names = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
            return table, chance.choice(rows), [name for name in names if name != "crc"]
    raise ValueError("found no rows")


def value(connection: sqlite3.Connection, chance: random.Random) -> None:
    """One value of a row is another."""
    table, row, names = _some_row(connection, chance)
    connection.execute(f'UPDATE {table} SET "{chance.choice(names)}" = ? WHERE rowid = ?', (chance.choice(EVIL), row))


def column(connection: sqlite3.Connection, chance: random.Random) -> None:
    """One value is in all rows of a table."""
    table, _, names = _some_row(connection, chance)
    connection.execute(f'UPDATE {table} SET "{chance.choice(names)}" = ?', (chance.choice(EVIL),))


def scaled(connection: sqlite3.Connection, chance: random.Random) -> None:
    """The numbers of a column, times another."""
    table, _, names = _some_row(connection, chance)
    name = chance.choice(names)
    factor = chance.choice((-1, 0, 1e12, 1e-30, 1e200, 1000))
    connection.execute(f"""UPDATE {table} SET "{name}" = "{name}" * ? WHERE typeof("{name}") <> 'blob'""", (factor,))


def less(connection: sqlite3.Connection, chance: random.Random) -> None:
    """A row or a table is empty."""
    table, row, _ = _some_row(connection, chance)
    connection.execute(f"DELETE FROM {table} WHERE rowid = ? OR ?", (row, chance.random() < 0.5))


def more(connection: sqlite3.Connection, chance: random.Random) -> None:
    """A row twice, something of it changed."""
    table, row, names = _some_row(connection, chance)
    (found,) = connection.execute(f"SELECT {listed(names)} FROM {table} WHERE rowid = ?", (row,))
    values = dict(zip(names, found, strict=True))
    for name in chance.sample(names, chance.randint(1, len(names))):
        values[name] = chance.choice(EVIL)
    marks = ", ".join("?" * len(values))
    connection.execute(f"INSERT OR IGNORE INTO {table} ({listed(names)}) VALUES ({marks})", list(values.values()))


def listed(names: Sequence[str]) -> str:
    """Names of columns in SQL."""
    return ", ".join(f'"{name}"' for name in names)


def blob(connection: sqlite3.Connection, chance: random.Random) -> None:
    """Bytes that are others: bonds to nowhere, fields that are no numbers, far more than there should be."""
    table, name = chance.choice(
        [("family_chunk", "bonds"), ("family_chunk", "ahead"), ("field_chunk", "data"), ("checkpoint", "data")] * 2
        + [("family_chunk", "ahead")] * 3
    )
    rows = connection.execute(f"SELECT rowid, {name} FROM {table}").fetchall()
    if not rows:
        return
    row, data = chance.choice(rows)
    deflated = table == "family_chunk"
    try:
        data = bytearray(zlib.decompress(data) if deflated else data)
    except (TypeError, zlib.error):
        data = bytearray(64)
    match chance.randrange(5):
        case 0:
            data = data[: chance.randrange(len(data) + 1)]
        case 1:
            data = bytearray(chance.randbytes(len(data)))
        case 2 if deflated:
            data = bytearray(2**26)
        case 3 if len(data) >= 4:
            at = chance.randrange(len(data) // 4) * 4
            wild = chance.choice((-1, 10**6, -(10**6), 2**31 - 1, -(2**31), 5))
            data[at : at + 4] = struct.pack("<i", wild)
        case _ if len(data) >= 4:
            wild = struct.pack("<f", chance.choice((math.inf, math.nan, -math.inf, 3e38, 1e-40, -3e38)))
            for at in range(0, len(data) - 3, chance.choice((4, 400))):
                data[at : at + 4] = wild
    changed = zlib.compress(bytes(data), 1) if deflated and chance.random() < 0.9 else bytes(data)
    connection.execute(f"UPDATE {table} SET {name} = ? WHERE rowid = ?", (changed, row))


def model(connection: sqlite3.Connection, chance: random.Random) -> None:
    """The grid file in it says something else."""
    (text,) = connection.execute("SELECT value FROM meta WHERE key = 'model'").fetchone()
    connection.execute("UPDATE meta SET value = ? WHERE key = 'model'", (forged_json(str(text), chance),))


def meta(connection: sqlite3.Connection, chance: random.Random) -> None:
    """What the run says of itself is something else, or nothing."""
    keys = [key for (key,) in connection.execute("SELECT key FROM meta")]
    key = chance.choice([*keys, "time_step", "dimension", "initial_energy", "status"])
    if chance.random() < 0.3:
        connection.execute("DELETE FROM meta WHERE key = ?", (key,))
    else:
        connection.execute("UPDATE meta SET value = ? WHERE key = ?", (chance.choice(EVIL), key))


def schema(connection: sqlite3.Connection, chance: random.Random) -> None:
    """Tables are missing, are others, or are none."""
    table = chance.choice(list(TABLES))
    (sql,) = connection.execute("SELECT sql FROM sqlite_master WHERE name = ?", (table,)).fetchone()
    connection.executescript(
        chance.choice(
            (
                f"DROP TABLE {table}",
                f"DROP TABLE {table}; {sql.replace('INTEGER', 'TEXT')}",
                f"ALTER TABLE {table} RENAME TO old; CREATE VIEW {table} AS SELECT * FROM old",
                f"DROP TABLE {table}; CREATE VIEW {table} AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1"
                " FROM c) SELECT x FROM c",
                f"ALTER TABLE {table} ADD COLUMN more",
                f"CREATE TRIGGER t AFTER INSERT ON {table} BEGIN DELETE FROM node; END",
                f"PRAGMA user_version = {chance.choice((0, 1, 2, 3, 4, 5, 7, 2**31 - 1))}",
                "CREATE TABLE mine (x)",
            )
        )
    )
    with contextlib.suppress(sqlite3.Error):
        found = Checksum().of("schema", connection.execute(select_schema()))
        connection.execute("UPDATE checksum SET rows = ?, crc = ? WHERE name = 'schema'", found)


WITHIN: tuple[Change, ...] = (value, value, column, scaled, less, more, blob, blob, model, model, meta)


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Bytes of a file changed as they are: cut, zeroed, others, pages swapped."""
    spoilt = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(max(len(spoilt), 1))
        match chance.randrange(6):
            case 0:
                del spoilt[at:]
            case 1:
                spoilt[at : at + 100] = chance.randbytes(min(100, len(spoilt) - at))
            case 2 if spoilt:
                spoilt[at] ^= 1 << chance.randrange(8)
            case 3 if spoilt:
                at = chance.randrange(len(spoilt) // 4096 + 1) * 4096
                spoilt[at : at + chance.choice((8, 100, 4096))] = chance.randbytes(8)
            case 4 if len(spoilt) > 32768:
                one, other = (chance.randrange(len(spoilt) // 16384) * 16384 for _ in range(2))
                spoilt[one : one + 16384] = spoilt[other : other + 16384]
            case _ if spoilt:
                spoilt[at : at + 16] = bytes(min(16, len(spoilt) - at))
    return bytes(spoilt)


WILD_JSON: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**400, 1e300, -1e300, 1e-320, 1e30, "", "x", "\x1b]0;x\x07\n", [], {}),
    *([1], [[0, 0]], {"a": 1}, "none", "diffusion", 3, 0.5),
)


def forged_json(text: str, chance: random.Random) -> str:
    """JSON with some of its values others, doubled or gone; one in five is not even JSON."""
    if chance.random() < 0.2:
        spoilt = damaged(text.encode(), chance).decode(errors="replace")
        return chance.choice((spoilt, "", "{}", "[" * 100_000, "null", text.replace("0.0", "1e999"), text[:-20]))
    found = json.loads(text)
    for _ in range(chance.randint(1, 3)):
        inside: Any = found
        while True:
            keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
            if not keys:
                break
            key = chance.choice(keys)
            deeper = inside[key]
            if isinstance(deeper, dict | list) and deeper and chance.random() < 0.8:
                inside = deeper
                continue
            if chance.random() < 0.15:
                del inside[key]
            elif chance.random() < 0.15 and isinstance(inside, list):
                inside.append(deeper)
            else:
                number = isinstance(deeper, float | int) and chance.random() < 0.4
                inside[key] = deeper * chance.choice((-1, 2, 1e9, 1e-9, 0)) if number else chance.choice(WILD_JSON)
            break
    return json.dumps(found)


def forge(path: Path, chance: random.Random) -> str:
    """Change the database at `path`; what was done to it."""
    if chance.random() < 0.15:
        path.write_bytes(damaged(path.read_bytes(), chance))
        return "bytes"
    if chance.random() < 0.1:
        with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as connection:
            schema(connection, chance)
            connection.commit()
        return "schema"
    done = []
    with contextlib.suppress(sqlite3.Error, TypeError, ValueError, OverflowError), tampered(path) as connection:
        for _ in range(chance.choice((1, 1, 2))):
            change = chance.choice(WITHIN)
            done.append(change.__name__)
            change(connection, chance)
            connection.commit()
    return " ".join(done)


OF_A_RUN = re.compile(r"pdsolve study: run \d+ failed: .+: .+")


def outcome(
    main: Callable[[list[str]], int], words: list[str], answers: Sequence[int] = (0, 2), patience: int = LONG
) -> str:
    """What is wrong with how a command ended, by codes that are `answers`; nothing if it said what it found, or in one
    line why it did not. After `patience` seconds of computing there is an alarm."""
    out, err = io.StringIO(), io.StringIO()
    faulthandler.dump_traceback_later(10 * LONG, exit=True)
    signal.setitimer(signal.ITIMER_PROF, patience)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            code = main(words)
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException:
        return traceback.format_exc()[-1500:]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
    said = err.getvalue()
    lines = [line for line in said.splitlines() if not re.match(r"pd\w+: (warning|note): ", line)]
    if code in (2, 3) and (
        sum(line.startswith("pd") for line in lines) != 1 or not all(map(str.isprintable, said.splitlines()))
    ):
        return f"said {said!r}"
    patient = words[0] == "watch" and code == 1
    own = code == 1 and lines and all(OF_A_RUN.match(line) for line in lines)  # a study's runs fail each in a line
    return "" if code in answers or patient or own else f"ended with {code}: {said!r}"


def end_of(*_: object) -> None:
    """Ends what takes too long."""
    raise TimeoutError(f"no end within {LONG} s of computing")


def forged_runs(folder: Path, seed: int, count: int, each: int) -> list[dict[str, str]]:
    """Forge so many of the databases in a folder, and run `each` commands over every one of them; what went wrong."""
    from pdpost.__main__ import main

    signal.signal(signal.SIGPROF, end_of)
    os.chdir(folder)
    whole = sorted(path for path in Path().glob("*.sqlite") if path.name != "forged.sqlite")
    wrong, numbers = (
        [],
        [name for name, words in COMMANDS.items() if words[1:2] in ([], ["out.csv"]) or "--json" in words],
    )
    pictures, turn = [name for name in COMMANDS if name not in numbers], seed
    for number in range(count):
        chance = random.Random(f"{seed} {number}")
        path, base = Path("forged.sqlite"), chance.choice(whole)
        for beside in Path().glob("forged.sqlite*"):
            beside.unlink()
        path.write_bytes(base.read_bytes())
        done = forge(path, chance)
        for name in [*(numbers[(turn + at) % len(numbers)] for at in range(each)), pictures[number % len(pictures)]]:
            words = XDMF if name == "export" and chance.random() < 0.5 else COMMANDS[name]
            words = [*words, "--force"] if "-o" in words else words
            Path("last.txt").write_text(f"{seed} {number} {name} {base} {done}")
            found = outcome(main, [name, str(path), *words])
            if found:
                wrong.append({"file": f"{seed} {number}: {base}: {done}", "command": name, "wrong": found})
        turn += each
    return wrong


def apart(
    call: str, folder: Path, *numbers: int, module: str = "forged_databases", limit: float = 900
) -> list[dict[str, str]]:
    """What such a function of a module finds in a process of its own; a signal that ends it is something wrong too."""
    words = [sys.executable, "-c", f"import sys; sys.path[:0] = {sys.path!r}; import json, {module} as f;"
             f" print(json.dumps(f.{call}(f.Path({str(folder)!r}), *{numbers!r})))"]  # fmt: skip
    done = subprocess.run(words, capture_output=True, text=True, timeout=limit, check=False)
    if done.returncode:
        last = (folder / "last.txt").read_text()
        return [{"file": last, "command": "", "wrong": f"ended with {done.returncode}: {done.stderr[-1500:]}"}]
    found: list[dict[str, str]] = json.loads(done.stdout.splitlines()[-1])
    return found
