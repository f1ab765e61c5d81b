"""Recognizes a file by its name and first bytes, and names the command for it."""

from __future__ import annotations

import shlex
from enum import Enum
from pathlib import Path

from pdmesh.files import irregular

CAD = (".step", ".stp", ".brep", ".brp")  # shapes only, nothing that runs
MESHES = (
    ".msh",
    ".inp",
    ".vtu",
    ".vtk",
    ".xdmf",
    ".mesh",
    ".e",
    ".exo",
    ".ex2",
    ".g",
    ".gen",
    ".med",
    ".bdf",
    ".nas",
    ".unv",
    ".ply",
    ".off",
    ".stl",
    ".txt",  # x, y, z, block and volume of points
)
OF_PROGRAMS = (  # suffixes of CAD programs, which can save STEP files too
    *(".3dm", ".3mf", ".blend", ".catpart", ".dwg", ".dxf", ".f3d", ".fcstd", ".iam", ".iges", ".igs", ".ipt", ".obj"),
    *(".par", ".prt", ".sat", ".skp", ".sldasm", ".sldprt", ".svg", ".x_b", ".x_t"),
)
SAVE_AS_STEP = "save the part as STEP in the program that drew it"
DATABASE = b"SQLite format 3\0"


class FileKind(Enum):
    """A kind of file, with its name in messages."""

    DRAWING = "a drawing"
    MODEL = "a model in JSON"
    RESULTS = "a database of results"
    STUDY = "a study in TOML"


TAKEN = {  # by which command
    FileKind.DRAWING: "`pdmesh build {path}` makes a model of it, which pdsolve solves",
    FileKind.MODEL: "`pdsolve {path}` solves it",
    FileKind.RESULTS: "`pdpost report {path}` shows what is in it, `pdsolve --resume {path}` goes on with a run",
    FileKind.STUDY: "`pdsolve study {path}` solves it, `pdsolve fit {path}` fits its parameters",
}


def kind_of(path: Path) -> FileKind | None:
    """The kind of the file at `path`; None if neither name nor content tells. Raises OSError."""
    with path.open("rb") as file:
        head = file.read(64)
    if head.startswith(DATABASE):
        return FileKind.RESULTS
    suffix = path.suffix.lower()
    if suffix == ".json" or head.lstrip().startswith(b"{"):
        return FileKind.MODEL
    if suffix == ".toml":
        return FileKind.STUDY
    return FileKind.DRAWING if suffix in (".geo", ".py", *CAD, *MESHES) else None


def mistaken(path: Path, *expected: FileKind) -> str | None:
    """Message for a file that is surely of a kind not in `expected`; None if it may be one of them."""
    wanted = " or ".join(kind.value for kind in expected)
    try:
        if path.is_dir():
            return f"{path} is a folder; name {wanted}"
        kind = None if irregular(path) else kind_of(path)
    except OSError:
        return None  # whoever reads it says why it cannot be read
    if kind is None or kind in expected:
        return None
    named = shlex.quote(str(path)) + " --trust" * (kind is FileKind.DRAWING and path.suffix.lower() == ".py")
    return f"{path} is {kind.value}, and {wanted} is needed; {TAKEN[kind].format(path=named)}"
