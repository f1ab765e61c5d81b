"""What a command of pdpost draws, as a short mark, to see whether a picture is of the present drawing code.

The command draws small results that were never solved. The mark is a hash of the words of that picture, its size in
tenths of an inch and its most frequent colours. It is the same on all machines with one version of matplotlib, and
does not change with code that leaves the picture as it is. Pictures that the small results cannot have are marked by
the style of all pictures alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
from collections import Counter
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.kills import module_of_tests
from pdpost.__main__ import main as pdpost
from pdpost.figures.sheets import HATCHES
from pdpost.figures.style import STYLE
from pdsolve.run.measures import EnergyBalanceRow

DRAWN_WITH = "3.11.2"  # of matplotlib: others set words in other places
TEXT = re.compile(r"<text [^>]*>([^<]*)</text>")
FILL = re.compile(r"(?:fill|stroke): (#[0-9a-f]{6})")
SIZE = re.compile(r'<svg [^>]*?viewBox="0 0 ([0-9.]+) ([0-9.]+)"')
POINTS = 7.2  # in a tenth of an inch
OFTEN = 0.08  # of all colours of a picture: those that are drawn as often are of its mark
BY_STYLE = (
    "sif",
    "fatigue",
    "render",
    "animate",
    "compare",
    "preview",
)  # commands whose pictures are marked by the style alone
NAMES = ("hammer", "middle")  # of conditions
DIFFUSING = {"physics": "diffusion", "medium": {"D": 1e-9, "C_solid": 7e4, "C_sat": 5e2}}


def mark(picture: str, dimension: int, folder: Path) -> str:
    """The mark of what the command `picture` draws for results of this dimension; `folder` is written to."""
    words = picture.split()
    style = json.dumps([STYLE, HATCHES], sort_keys=True, default=str)
    parts: list[object] = [style]
    if words[0].rstrip(";") not in BY_STYLE and not {"--gap", "--clip"} & set(words):
        parts += outline(words, dimension, folder)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def outline(words: list[str], dimension: int, folder: Path) -> list[object]:
    """Texts, size and frequent colours of what a command draws. Raises ValueError if it draws nothing."""
    results = prescribed(dimension, "content" in words, folder)
    options = [re.sub(r"^([xyz])=.*", r"\1=0.0035", word) for word in words[1:]]
    options = [word for pair in _pairs(options) if pair[0] != "--time" for word in pair]
    path = folder / "drawn.svg"
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = pdpost([words[0], str(results), *options, "-o", str(path), "--force"])
    if code:
        raise ValueError(f"{' '.join(words)}: exit code {code}: {said.getvalue()}")
    text = path.read_text(encoding="utf-8")
    size = SIZE.search(text)
    assert size is not None
    colours = Counter(FILL.findall(text))
    often = sorted(colour for colour, count in colours.items() if count >= OFTEN * colours.total())
    return [TEXT.findall(text), [round(float(side) / POINTS) for side in size.groups()], often]


def _pairs(options: list[str]) -> list[list[str]]:
    """Options with their values."""
    return [options[at : at + 2] for at in range(0, len(options), 2)]


@lru_cache
def prescribed(dimension: int, dissolves: bool, folder: Path) -> Path:
    """Small results of a plate or a block, half of which is cracked or dissolved."""
    tests = module_of_tests("prescribed_results")
    path = folder / f"{'dissolving' if dissolves else 'cracked'}_{dimension}.sqlite"
    nodes, families = tests.block() if dimension == 3 else tests.plate()
    position = nodes.position
    axis = position.shape[1] - 1
    middle = float(np.median(position[:, axis])) + 1e-6
    above = position[:, axis] > middle
    front = float(np.median(position[:, 0]))
    starts = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    ends = np.column_stack([starts, families.neighbour])
    parted = (above[ends[:, 0]] != above[ends[:, 1]]) & (position[ends].mean(axis=1)[:, 0] < front)
    broken = [(5, int(a), int(b)) for a, b in nodes.ids[ends[parted]]]
    u = 1e-3 * position.copy()
    u[:, axis] += np.where(above, 5e-6, 0.0)
    fields = {name: values for name, values in zip(("ux", "uy", "uz"), u.T, strict=False)}
    fields |= {name.replace("u", "v"): 1e6 * values for name, values in list(fields.items())}
    fields |= {"plastic": np.where(above, 0.01, 0.0)}
    model: dict[str, object] = {
        "notch": [],
        "nodes": [],
        "material": {"E": 70e9, "rho": 2000.0, "G0": 10.0},
        "conditions": [{"kind": "displacement", "name": name, "nodes": [1]} for name in NAMES],
    }
    reactions = [
        (step, step * 1e-6, number, "displacement", 0.0, 5e3 * step, 0.0, 1e-6 * step, 0.0, 0.0)
        for step in (0, 10)
        for number in range(len(NAMES))
    ]
    if dissolves:
        model = {"notch": [], "nodes": [], **DIFFUSING}
        fields, broken, reactions = {"c": np.full(len(u), 5e2), "h": np.where(above, 7e4, 5e2)}, [], []
    ledger = [EnergyBalanceRow(step, step * 1e-6, 0.1, 0.2, 0.1 * step, 0.2 * step, 0.0, 0.0, 0) for step in (0, 10)]
    tests.results_of(
        nodes, families, u, broken, model, path=path, ledger=ledger, fields=fields, reactions=reactions
    ).close()
    return path
