"""Copies of a drawing's files for Gmsh, checked and written anew into an empty folder.

The folder holds nothing else that Gmsh could pick up, such as the ``plate.geo.opt`` that it reads with any
``plate.geo``. Gmsh reads exactly the checked text, even if the originals change meanwhile.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pdmesh.drawing.sandbox.mesh_sizes import unused
from pdmesh.drawing.sandbox.scan import Drawing, admitted, names, readings
from pdmesh.drawing.sandbox.skipped import without_skipped
from pdmesh.drawing.sandbox.tokens import MOST_TOKENS, Refused, Token, decoded, tokens_of, written
from pdmesh.files import read_bytes
from pdmesh.scene.shapes import SceneError

LARGEST, LARGEST_DRAWING = 2**26, 2**24  # bytes of a CAD file; of a drawing, with all drawings that it reads
# by suffix, in the cases in which Gmsh knows it (it takes a suffix that it does not know for a script's)
STEP, BREP = (".step", ".stp", ".STEP", ".STP"), (".brep", ".brp", ".BRP")
STL = (".stl", ".STL")
CAD = (*STEP, *BREP)
MERGED = (*CAD, *STL)  # by a drawing
NOT_INCLUDED = {suffix.lower() for suffix in MERGED}
ADVICE = " (--trust reads it all the same)"
OWN_FOLDER = "use a .geo, STEP, BREP or STL file in the drawing's own folder" + ADVICE
CONTENT = {  # how a file begins, and ends: in one that is cut off, a reader may look for the end for ever
    "STEP": (re.compile(rb"\s*ISO-10303-21\s*;"), re.compile(rb"END-ISO-10303-21\s*;\s*$")),
    "BREP": (  # the last shape, and what Draw adds to it
        re.compile(rb"(?:DBRep_DrawableShape)?\s*CASCADE Topology V"),
        re.compile(rb"\n[+-]\d+ \d+\s*(?:\n\s*\d+\s*)?$"),
    ),
}
STL_HEAD, STL_TRIANGLE = 84, 50  # bytes of a binary STL file
STL_TEXT = re.compile(rb"\s*solid\b[^\0]*\bendsolid\b[^\n]*\s*")
NO_NUMBER = re.compile(rb"[(,\s][-+]?(?:nan|inf(?:inity)?)(?=[(),\s])", re.IGNORECASE)
ASIDE = re.compile(rb"'[^']*'|/\*.*?\*/", re.DOTALL)  # strings and comments of a STEP file


@dataclass(frozen=True)
class Copy:
    """A file for Gmsh to read, under a new name."""

    path: Path  # the original
    data: bytes
    origins: Sequence[int] = ()  # of a drawing: the line of the original that each of its lines comes from
    unused: Mapping[str, int] = field(default_factory=dict)  # what it says of a mesh, and on which line first
    skipped: Mapping[str, int] = field(default_factory=dict)  # what Gmsh does not read of it, likewise


def drawing_bytes(path: Path, largest: int = LARGEST_DRAWING) -> bytes:
    """Bytes of a .geo file, at most `largest`. Raises SceneError for a file that cannot be a drawing."""
    try:
        data = read_bytes(path, largest)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    if b"\0" in data:
        raise SceneError(f"{path} has a zero byte, so it is no text; use a Gmsh .geo script")
    if not data.endswith((b"\n", b"\r")):
        raise SceneError(f"{path}: last line has no line end; add one (Gmsh drops the statement silently)")
    return data


def cad_bytes(path: Path) -> bytes:
    """Bytes of a STEP or BREP file. Raises SceneError if its content does not match its suffix."""
    try:
        data = read_bytes(path, LARGEST)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    kind = "STEP" if path.suffix.lower() in STEP else "BREP"
    begins, ends = CONTENT[kind]
    if not begins.match(data):
        raise SceneError(f"{path} has another content than its suffix says; use a {kind} file")
    if not ends.search(data[-200:]):
        raise SceneError(f"{path}: the shapes have no end; use a whole {kind} file")
    plain = ASIDE.sub(lambda match: b"''" + b"\n" * match[0].count(b"\n"), data) if kind == "STEP" else data
    wrong = NO_NUMBER.search(plain)
    if wrong:
        line = plain.count(b"\n", 0, wrong.end()) + 1
        bad_number = wrong[0][1:].decode()
        raise SceneError(f"{path}: line {line}: '{bad_number}' is not a number; use a finite number")
    return data


def stl_bytes(path: Path) -> bytes:
    """Bytes of an STL file, of letters or binary. Raises SceneError if it is neither, cut off, or not finite."""
    try:
        data = read_bytes(path, LARGEST)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    count = int.from_bytes(data[80:84], "little")
    if count and len(data) == STL_HEAD + STL_TRIANGLE * count:
        rows = np.frombuffer(data, np.dtype([("numbers", "<f4", 12), ("about", "<u2")]), count, STL_HEAD)
        finite = bool(np.isfinite(rows["numbers"]).all())
    elif STL_TEXT.fullmatch(data):
        finite = NO_NUMBER.search(data) is None
    else:
        raise SceneError(f"{path} has another content or no end; use a whole STL file")
    if not finite:
        raise SceneError(f"{path} has a number that is not finite; use finite ones")
    return data


def cad_copy(path: Path) -> dict[str, Copy]:
    """The copy of a STEP or BREP file, under a name with a suffix that Gmsh knows. Raises SceneError."""
    return {f"0{path.suffix.lower()}": Copy(path, cad_bytes(path))}


def drawing_copies(path: Path) -> dict[str, Copy]:
    """Copies of a drawing and of all files it reads, by their new names; the drawing is the first.

    Raises SceneError naming file, line, what was found and what was expected.
    """
    reader = _Copies(path)
    drawing_names = set().union(*(names(drawing) for _, drawing in reader.drawings.values()))
    for name, (drawing_path, drawing) in reader.drawings.items():
        try:
            data, origins = written(admitted(drawing, drawing_names))
        except Refused as error:
            raise _refused(drawing_path, error) from None
        reader.copies[name] = Copy(drawing_path, data, origins, unused(drawing), reader.skipped[name])
    return dict(sorted(reader.copies.items(), key=lambda item: item[0] != "0.geo"))


class _Copies:
    def __init__(self, path: Path) -> None:
        self.folder = path.parent.resolve()
        self.drawings: dict[str, tuple[Path, Drawing]] = {}  # by the names of their copies
        self.copies: dict[str, Copy] = {}
        self.skipped: dict[str, dict[str, int]] = {}  # by the same names
        self.named: dict[Path, str] = {}
        self.left, self.tokens_left = LARGEST_DRAWING, MOST_TOKENS  # bytes and tokens that may still be read
        self.add(path, ())

    def add(self, path: Path, within: tuple[Path, ...]) -> str:
        """Check a file and all files it reads; returns the name of its copy."""
        real = path.resolve()
        if real in self.named:
            return self.named[real]
        merged = within and path.suffix in MERGED
        name = self.named[real] = f"{len(self.named)}{path.suffix if merged else '.geo'}"
        if merged:
            self.copies[name] = Copy(path, stl_bytes(path) if path.suffix in STL else cad_bytes(path))
            return name
        try:
            data = drawing_bytes(path, self.left)
            self.left -= len(data)
            drawing = Drawing(tokens_of(decoded(data), self.tokens_left))
            self.tokens_left -= len(drawing.tokens)
            remaining_tokens, self.skipped[name] = without_skipped(drawing)
            drawing = Drawing(remaining_tokens)
            file_readings = readings(drawing)
        except Refused as error:
            raise _refused(path, error) from None
        tokens = list(drawing.tokens)
        for reading in file_readings:
            token = tokens[reading.place]
            included_path = self._beside(path, token, reading.command)
            if included_path.resolve() in (*within, real):
                raise SceneError(
                    f"{path}: line {token.line}: {token.text} leads back to the file itself; read a file that does"
                    " not read itself"
                )
            tokens[reading.place] = token._replace(text=f'"{self.add(included_path, (*within, real))}"')
        drawing.tokens = tokens
        self.drawings[name] = path, drawing
        return name

    def _beside(self, path: Path, token: Token, command: str) -> Path:
        """Path of a file that a drawing reads.

        Raises SceneError unless it is in the drawing's folder and of a known kind.
        """
        inner = token.content
        plain = (
            re.fullmatch(r"[^\\:*?\"<>|\n\r]+", inner)
            and not Path(inner).is_absolute()
            and ".." not in Path(inner).parts
        )
        included_path = path.parent / inner  # as Gmsh has it, symbolic links or not
        expected = OWN_FOLDER
        if command == "Include":  # of drawings, whatever their suffix
            is_known_kind = included_path.suffix.lower() not in NOT_INCLUDED
        else:
            is_known_kind = included_path.suffix in (CAD if command == "ShapeFromFile" else (".geo", *MERGED))
        if plain and is_known_kind:
            if included_path.is_file() and included_path.resolve().is_relative_to(self.folder):
                return included_path
            expected = OWN_FOLDER if included_path.exists() else "use a file of this name in the drawing's own folder"
        shown = f"{command}({token.text})" if command == "ShapeFromFile" else f"{command} {token.text}"
        raise SceneError(f"{path}: line {token.line}: '{shown}' cannot be read; {expected}")


def _refused(path: Path, error: Refused) -> SceneError:
    return SceneError(f"{path}: {error}{ADVICE if error.trustable else ''}")
