"""Models and studies that are forged, and the commands that read them.

As `forged_databases.py`, in a process of its own.
"""

from __future__ import annotations

import os
import random
import signal
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from forged_databases import LONG, WILD_JSON, damaged, end_of, forged_json, outcome

from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import Model

SOUND = "plate.json"
STUDY = """drawing = "plate.json"
set.model.run.every = 10
set.model.run.steps = 20
[vary.model]
"material.G0" = [204, 100]
"horizon.ratio" = [3, 4]
[repeat]
times = 2
step = 0.1
"""
ANSWERS, PATIENCE = (0, 2, 3, 130), 5  # s: what takes longer is asked to stop, with code 130
OF_MODELS = ("dry", "solve", "info")
OF_STUDIES = ("plan",)

Main = Callable[[list[str]], int]


def _commands(path: Path, names: Iterable[str]) -> dict[str, tuple[Main, list[str]]]:
    """Commands that read a model, or a study, by their names here."""
    from pdmesh.__main__ import main as pdmesh
    from pdsolve.__main__ import main as pdsolve

    every: dict[str, tuple[Main, list[str]]] = {
        "dry": (pdsolve, [str(path), "--dry-run", "-q"]),
        "study": (pdsolve, ["study", str(path), "--workers", "1", "-q"]),
        "solve": (pdsolve, [str(path), "-o", "solved.sqlite", "--force", "--threads", "1", "-q"]),
        "info": (pdmesh, ["info", str(path)]),
        "plan": (pdmesh, ["plan", str(path)]),
    }
    return {name: every[name] for name in names}


def _ask_to_stop(*_: object) -> None:
    """A run that would go on for long is asked to stop; then it has as long as any command."""
    signal.signal(signal.SIGPROF, end_of)
    signal.setitimer(signal.ITIMER_PROF, LONG)
    os.kill(os.getpid(), signal.SIGINT)


def _tried(path: Path, names: Iterable[str], file: str, answers: tuple[int, ...]) -> list[dict[str, str]]:
    wrong = []
    for name, (main, words) in _commands(path, names).items():
        Path("last.txt").write_text(f"{file} {name}")
        asks = name == "solve" and 130 in answers
        signal.signal(signal.SIGPROF, _ask_to_stop if asks else end_of)
        found = outcome(main, words, answers, PATIENCE if asks else LONG)
        if found:
            wrong.append({"file": file, "command": name, "wrong": found})
    return wrong


def models(folder: Path, some: dict[str, Model]) -> None:
    """Put the grid files of these models into a folder."""
    for name, model in some.items():
        write_file(document_of(model.grid, model.settings), folder / f"{name}.json")


def forged_models(folder: Path, seed: int, count: int) -> list[dict[str, str]]:
    """Forge so many of the grid files in a folder, in turn, after those that are sound; what went wrong."""
    os.chdir(folder)
    whole = sorted(path for path in Path().glob("*.json") if path.name != "forged.json")
    wrong = [found for path in whole for found in _tried(path, OF_MODELS, f"sound: {path}", (0,))]
    path = Path("forged.json")
    for number in range(count):
        chance, base = random.Random(f"{seed} {number}"), whole[number % len(whole)]
        path.write_text(forged_json(base.read_text(), chance), "utf-8", errors="replace")
        wrong += _tried(path, OF_MODELS, f"{seed} {number}: {base}", ANSWERS)
    return wrong


def _toml(value: Any) -> str:
    """A value as TOML has it, as well as can be."""
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {_toml(inside)}' for key, inside in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool) or value is None:
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(letter if letter.isprintable() and letter not in '"\\' else "?" for letter in value) + '"'
    return repr(value)


def forged_toml(text: str, chance: random.Random) -> str:
    """TOML with a value another, or gone; one in three is not even TOML."""
    if chance.random() < 0.33:
        return damaged(text.encode(), chance).decode(errors="replace")
    found = tomllib.loads(text)
    for _ in range(chance.randint(1, 2)):
        inside: Any = found
        while True:
            key = chance.choice(list(inside) if isinstance(inside, dict) else range(len(inside)))
            if isinstance(inside[key], dict | list) and inside[key] and chance.random() < 0.7:
                inside = inside[key]
                continue
            if chance.random() < 0.2:
                del inside[key]
            elif chance.random() < 0.2 and isinstance(inside, dict):
                inside[chance.choice(("x", "\x1b", "model", "run.steps", "nu"))] = inside.pop(key)
            else:
                inside[key] = chance.choice(WILD_JSON)
            break
    return "".join(f'"{key}" = {_toml(value)}\n'.replace("\x1b", "?") for key, value in found.items())


def forged_studies(folder: Path, seed: int, count: int, solved: int) -> list[dict[str, str]]:
    """Forge so many studies of the model ``plate.json`` in a folder, after one that is sound; what went wrong.

    One in `solved`, and the sound one, are solved, which starts processes; 0: none.
    """
    os.chdir(folder)
    path = Path("sound.toml")
    path.write_text(STUDY)
    wrong = _tried(path, (*OF_STUDIES, *["study"] * (solved > 0)), "sound", (0,))
    path = Path("forged.toml")
    for number in range(count):
        chance = random.Random(f"{seed} {number}")
        path.write_text(forged_toml(STUDY, chance), "utf-8", errors="replace")
        names = (*OF_STUDIES, "study") if solved and number % solved == 0 else OF_STUDIES
        for table in Path().glob("forged.*sqlite*"):
            table.unlink()
        wrong += _tried(path, names, f"{seed} {number}", ANSWERS)
    return wrong
