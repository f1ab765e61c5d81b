"""A variable that can make a library load code is used only where it leads to what the user alone decides."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hostile_variables import FORGERIES, FORMS, VARIABLES, Variable

from pdmesh import trust
from pdmesh.drawing.sandbox import child, gmsh_reader
from pdmesh.environment_variables import LIBRARIES, is_safe_place, library_of, safe_variables
from pdsolve.device import runtime
from pdsolve.numerics import team

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders have no modes there")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_library_has_a_hostile_variable() -> None:
    assert {library_of(one.name) for one in VARIABLES} == set(LIBRARIES)


@pytest.mark.parametrize(("variable", "form"), FORGERIES, ids=lambda one: getattr(one, "name", one))
def test_no_value_leads_to_others(variable: Variable, form: str, here: Path, tmp_path: Path) -> None:
    """Neither to the current folder nor to a place that other users may write to."""
    value = FORMS[form](variable, here, tmp_path)
    used, dropped = safe_variables({variable.name: value})
    entries = used.get(variable.name, "").replace(" ", os.pathsep).split(os.pathsep)
    assert set(entries) <= {"", str(tmp_path / "own")}, (value, used)
    assert dropped == ([] if form in ("empty", "an empty entry") else [variable.name])


@pytest.mark.skipif(not hasattr(os, "getgroups"), reason="groups of POSIX")
def test_what_a_group_may_write_to_is_not_used(tmp_path: Path) -> None:
    """But where the administrator owns it, or the group is the user's own."""
    place = tmp_path / "group"
    place.mkdir()
    os.chown(place, 1234 if os.getuid() == 0 else -1, -1)
    place.chmod(0o775)
    assert is_safe_place(str(place), "HDF5_PLUGIN_PATH") == (os.getuid() != 0)  # of another user, or of one's own group
    assert is_safe_place(str(place), "LD_LIBRARY_PATH")


@pytest.mark.skipif(getattr(os, "getuid", int)() != 0, reason="only the administrator gives files away")
@pytest.mark.parametrize(("group", "is_safe"), [(4321, True), (100, False)], ids=["private", "shared"])
def test_a_first_group_is_trusted_if_it_is_private(
    group: int, is_safe: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others may be in a user's first group, as in `users` or `staff`."""
    os.chown(tmp_path, 4321, group)
    tmp_path.chmod(0o775)
    monkeypatch.setattr(os, "getuid", lambda: 4321)
    monkeypatch.setattr(os, "getgid", lambda: group)
    assert is_safe_place(str(tmp_path), "HDF5_PLUGIN_PATH") is is_safe


def test_the_home_of_the_user_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pwd = pytest.importorskip("pwd")
    tmp_path.chmod(0o777)
    assert not is_safe_place(str(tmp_path), "HOME")
    monkeypatch.setattr(pwd, "getpwuid", lambda _: pwd.struct_passwd(["me", "", 0, 0, "", str(tmp_path), ""]))
    assert is_safe_place(str(tmp_path), "HOME")


def test_links_without_an_end_are_not_used(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert not is_safe_place(str(tmp_path / "loop"), "HDF5_PLUGIN_PATH")


def test_compiled_modules_of_others_are_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python has read the variable before the first line of a command."""
    monkeypatch.setattr(trust, "dropped", [])
    for name in ("path", "meta_path"):
        monkeypatch.setattr(sys, name, list(getattr(sys, name)))
    tmp_path.chmod(0o777)
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path))
    with monkeypatch.context() as variables:
        variables.setenv("PYTHONPYCACHEPREFIX", str(tmp_path))
        trust.settle()
    assert sys.pycache_prefix is None


@pytest.mark.parametrize("variable", VARIABLES, ids=lambda one: one.name)
def test_a_place_of_ones_own_stays(variable: Variable, here: Path, tmp_path: Path) -> None:
    given = {variable.name: str(tmp_path / "own"), "SOME_PROGRAM": "relative/path"}
    assert safe_variables(given) == (given, [])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("OMP_NUM_THREADS", "2"), ("OMP_PROC_BIND", "close"), ("MPLBACKEND", "agg"), ("NUMBA_CPU_NAME", "generic"),
        ("POCL_DEVICES", "cpu"), ("PYTHONWARNINGS", "error"), ("QT_QPA_PLATFORM", "offscreen"),
        ("XDG_CURRENT_DESKTOP", "ubuntu:GNOME"), ("PMIX_SERVER_URI2", "prte-a-1@0.0;tcp4://127.0.0.1:3"),
        ("OMPI_COMM_WORLD_RANK", "0"), ("MPI4PY_LIBMPI", "libmpi.so.12"), ("HDF5_USE_FILE_LOCKING", "FALSE"),
        ("HWLOC_PLUGINS_PATH", "/dev/null"), ("GTK_THEME", "Adwaita:dark"), ("PATHEXT", "x"), ("HOMEBREW_PREFIX", "x"),
    ],
)  # fmt: skip
def test_words_and_numbers_stay(name: str, value: str, here: Path) -> None:
    assert safe_variables({name: value}) == ({name: value}, [])


def test_they_are_removed_from_the_process_of_a_command(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trust, "dropped", [])
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    for name in ("OCL_ICD_VENDORS", "HDF5_PLUGIN_PATH"):
        monkeypatch.setenv(name, "vendors")
    with trust.child_environment():
        trust.settle()
        assert not {"OCL_ICD_VENDORS", "HDF5_PLUGIN_PATH"} & os.environ.keys()
        assert {"OCL_ICD_VENDORS", "HDF5_PLUGIN_PATH"} & set(trust.dropped) == set()  # already gone for a child
    trust.settle()
    assert {"OCL_ICD_VENDORS", "HDF5_PLUGIN_PATH"} <= set(trust.dropped)
    assert "OCL_ICD_VENDORS" in trust.describe_dropped(trust.dropped)


def test_a_library_may_be_settled_alone(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCL_ICD_VENDORS", "vendors")
    monkeypatch.setenv("HDF5_PLUGIN_PATH", "vendors")
    assert trust.settle_variables("OpenCL loader") == ["OCL_ICD_VENDORS"]
    assert os.environ["HDF5_PLUGIN_PATH"] == "vendors"


def test_the_page_names_every_library() -> None:
    page = (trust.HOME / "docs" / "reference" / "security.md").read_text("utf-8")
    for library in LIBRARIES:
        row = f"| {library.name} | {', '.join(f'`{name}`' for name in library.prefixes)} | {library.loads} |"
        assert row in page


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("POCL_EXTRA_BUILD_FLAGS", "-fplugin=./evil.so"), ("OMPI_MCA_plm_rsh_agent", "sh ./evil.so"),
        ("KMP_X", "x=evil.so"), ("LLVM_X", "-load /tmp/evil.so"),
        ("POCL_X", "/none -fplugin=./evil.so"), ("VK_LOADER_X", "a.json,evil.so"), ("OMPI_MCA_x", "a;evil.so"),
    ],
)  # fmt: skip
def test_no_word_of_a_value_names_what_is_here(name: str, value: str, here: Path) -> None:
    Path("evil.so").touch()
    assert safe_variables({name: value}) == ({}, [name])


@pytest.mark.parametrize("name", ["PETSC_OPTIONS", "PETSC_OPTIONS_YAML"])
def test_options_of_petsc_are_never_used(name: str, here: Path) -> None:
    """They may name a library in any place of a line, behind one that looks like an absolute path."""
    for value in ("-dll_prepend ./libevil.so", "/none -dll_prepend ./libevil.so", "-options_file x"):
        assert safe_variables({name: value}) == ({}, [])


def test_gmsh_starts_outside_the_current_folder(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PETSc, a part of it, runs a library that a file .petscrc there names, also where a drawing is trusted."""
    folders: list[Path] = []
    fake = SimpleNamespace(initialize=lambda **_: folders.append(Path.cwd()))
    monkeypatch.setitem(sys.modules, "gmsh", fake)
    with pytest.raises(AttributeError):  # of its options
        gmsh_reader._read({}, io.StringIO())
    assert folders == [Path(gmsh_reader.__file__).parent]
    assert Path.cwd() == here


def test_devices_and_ranks_are_safe_in_a_process_that_no_command_prepared(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a notebook, where a model alone may choose a device."""
    names = ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH", "OPENCL_LAYERS", "MPI4PY_LIBMPI")
    for name in (*names, "POCL_CACHE_DIR", "PYOPENCL_CACHE_DIR"):
        monkeypatch.setenv(name, "./vendors")
    monkeypatch.setenv("PYOPENCL_NO_CACHE", "1")
    monkeypatch.setenv("PMI_RANK", "0")
    world = SimpleNamespace(Get_size=lambda: 1)
    monkeypatch.setitem(sys.modules, "pyopencl", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "mpi4py", SimpleNamespace(MPI=SimpleNamespace(COMM_WORLD=world)))
    runtime._library.__wrapped__()
    assert Path(os.environ["POCL_CACHE_DIR"]) == trust.private_folder().path / "pocl"
    assert team.team() is None
    assert not {*names, "PYOPENCL_CACHE_DIR"} & os.environ.keys()


def test_a_reader_of_meshes_gets_no_such_variable(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor where no command has prepared the process: h5py would load filters from the current folder."""
    environments: list[dict[str, str]] = []

    def run(*_: object, env: dict[str, str], **__: object) -> SimpleNamespace:
        environments.append(env)
        return SimpleNamespace(returncode=0)

    monkeypatch.setenv("HDF5_PLUGIN_PATH", "vendors")
    monkeypatch.setattr(child.subprocess, "run", run)
    child.run_reader("reader", "h5py", Path("a.med"), {}, here / "result.json", 1.0, None)
    (environment,) = environments
    assert "HDF5_PLUGIN_PATH" not in environment
    assert environment["PATH"] == trust.environment()["PATH"]
