"""Commands hidden in drawings by chance: refused, or never run by Gmsh itself, without walls.

Seeded and bounded: a sample in the slow tests, all of it in those of endurance.
"""

from __future__ import annotations

import itertools
import os
import random
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from plates import GEOMETRIES

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
if not hasattr(os, "fork"):
    pytest.skip("this system has no fork", allow_module_level=True)

from pdmesh.drawing.sandbox.scan import Drawing, admitted, names
from pdmesh.drawing.sandbox.tokens import Refused, decoded, tokens_of, written

WHOLE = ("duran50", "figure_18")  # one for each kernel of Gmsh
DRAWINGS = sorted(GEOMETRIES.glob("*.geo"))
COMMAND = b'SystemCall "touch touched";'
SPLICES = (
    COMMAND,
    b" ;\n" + COMMAND + b"\n",
    b'"; ' + COMMAND + b' a = "',
    b"'; " + COMMAND + b" a = '",
    b"*/ " + COMMAND + b" /*",
    b"\n" + COMMAND + b"//",
    b"// \r /*\n" + COMMAND + b"\n// */\n",
    b"1" + COMMAND,
    b'] } ) ; SystemCall\f"touch touched" ; ',
    b"If(0)\n E\" EndIf SystemCall 'touch touched'; b = \"; EndIf\n",
    b"\nFor i In {0:1} a = \"\nSystemCall 'touch touched'; b = \";\nEndFor\n",
    b"\nMacro M /*\n" + COMMAND + b" */\nReturn\nCall M;\n",
)
HIDDEN = (  # in strings and comments
    *(
        " EndIf ",
        " EndFor ",
        " Return ",
        " Else ",
        "If(0)",
        "For i In {0:1}",
        "Macro N",
        "\n",
        "\n",
        "\r",
        "E",
        "If (",
        ";",
        "\\",
    ),
    *(
        "SystemCall 'touch touched';",
        '\nSystemCall "touch touched";',
        " EndIf SystemCall 'touch touched'; b = 1;",
        "//",
        "/*",
    ),
)
OPEN = """
import os, sys, gmsh
gmsh.initialize(interruptible=False, readConfigFiles=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("General.AbortOnError", 0)  # harder than pdmesh, where the first error is the end
for line in sys.stdin:
    if os.fork():  # as errors, and ends that are not there, would leave Gmsh in the middle of a drawing
        os.wait()
        continue
    try:
        gmsh.open(line.strip())
    finally:
        os._exit(0)
"""


def as_gmsh_reads_it(text: bytes) -> bytes | None:
    """The drawing written anew, or None where it is refused."""
    try:
        drawing = Drawing(tokens_of(decoded(text)))
        return written(admitted(drawing, names(drawing)))[0]
    except Refused:
        return None


def is_silent(text: bytes) -> bool:
    """Whether a drawing is refused, or holds no command once it is written anew."""
    anew = as_gmsh_reads_it(text)
    return anew is None or all(it.kind == "string" or it.text != "SystemCall" for it in tokens_of(anew.decode()))


def harm(texts: Iterable[bytes], folder: Path) -> set[int]:
    """Which drawings, as they stand, make a file ``touched`` when Gmsh opens them, without walls, in `folder`."""
    paths = []
    for number, text in enumerate(texts):
        (folder / str(number)).mkdir(parents=True)
        paths.append(folder / str(number) / "plate.geo")
        paths[-1].write_bytes(text.replace(b"touched", str(folder / str(number) / "touched").encode()))
    lines = "".join(f"{path}\n" for path in paths).encode()
    subprocess.run([sys.executable, "-P", "-c", OPEN], input=lines, cwd=folder, timeout=900, check=True)
    return {number for number, path in enumerate(paths) if path.with_name("touched").exists()}


def places(text: bytes) -> list[int]:
    """Where the tokens of a drawing begin, and its comments."""
    found, place = [], 0
    for token in tokens_of(decoded(text)):
        place = text.index(token.text.encode(), place)
        found.append(place)
        place += len(token.text.encode())
    comments = [place for place in range(len(text)) if text.startswith(b"//", place)]
    return sorted({*found, *(place + 3 for place in comments), len(text)})


def spliced(path: Path, every: int) -> Iterator[bytes]:
    """The drawing with a command at each place, or at each so many; the ways take turns."""
    text = path.read_bytes()
    for place, splice in zip(places(text)[::every], itertools.cycle(SPLICES), strict=False):
        yield text[:place] + splice + text[place:]


@pytest.mark.slow
@pytest.mark.parametrize("path", DRAWINGS, ids=lambda path: path.stem)
def test_a_command_at_tokens(path: Path) -> None:
    assert len(places(path.read_bytes())) > 200
    for text in spliced(path, 1 if path.stem in WHOLE else 7):
        assert is_silent(text), text


@pytest.mark.slow
@pytest.mark.endurance
@pytest.mark.parametrize("path", DRAWINGS, ids=lambda path: path.stem)
def test_every_command_at_every_token(path: Path) -> None:
    text = path.read_bytes()
    for place in places(text):
        for splice in SPLICES:
            assert is_silent(text[:place] + splice + text[place:]), (place, splice)


@pytest.mark.slow
def test_a_sample_goes_through_gmsh(tmp_path: Path) -> None:
    """Those of the spliced drawings that are read at all: commands in strings and comments."""
    texts = [text for path in DRAWINGS for text in spliced(path, 5)]
    anew = [found for text in texts if (found := as_gmsh_reads_it(text))]
    assert len(anew) > 20
    assert harm(random.Random(3).sample(anew, min(len(anew), 100)), tmp_path) == set()


def hidden(chance: random.Random, without: str) -> str:
    text = "".join(chance.choice(HIDDEN) for _ in range(chance.randint(1, 5)))
    return text.replace(without, " ")


def unit(chance: random.Random, depth: int) -> str:
    """A statement, a comment or a block that hangs together, with what is none of that inside."""
    quote = chance.choice("\"'")
    kinds = [
        f"a = {quote}{hidden(chance, quote)}{quote};\n",
        f"{chance.choice('EIFRa')}{quote}{hidden(chance, quote)}{quote};\n",
        f"E {quote}{hidden(chance, quote)}{quote};",
        f"/*{hidden(chance, '*/')}*/",
        f"//{hidden(chance, chr(10))}\n",
        f"Printf({quote}{hidden(chance, quote)}{quote});\n",
        chance.choice(("a = 1;", "b = a/2;\n", "E = 1;\n", "\n", "\r", " ")),
    ]
    if depth:
        inside = "".join(unit(chance, depth - 1) for _ in range(chance.randint(1, 4)))
        kinds += [
            f"If(0){chance.choice(chr(10) + ' ')}{inside}EndIf\n",
            f"If(1)\n{inside}Else {inside}EndIf ",
            f"For i In {{0:1}}{chance.choice(chr(10) + ' ')}{inside}{chance.choice(chr(10) + ' ')}EndFor\n",
            f"Macro M{chance.choice(chr(10) + ' ')}{inside}\nReturn\nCall M;\n",
        ] * 2
    return chance.choice(kinds)


def check_soup(seed: int, count: int, folder: Path) -> None:
    """Drawings of such units: where they are read, what is read runs nothing; as they stand, some do."""
    chance = random.Random(seed)
    texts = [f"E = 1; I = 1; F = 1; R = 1;\n{unit(chance, 3)}{unit(chance, 2)}\n".encode() for _ in range(count)]
    texts = [text for text in texts if b"SystemCall" in text and as_gmsh_reads_it(text)]
    anew = [found for text in texts if (found := as_gmsh_reads_it(text))]
    assert harm(anew, folder / "anew") == set()
    assert len(harm(texts, folder / "originals")) > count / 1000, "Gmsh's other readers should run some"


@pytest.mark.slow
@pytest.mark.parametrize("count", [2000, pytest.param(50_000, marks=pytest.mark.endurance)])
def test_soup(count: int, tmp_path: Path) -> None:
    check_soup(count, count, tmp_path)
