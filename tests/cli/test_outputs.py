"""What the three programs write to: files, through links; pipes and devices are neither written to nor replaced."""

from __future__ import annotations

import os
import shutil
import stat
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from messages import mentions, naming

import pdmesh.__main__
import pdpost.__main__
import pdsolve.__main__
from pdmesh import commandline
from pdmesh.files import irregular, replacing, write_atomically
from pdsolve.model import Model
from pdsolve.results import Results, WriteError, Writer
from pdsolve.run.simulation import simulate

resource = pytest.importorskip("resource")  # not on Windows
MAIN: dict[str, Callable[[list[str]], int]] = {
    "pdmesh": pdmesh.__main__.main,
    "pdsolve": pdsolve.__main__.main,
    "pdpost": pdpost.__main__.main,
}
SCENE = """
from pdmesh import Material, Scene, box
scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=65e9, rho=2235, G0=204)).fix("bottom")
"""
COMMANDS = {  # what is written to: who writes
    "grid.json": ["pdmesh", "build", "scene.py", "--trust"],
    "info.json": ["pdmesh", "info", "scene.py", "--trust"],
    "schema.json": ["pdmesh", "schema"],
    "plan.json": ["pdmesh", "plan", "scene.py", "--trust"],
    "params.json": ["pdmesh", "params", "scene.py", "--trust"],
    "preview.png": ["pdmesh", "preview", "scene.py", "--trust"],
    "new.sqlite": ["pdsolve", "plate.json"],
    "picture.svg": ["pdpost", "damage", "small.sqlite"],
    "bonds.pdf": ["pdpost", "bonds", "small.sqlite"],
    "film.gif": ["pdpost", "animate", "small.sqlite", "--stride", "2"],
    "crack.png": ["pdpost", "crack", "small.sqlite"],
    "report.html": ["pdpost", "report", "small.sqlite"],
    "page.html": ["pdpost", "view", "small.sqlite"],
    "frame.vtu": ["pdpost", "export", "small.sqlite"],
    "frame.csv": ["pdpost", "export", "small.sqlite"],
    "frames.pvd": ["pdpost", "export", "small.sqlite"],
    "frames.xdmf": ["pdpost", "export", "small.sqlite"],
}
FEW = ("grid.json", "new.sqlite", "picture.svg", "frame.vtu")  # one for each way of writing
SERIES = ("frames.pvd", "frames.xdmf")


@pytest.fixture
def there(here: Path, small_plate: Model, small_results: Path) -> Path:
    """A folder with something to read for everyone."""
    (here / "scene.py").write_text(SCENE)
    (here / "plate.json").write_text(small_plate.to_json())
    assert (here / "small.sqlite") == small_results
    return here


def made(here: Path) -> set[str]:
    """What is in the folder but for what was there."""
    return {path.name for path in here.iterdir()} - {"scene.py", "plate.json", "small.sqlite", "__pycache__"}


def run(name: str, *more: str) -> int:
    """Let the program of this name write to it, over what is there."""
    program, *words = COMMANDS[Path(name).name]
    quiet = [] if words == ["schema"] else ["-q"]
    return MAIN[program]([*words, "-o", name, "--force", *quiet, *more])


def pipe(path: Path) -> None:
    os.mkfifo(path)


def device(path: Path) -> None:
    """A node of its own for the device that forgets what is written to it."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except (OSError, AttributeError) as error:
        pytest.skip(f"no device can be made here: {error}")


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(("make", "kind"), [(pipe, "a pipe"), (device, "a device")])
@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_no_file_is_neither_written_to_nor_replaced(
    there: Path, capsys: pytest.CaptureFixture[str], name: str, make: Callable[[Path], None], kind: str
) -> None:
    """Nor where a link leads to it, even by force."""
    make(there / name)
    before = (there / name).lstat()
    (there / "links").mkdir()
    (there / "links" / name).symlink_to(f"../{name}")
    for path in (name, f"links/{name}"):
        assert run(path) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert mentions(err, path, found=kind, expected="regular file")
    after = (there / name).lstat()
    assert (after.st_mode, after.st_rdev, after.st_ino) == (before.st_mode, before.st_rdev, before.st_ino)
    assert made(there) == {name, "links"}
    assert (there / "links" / name).is_symlink()


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_links_are_followed(there: Path, name: str) -> None:
    """A link that leads nowhere yet leads to the file then; the second time to the same one."""
    (there / "far").mkdir()
    (there / name).symlink_to(f"far/{name}")
    for _ in range(2):
        assert run(name) == 0
        assert os.readlink(there / name) == f"far/{name}"
        assert (there / "far" / name).stat().st_size > 0
        assert [path.name for path in (there / "far").iterdir()] == [name]


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", FEW)
def test_a_link_into_no_folder_is_said(there: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    (there / name).symlink_to(f"gone/{name}")
    assert run(name) == 1
    err = capsys.readouterr().err
    assert (err.count("\n"), f": {name}: " in err, "No such file or directory" in err) == (1, True, True)
    assert made(there) == {name}


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", FEW)
def test_links_in_a_ring_are_said(there: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    (there / name).symlink_to(name)
    assert run(name) == 2
    err = capsys.readouterr().err
    assert (err.count("\n"), f": {name}: Too many levels of symbolic links" in err) == (1, True)


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ("scene.json", ["pdmesh", "build", "scene.py", "--trust"]),
        ("plate.sqlite", ["pdsolve", "plate.json"]),
        ("small.damage.png", ["pdpost", "damage", "small.sqlite"]),
        ("small.pvd", ["pdpost", "export", "small.sqlite"]),
        ("all", ["pdpost", "export", "small.sqlite", "-o", "all.pvd"]),
        ("all/all_00000020.vtu", ["pdpost", "export", "small.sqlite", "-o", "all.pvd"]),
        ("all.bin", ["pdpost", "export", "small.sqlite", "-o", "all.xdmf"]),
        ("x.tradeoff.json", ["pdpost", "tradeoff", "small.sqlite", "--reference", "small.sqlite", "-o", "x.png"]),
    ],
)
@pytest.mark.parametrize("dangling", [False, True])
def test_a_link_that_nobody_named_is_not_followed(
    there: Path, capsys: pytest.CaptureFixture[str], link: str, words: list[str], dangling: bool
) -> None:
    """By default, and for what is written beside the output; nothing is written before it is met."""
    far = there / "far"
    far.mkdir()
    (there / link).parent.mkdir(exist_ok=True)
    (there / link).symlink_to(far / "mine")
    if not dangling:
        (far / "mine").write_text("mine")
    before = {path: path.lstat().st_mtime_ns for path in there.rglob("*")}
    assert MAIN[words[0]]([*words[1:], "--force", "-q"]) == 2
    err = capsys.readouterr().err
    assert mentions(err, link, found="link")
    assert err.count("\n") == 1
    assert {path: path.lstat().st_mtime_ns for path in there.rglob("*") if "__pycache__" not in str(path)} == before


@contextmanager
def full_disk(room: int = 4096) -> Iterator[None]:
    """Files may not grow beyond `room` bytes, which is the nearest thing to a full disk that needs no disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FEW, *SERIES])
def test_a_full_disk_names_what_was_to_be_written(there: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """And leaves what was there as it was."""
    assert run(name) == 0  # all that is kept for later, such as what is compiled, is kept
    for path in there.iterdir():
        if path.name in made(there):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    if name != "new.sqlite":
        (there / name).write_text("precious")
    with full_disk():
        assert run(name) == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    other = {"frames.pvd": ".vtu: ", "frames.xdmf": ": frames.bin: "}  # one of the other files of a series
    assert f": {name}: " in err or other[name] in err
    if name == "new.sqlite":
        assert made(there) == set()
    else:
        assert (there / name).read_text() == "precious"
        assert made(there) == ({name, "frames"} if name == "frames.pvd" else {name})


def test_two_outputs_are_two_files() -> None:
    commandline.expect_other_outputs(Namespace(surface=Path("x.vtp"), csv="-", output=None))
    with pytest.raises(commandline.UsageError, match=r"x\.vtp"):
        commandline.expect_other_outputs(Namespace(surface=Path("x.vtp"), csv="./x.vtp"))


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("pdsolve plate.json --settings set.toml -o set.toml", "set.toml"),
        ("pdsolve model.sqlite", "model.sqlite"),
        ("pdmesh info plate.json -o plate.json", "plate.json"),
        ("pdmesh params scene.py --trust -o ./scene.py", "scene.py"),
        ("pdmesh build scene.py --trust -o scene.py", "scene.py"),
        ("pdpost fatigue small.sqlite --beside other.sqlite --csv other.sqlite", "other.sqlite"),
        ("pdpost crack small.sqlite --compare other.sqlite --csv other.sqlite", "other.sqlite"),
        ("pdpost crack small.sqlite --surface small.sqlite", "small.sqlite"),
        ("pdpost tradeoff small.sqlite other.sqlite --reference small.sqlite --csv other.sqlite", "other.sqlite"),
    ],
)
def test_nothing_is_written_over_an_input(
    there: Path, capsys: pytest.CaptureFixture[str], words: str, read: str
) -> None:
    """By any option, also by a second input of the command, and by the default name."""
    (there / "set.toml").write_text("[run]\nsteps = 3\n")
    shutil.copy("small.sqlite", "other.sqlite")
    shutil.copy("plate.json", "model.sqlite")
    before = Path(read).read_bytes()
    program, *rest = words.split()
    assert MAIN[program]([*rest, "--force"]) == 2
    assert mentions(capsys.readouterr().err, read)
    assert Path(read).read_bytes() == before


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", FEW)
def test_long_names(there: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """Those of 250 letters are written, but for databases, beside which SQLite has longer ones; others are refused."""
    suffix = Path(name).suffix
    for letters, code in ((250, 2 if suffix == ".sqlite" else 0), (300, 2)):
        long = "x" * (letters - len(suffix)) + suffix
        assert run(name, "-o", long) == code
        assert made(there) == ({long} if code == 0 else set())
        if code == 0:
            (there / long).unlink()
        else:
            err = capsys.readouterr().err
            assert ("File name too long" in err, err.count("\n")) == (True, 1)


def test_the_library_refuses_the_same(tmp_path: Path, small_plate: Model) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert irregular(tmp_path / "pipe") == "a pipe"
    assert irregular(tmp_path) == "a folder"
    assert irregular(tmp_path / "none") is None
    with pytest.raises(OSError, match=naming(found="pipe", expected="regular file")) as error:
        write_atomically(tmp_path / "pipe", b"")
    assert error.value.filename == str(tmp_path / "pipe")
    with pytest.raises(WriteError, match=naming("pipe", found="pipe", expected=("database", "nothing"))):
        simulate(small_plate, tmp_path / "pipe")
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]
    assert (tmp_path / "pipe").is_fifo()


def test_another_error_keeps_its_name(tmp_path: Path) -> None:
    """Such as that of a file which is read while another is written."""
    with pytest.raises(FileNotFoundError) as error, replacing(tmp_path / "new"):
        (tmp_path / "other").read_text()
    assert error.value.filename == str(tmp_path / "other")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_while_a_run_writes(
    there: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line, and a run that can be gone on with once there is room."""
    write = Writer.write

    def filling(writer: Writer, frame: object) -> None:
        if getattr(frame, "step", 0) < 40:
            write(writer, frame)  # type: ignore[arg-type]
            return
        with full_disk(Path("new.sqlite-wal").stat().st_size + 4096):
            write(writer, frame)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Writer, "write", filling)
        assert run("new.sqlite") == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("pdsolve: new.sqlite: ")
    with Results.open(Path("new.sqlite")) as results:
        assert results.frames()[0].tolist() == [0, 20]
    assert MAIN["pdsolve"](["--resume", "new.sqlite", "-q"]) == 0
    with Results.open(Path("new.sqlite")) as results:
        assert results.frames()[0].tolist() == [0, 20, 40, 60]
