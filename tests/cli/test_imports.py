"""What each program imports, and that an import changes nothing: read in a fresh process."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from plates import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LIBRARIES = {name.split(">=")[0].replace("pillow", "PIL") for name in PROJECT["dependencies"]}
HOUSE = tuple(PROJECT["scripts"])

READS = {"msgspec", "numpy"}
DRAWS = READS | {"PIL", "matplotlib"}  # PIL comes with matplotlib
SOLVES = READS | {"numba", "scipy"}  # numba looks for scipy
CLIPS = DRAWS | {"scipy", "shapely"}  # a plate is clipped to its outline by shapely


class Row(NamedTuple):
    """What is run, and the libraries that it imports; those of `LIBRARIES` that are not named it must not."""

    does: str  # lines of Python, or the words of a command
    imports: set[str]


GROUND = (
    "pdmesh.spelling",
    "pdmesh.commandline",
    "pdmesh.completion",
    "pdmesh.files",
    "pdmesh.file_kinds",
    "pdmesh.lazy_imports",
    "pdmesh.model",
    "pdmesh.printing",
    "pdmesh.trust",
)
MAY = {  # what a program may import of the others
    "pdmesh": (),
    "pdsolve": GROUND,
    "pdpost": (*GROUND, "pdsolve.errors", "pdsolve.results", "pdsolve.study"),
}
BARE = """import numpy as np  # a bare list of nodes, solved
from pdmesh.model.node_grid import Grid
from pdmesh.model.document import Material, Run, Settings
from pdsolve import Model, simulate
x, y = (side.ravel() * 1e-3 for side in np.meshgrid(range(8), range(8)))
nodes = np.column_stack([x, y]), np.full(64, 1e-3), np.zeros(64, dtype=bool), np.full(64, -1)
settings = Settings(material=Material(E=65e9, rho=2235, G0=204), run=Run(steps=2, every=1))
simulate(Model(Grid(np.arange(64), *nodes, np.zeros((0, 4))), settings)).close()
"""
ROWS = {
    "pdmesh": (
        Row("import pdmesh", set()),
        Row("from pdmesh import Material", {"msgspec"}),
        Row("from pdmesh import Scene", READS | {"shapely"}),
        Row("from pdmesh import Scene, box, build, read_scene", READS | {"shapely"}),
        Row("pdmesh --help", set()),
        Row("pdmesh schema", {"msgspec"}),
    ),
    "pdsolve": (
        Row("import pdsolve", set()),
        Row("from pdsolve import Model, read_model", READS),
        Row("from pdsolve import read_model, simulate", SOLVES),
        Row(BARE, SOLVES),
        Row("pdsolve --help", set()),
    ),
    "pdpost": (
        Row("import pdpost", set()),
        Row("import pdpost.figures", set()),
        Row("from pdpost import figures", set()),
        Row("from pdpost import Results", READS),
        Row("from pdpost import crack", READS | {"scipy"}),
        Row("from pdpost import figures; figures.balance", DRAWS),
        Row("from pdpost import figures; figures.field", CLIPS),
        Row("pdpost sql small.sqlite", READS),
        Row("pdpost history small.sqlite --json", READS),
        Row("pdpost balance small.sqlite", DRAWS),
        Row("pdpost crack small.sqlite --json", READS | {"scipy"}),
        Row("pdpost crack small.sqlite", CLIPS),
        Row("pdpost damage small.sqlite", CLIPS),
        Row("pdpost export small.sqlite", READS | {"meshio", "scipy"}),
    ),
}
RUN = """
import json, runpy, sys
words = sys.argv[1:]
if words[0] in {house}:
    sys.argv = words
    try:
        runpy.run_module(words[0] + ".__main__", run_name="__main__")
    except SystemExit as left:
        assert not left.code, left.code
else:
    exec(words[0])
print(json.dumps(sorted(sys.modules)))
"""
CHANGES = """
import importlib, json, os, pkgutil, signal, sys, threading, warnings
import gmsh, matplotlib.figure, meshio, msgspec, numba, numpy, PIL.Image, scipy.interpolate, scipy.sparse.csgraph
import scipy.spatial, scipy.special, shapely, tqdm, matplotlib.backends.backend_agg, sqlite3

def state():
    return {
        "settings of matplotlib": {key: repr(value) for key, value in dict.items(matplotlib.rcParams)},
        "colour maps": sorted(matplotlib.colormaps),
        "environment": dict(os.environ),
        "filters of warnings": list(map(repr, warnings.filters)),
        "signals": [repr(signal.getsignal(number)) for number in signal.valid_signals()],
        "errors of numpy": numpy.geterr(),
        "printing of numpy": repr(numpy.get_printoptions()),
        "threads": threading.active_count(),
        "path": list(sys.path),
        "folder": [os.getcwd(), sorted(os.listdir())],
        "hooks": [repr(sys.excepthook), repr(sys.displayhook), sys.getrecursionlimit()],
    }

def modules(package):
    for one in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not one.name.endswith("__main__"):
            yield one.name

before = state()
names = list(modules(importlib.import_module(sys.argv[1])))
for name in names:
    importlib.import_module(name)
after = state()
print(json.dumps([len(names), {key: [before[key], after[key]] for key in before if before[key] != after[key]}]))
"""


def last_line(code: str, *words: str) -> list:
    """The last line that a fresh Python prints, as JSON."""
    ran = subprocess.run([sys.executable, "-c", code, *words], check=True, stdout=subprocess.PIPE, text=True)
    found: list = json.loads(ran.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize(
    ("program", "row"),
    [pytest.param(name, row, id=row.does.splitlines()[0]) for name, rows in ROWS.items() for row in rows],
)
def test_what_is_imported(small_results: Path, here: Path, program: str, row: Row) -> None:
    words = row.does.split() if row.does.startswith(HOUSE) else [row.does]
    modules = last_line(RUN.format(house=HOUSE), *words)
    assert {name.split(".")[0] for name in modules} & LIBRARIES == row.imports
    others = [name for name in modules if name.startswith(HOUSE) and name not in HOUSE]
    may = tuple(f"{allowed}." for allowed in (program, *MAY[program]))
    assert [name for name in others if not f"{name}.".startswith(may)] == []


@pytest.mark.parametrize("package", ROWS)
def test_an_import_changes_nothing(here: Path, package: str) -> None:
    """Neither settings nor signals nor files, whichever of its modules comes."""
    count, changed = last_line(CHANGES, package)
    assert count > 10
    assert changed == {}
