"""Runs Gmsh and meshio in processes of their own."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdmesh import trust
from pdmesh.drawing.body_of_groups import closes, fits, with_own_volumes
from pdmesh.drawing.sandbox.copies import Copy
from pdmesh.drawing.sandbox.scan import OWN
from pdmesh.drawing.sandbox.walls import STAGE, how_it_ended, warn_of_missing
from pdmesh.drawing.scratch import scratch
from pdmesh.scene.shapes import CHORD_TOLERANCE, SceneError

SYSTEM_LIBRARIES = (
    "libgl1 libglu1-mesa libxft2 libxcursor1 libxinerama1 libxrender1 libxfixes3 libxext6 libfontconfig1 libgomp1"
)
WALLS = True  # for all but trusted drawings
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # walls leave no other
MESH_TIME = 15.0  # s of processor time, for a mesh of what other triangles describe as well
PATIENCE = 10  # times the processor time: what a reader may take on a busy machine
OUT_OF_TIME = getattr(signal, "SIGXCPU", None)  # Windows has no such limit
PLACE = re.compile(r"'(?:[^']*[/\\])?([0-9]+\.[a-z]+)'(?:, line ([0-9]+))?", re.IGNORECASE)  # in Gmsh's messages


def read_copies(
    copies: Mapping[str, Copy],
    assignments: list[tuple[str, str, str]],
    limit: float,
    tolerance: float = 0.0,
    unit: str = "M",
    numbered: bool = False,
) -> dict[str, Any]:
    """Output of Gmsh for copies, of which the first is the drawing or the CAD file. Raises SceneError.

    `limit` is that of processor time, s. An assignment is a name, a text, and the SI unit of a number in it.
    `tolerance` is the largest distance of a chord of a CAD file from its curve; 0 takes it from the size. `unit`, one
    of Open CASCADE's names, is the unit of coordinates and of the tolerance. `numbered` asks for all faces or edges by
    their numbers, in place of the groups of a drawing.
    """
    first = next(iter(copies))
    with scratch() as folder:
        for name, copy in copies.items():
            (folder / name).write_bytes(copy.data)
        job = {
            "path": first,
            "cad": not first.endswith(".geo"),
            "assignments": assignments,
            "tolerance": tolerance,
            "unit": unit,
            "numbered": numbered,
            "walls": WALLS,
        }
        gmsh_output = _run(copies[first].path, job, limit, folder)
    if job["walls"]:
        warn_of_missing(copies[first].path, gmsh_output["walls"])

    def original(match: re.Match[str]) -> str:
        """The user's file name and line."""
        copy, line = copies.get(match[1]), int(match[2] or 0)
        if copy is None:
            return match[0]
        has_origin = 0 < line <= len(copy.origins)
        return f"'{copy.path}'" + (f", line {copy.origins[line - 1] if has_origin else line}" if line else "")

    gmsh_output["messages"] = [PLACE.sub(original, message).replace(OWN, "") for message in gmsh_output["messages"]]
    return gmsh_output


def read_trusted(path: Path, assignments: list[tuple[str, str, str]], limit: float) -> dict[str, Any]:
    """Output of Gmsh for a trusted drawing, read in place and without confinement. Raises SceneError."""
    job = {"path": str(path.resolve()), "cad": False, "assignments": assignments, "tolerance": 0.0, "unit": "M"}
    job["walls"] = False
    return _run(path, job, limit, None)


def _run(path: Path, job: dict[str, Any], limit: float, folder: Path | None) -> dict[str, Any]:
    """Output of the Gmsh reader for a job, with a mesh where other triangles do not fit. Raises SceneError."""
    gmsh_output = _read(path, job | {"conforming": False}, limit, folder)
    if not gmsh_output.get("points") or gmsh_output["messages"]:
        return gmsh_output
    if not closes(gmsh_output):
        gmsh_output = _read(path, job | {"conforming": True}, limit, folder)
    elif not fits(gmsh_output):
        try:
            gmsh_output = _read(path, job | {"conforming": True}, min(limit, MESH_TIME), folder)
        except SceneError:  # no mesh: its triangles tell the volume of each body that Gmsh has wrong
            gmsh_output = with_own_volumes(gmsh_output)
    return gmsh_output


def _read(path: Path, job: dict[str, Any], limit: float, folder: Path | None) -> dict[str, Any]:
    with scratch() as aside:
        result = aside / "found.json"
        job |= {"chords": CHORD_TOLERANCE}
        last = run_reader("pdmesh.drawing.sandbox.gmsh_reader", "Gmsh", path, job, result, limit, folder)
        try:
            gmsh_output: dict[str, Any] = json.loads(result.read_bytes())
        except (OSError, ValueError):
            raise SceneError(f"{path}: Gmsh stopped before the end of the drawing: {last}") from None
    if gmsh_output["missing"]:
        raise SceneError(
            f"Gmsh is not installed: Python finds no module '{gmsh_output['missing']}'; this installs it:"
            " pip install gmsh"
        )
    if gmsh_output["library"]:
        raise SceneError(
            f"Gmsh cannot be loaded: {gmsh_output['library']}; on Debian and Ubuntu this installs what it needs:"
            f" apt-get install {SYSTEM_LIBRARIES}"
        )
    return gmsh_output


def run_reader(
    module: str,
    name: str,
    path: Path,
    job: Mapping[str, Any],
    result: Path,
    limit: float,
    folder: Path | None,
    remedy: str = "simplify the shapes, or use a larger spacing",
) -> str:
    """Run a module that reads a job as JSON from stdin and writes `result`; returns the end of its output.

    It runs in `folder` and may compute for `limit` seconds. Raises SceneError, naming `path`, what it last did and the
    `remedy`, if it takes longer.
    """
    said = result.with_name("said")
    command = [sys.executable, "-P", "-m", module, str(result)]
    try:
        with said.open("wb") as stderr:
            ended = subprocess.run(
                command,
                input=json.dumps({**job, "seconds": limit}).encode(),
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                timeout=PATIENCE * limit,
                check=False,
                cwd=folder,
                env=trust.environment() | ONE_THREAD,
            ).returncode
    except subprocess.TimeoutExpired:
        raise SceneError(
            f"{path}: {name} was still {_stage(said)} after waiting for {PATIENCE * limit:g} s and was stopped;"
            f" {remedy}"
        ) from None
    if OUT_OF_TIME is not None and ended == -OUT_OF_TIME:
        raise SceneError(f"{path}: {name} was still {_stage(said)} after {limit:g} s of processor time; {remedy}")
    text = said.read_bytes()[-4000:].decode(errors="replace").strip()
    lines = [line for line in text.splitlines() if not line.startswith(STAGE)]
    return lines[-1] if lines else f"it {how_it_ended(ended)} while {_stage(said)}"


def _stage(said: Path) -> str:
    """What a reader said last that it does."""
    lines = said.read_bytes().decode(errors="replace").splitlines()
    return next((line.removeprefix(STAGE) for line in reversed(lines) if line.startswith(STAGE)), "reading")
