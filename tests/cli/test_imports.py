"""What each program imports, and that an import changes nothing: read in a fresh process."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

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
    """What is run, and the libraries that are imported by then; those of `LIBRARIES` that are not named must not be."""

    does: str  # lines of Python, or the words of a command
    imports: set[str]


GROUND = (
    "pdmesh.background_thread",
    "pdmesh.messages",
    "pdmesh.quantities",
    "pdmesh.spelling",
    "pdmesh.commandline",
    "pdmesh.compiled_watch",
    "pdmesh.commandline",
    "pdmesh.environment_variables",
    "pdmesh.files",
    "pdmesh.file_kinds",
    "pdmesh.lazy_imports",
    "pdmesh.model",
    "pdmesh.plain_figure",
    "pdmesh.plain_text",
    "pdmesh.plain_text",
    "pdmesh.stopping",
    "pdmesh.trust",
)
MAY = {  # what a program may import of the others
    "pdmesh": (),
    "pdsolve": GROUND,
    "pdpost": (*GROUND, "pdsolve.errors", "pdsolve.fracture", "pdsolve.measures", "pdsolve.results", "pdsolve.study"),
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
CHAINS: dict[str, tuple[Row, ...]] = {  # one process each: a row may import no less than those before it
    "pdmesh": (
        Row("import pdmesh", set()),
        Row("pdmesh --help", set()),
        Row("from pdmesh import Material", {"msgspec"}),
        Row("pdmesh schema", {"msgspec"}),
        Row("from pdmesh import Scene", READS | {"shapely"}),
        Row("from pdmesh import Scene, box, build, read_scene", READS | {"shapely"}),
    ),
    "pdsolve": (
        Row("import pdsolve", set()),
        Row("pdsolve --help", set()),
        Row("from pdsolve import Model, read_model", READS),
        Row("from pdsolve import read_model, simulate", SOLVES),
        Row(BARE, SOLVES),
    ),
    "pdpost numbers": (
        Row("import pdpost", set()),
        Row("import pdpost.figures", set()),
        Row("from pdpost import figures", set()),
        Row("from pdpost import Results", READS),
        Row("pdpost sql small.sqlite", READS),
        Row("pdpost history small.sqlite --json", READS),
        Row("from pdpost import crack", READS | {"scipy", "shapely"}),
        Row("pdpost crack small.sqlite --json", READS | {"scipy", "shapely"}),
        Row("pdpost export small.sqlite", READS | {"meshio", "scipy", "shapely"}),
    ),
    "pdpost figures": (
        Row("from pdpost import figures; figures.balance", DRAWS),
        Row("pdpost balance small.sqlite", DRAWS),
        Row("from pdpost import figures; figures.field", DRAWS | {"shapely"}),
        Row("pdpost crack small.sqlite", CLIPS),
        Row("pdpost damage small.sqlite", CLIPS),
    ),
}
RUN = """
import json, runpy, sys
seen = []
for row in sys.argv[1:]:
    words = row.split()
    if words[0] in {house}:
        sys.argv = words
        try:
            runpy.run_module(words[0] + ".__main__", run_name="__main__")
        except SystemExit as left:
            assert not left.code, left.code
    else:
        exec(row)
    seen.append(sorted(sys.modules))
print(json.dumps(seen))
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

found = {}
for package in sys.argv[1:]:
    before = state()
    names = list(modules(importlib.import_module(package)))
    for name in names:
        importlib.import_module(name)
    after = state()
    found[package] = [len(names), {key: [before[key], after[key]] for key in before if before[key] != after[key]}]
print(json.dumps(found))
"""


def last_line(code: str, *words: str) -> Any:
    """The last line that a fresh Python prints, as JSON."""
    ran = subprocess.run([sys.executable, "-c", code, *words], check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(ran.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize("chain", CHAINS)
def test_what_is_imported(small_results: Path, here: Path, chain: str) -> None:
    program, rows = chain.split()[0], CHAINS[chain]
    seen = last_line(RUN.format(house=HOUSE), *(row.does for row in rows))
    found = [
        (row.does, {name.split(".")[0] for name in modules} & LIBRARIES)
        for row, modules in zip(rows, seen, strict=True)
    ]
    assert found == [tuple(row) for row in rows]
    others = {name for modules in seen for name in modules if name.startswith(HOUSE) and name not in HOUSE}
    may = tuple(f"{allowed}." for allowed in (program, *MAY[program]))
    assert [name for name in sorted(others) if not f"{name}.".startswith(may)] == []


@pytest.mark.slow
def test_an_import_changes_nothing(here: Path) -> None:
    """Neither settings nor signals nor files, whichever of the modules comes."""
    found = last_line(CHANGES, *HOUSE)
    assert min(count for count, _ in found.values()) > 10
    assert {package: changed for package, (_, changed) in found.items() if changed} == {}
