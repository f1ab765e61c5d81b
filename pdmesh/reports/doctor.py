"""Installed and missing components with installation advice: the findings of `pdmesh doctor`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import metadata
from importlib.util import find_spec
from typing import NamedTuple

from pdmesh import trust
from pdmesh.commandline import dependencies
from pdmesh.drawing.sandbox.child import SYSTEM_LIBRARIES
from pdmesh.drawing.scratch import scratch

PATIENCE = 60.0  # s that a library may take to load
NEEDED = ".geo, STEP and BREP files need it"
LOAD = "import gmsh; print(gmsh.__version__)"
WALLS = (
    "import sys; from pathlib import Path; from pdmesh.drawing.sandbox.walls import raise_walls;"
    " print(*raise_walls(Path(sys.argv[1]), 10.0))"
)
DEVICES = (
    "from pdsolve.device.runtime import devices\n"
    "try:\n    print(*(device.summary for device in devices()), sep=', ')\n"
    "except ValueError as error:\n    raise SystemExit(f'{error}')"
)
EXTRAS = {
    "distributed": ("studies on a cluster", "pip install 'pdsuite[study]'"),
    "mpi4py": ("one run on many ranks", "pip install 'pdsuite[mpi]'"),
    "pyvista": ("pdpost render, how bodies look", "pip install 'pdsuite[render]'"),
    "jupyter_threejs_sage": ("pdpost view, a run in the browser", "pip install 'pdsuite[view]'"),
    "shtab": ("completion in the shell", "pip install 'pdsuite[completion]'"),
}


class Finding(NamedTuple):
    """The result of one check of the installation."""

    name: str
    good: bool
    detail: str
    cure: str = ""  # how to get it, where it is missing
    needed: bool = True  # False: something works without it


def findings() -> list[Finding]:
    """All findings about this installation."""
    version = ".".join(map(str, sys.version_info[:3]))
    good = sys.version_info >= (3, 11)
    python = Finding("Python", good, f"{version} in {sys.prefix}", "3.11 or newer is needed")
    packages = [
        Finding(name, version is not None, version or "not installed", f"pip install {name}")
        for name, version in dependencies().items()
        if name != "gmsh"
    ]
    path = shutil.which("ffmpeg")
    cure = "films are GIF; for .mp4: apt-get install ffmpeg, brew install ffmpeg, winget install ffmpeg"
    ffmpeg = Finding("ffmpeg", path is not None, path or "not on the PATH", cure, needed=False)
    may = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    set_threads = os.environ.get("NUMBA_NUM_THREADS")
    threads = f", {set_threads} are (NUMBA_NUM_THREADS)" if set_threads else ""
    cores = Finding("cores", True, f"{may} of {os.cpu_count()} may be used{threads}")
    place, stays = trust.private_folder()
    cure = "each run compiles anew, some ten seconds: set NUMBA_CACHE_DIR to a folder that may be written to"
    kernels = Finding("compiled kernels", stays, f"kept in {place}" if stays else "kept nowhere", cure, needed=False)
    extras = []
    for name, (use, cure) in EXTRAS.items():
        installed = find_spec(name) is not None
        version = metadata.version(name) if installed else f"not installed ({use})"
        extras.append(Finding(name, installed, version, cure, needed=False))
    with scratch() as folder:
        stand, ended = _child(WALLS, str(folder))
    complete = {"landlock", "seccomp"} <= set(stand.split()) and not ended
    cure = "drawings of others are read behind limits of memory and time alone (Linux on x86-64 has more)"
    walls = Finding("sandbox for drawings", complete, stand or ended or "none", cure, needed=False)
    return [python, *packages, _gmsh(), walls, ffmpeg, cores, kernels, _devices(), *extras]


def lines(findings: list[Finding]) -> list[str]:
    """The findings in words."""
    said = []
    for finding in findings:
        mark = "ok     " if finding.good else "MISSING" if finding.needed else "without"
        said.append(
            f"{mark}  {finding.name}: {finding.detail}"
            + (f"; {finding.cure}" if finding.cure and not finding.good else "")
        )
    bad = [finding.name for finding in findings if finding.needed and not finding.good]
    return [*said, f"missing: {', '.join(bad)}" if bad else "all that is needed is there"]


def _gmsh() -> Finding:
    version, ended = _child(LOAD)
    if not ended:
        return Finding("Gmsh", True, version)
    if find_spec("gmsh") is None:
        return Finding("Gmsh", False, f"not installed; {NEEDED}, all else works", "pip install gmsh")
    cure = f"on Debian and Ubuntu: apt-get install {SYSTEM_LIBRARIES}"
    return Finding("Gmsh", False, f"cannot be loaded ({ended}); {NEEDED}, all else works", cure)


def _devices() -> Finding:
    """Finding about OpenCL devices, which a process of its own asks for: drivers may crash."""
    devices, ended = _child(DEVICES)
    cure = "pdsolve --device opencl needs one; all else works"
    return Finding("OpenCL", not ended, devices or ended.removeprefix("device: "), cure, needed=False)


def _child(code: str, *words: str) -> tuple[str, str]:
    """Output of a separate Python process, and the reason if it failed."""
    try:
        ran = subprocess.run(
            [sys.executable, "-P", "-c", code, *words],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
            env=trust.environment(),
        )
    except subprocess.TimeoutExpired:
        return "", f"no answer in {PATIENCE:g} s"
    last = (ran.stderr.strip().splitlines() or [f"ended with {ran.returncode}"])[-1]
    return ran.stdout.strip(), last if ran.returncode else ""
