"""Values of place: expressions that are parsed, tables, and files of them from anyone."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from pdmesh.model.values_at_places import MOST_BYTES, over_time, read_table, values_at
from pdmesh.model.values_of_place import PlaceError, Table, wrong_value

PLACES = np.array([[0.0, 0.0], [0.5, 1.0], [1.0, 2.0]])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1e6 * (1 - (y/2)^2)", [1e6, 0.75e6, 0.0]),
        ("-x^2 + y**2", [0.0, 0.75, 3.0]),
        ("where(x > 0.4, sin(pi*x/2), 2)", [2.0, np.sin(np.pi / 4), 1.0]),
        ("max(x, 0.7) + (y >= 1)", [0.7, 1.7, 2.0]),
        ("3", [3.0, 3.0, 3.0]),
    ],
)
def test_expressions_have_the_values_of_their_places(text: str, expected: list[float]) -> None:
    assert wrong_value(text, 2) is None
    assert values_at(text, PLACES) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "x.__class__",
        "[y for y in (1,)]",
        "(lambda: 1)()",
        "exec('1')",
        "x[0]",
        "'a' * 9",
        "sin",
        "x(1)",
        "sin(x, y)",
        "sin(x=1)",
        "x := 1",
        "x if y else 1",
        "1 < x < 2",
        "True",
        "1j",
        "x @ y",
        "f'{x}'",
        "x\x00",
        "x; y",
        "(" * 300 + "x" + ")" * 300,
        "+".join(["x"] * 400),
        "-" * 900 + "x",
        "z",
        "",
    ],
)
def test_what_is_no_expression_of_a_plate_is_refused_in_one_line(text: str) -> None:
    said = wrong_value(text, 2)
    assert said is not None
    assert "; use " in said or "; give " in said
    assert "\n" not in said


@pytest.mark.parametrize("text", ["1/x", "9^9^9^9^9", "log(0*x)", "sqrt(-1-x)", "1e31"])
def test_values_that_are_not_finite_name_the_place(text: str) -> None:
    with pytest.raises(PlaceError, match=r".* at \(0, 0\) m"):
        values_at(text, PLACES)


def test_numbers_that_no_float_holds_are_refused() -> None:
    with pytest.raises(PlaceError, match=r"1\.8e308"):
        values_at("9" * 400, PLACES)


def test_a_table_is_linear_between_its_places_and_constant_across_them() -> None:
    along = Table(((0.0,), (2.0,)), (1.0, 5.0), "y")
    assert values_at(along, PLACES) == pytest.approx([1.0, 3.0, 5.0])
    line = Table(((0.25, 0.0), (0.25, 1.0), (0.25, 2.0)), (0.0, 1.0, 4.0))
    assert values_at(line, PLACES) == pytest.approx([0.0, 1.0, 4.0])
    square = Table(((0.0, 0.0), (1.0, 0.0), (0.0, 2.0), (1.0, 2.0)), (0.0, 1.0, 2.0, 3.0))
    assert values_at(square, PLACES) == pytest.approx([0.0, 1.5, 3.0])  # x + y
    at_nodes = Table(tuple(map(tuple, PLACES.tolist())), (7.0, 8.0, 10.0))
    assert values_at(at_nodes, PLACES).tolist() == [7.0, 8.0, 10.0]


def test_a_table_holds_a_little_beyond_its_border_and_is_refused_farther_away() -> None:
    short = Table(((0.0,), (1.9,)), (0.0, 1.9), "y")
    assert values_at(short, PLACES) == pytest.approx([0.0, 1.0, 1.9])
    with pytest.raises(PlaceError, match=r"\(1, 2\) m is 1\.5 m outside of its table"):
        values_at(Table(((0.0,), (0.5,)), (0.0, 1.0), "y"), PLACES)


def test_csv_files_with_and_without_a_header(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("# measured\ny, ux, uy\n0, 1, 2\n1, 3, 4\n")
    assert read_table("a.csv:uy", tmp_path, 2) == Table(((0.0,), (1.0,)), (2.0, 4.0), "y")
    (tmp_path / "b.csv").write_text("0,0,1\n1,0,2\n")
    assert read_table("b.csv", tmp_path, 2) == Table(((0.0, 0.0), (1.0, 0.0)), (1.0, 2.0), "xy")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "y, ux, uy\n0, 1, 2\n", "the columns y, ux, uy"),
        ("a.csv:uz", "y, ux\n0, 1\n", "uz and x, y, z or t"),
        ("a.csv", "ux\n0\n", "one column of values"),
        ("a.csv", "0,1\n", "2 columns"),
        ("a.csv", "0,0,1\n0,1\n", "line 2:"),
        ("a.csv", "0,0,1\nroot,x,0\n", "line 2:"),
        ("a.csv", "0,0,nan\n", "not finite"),
        ("a.csv", "", "0 rows"),
        ("a.csv", "y,y\n1,2\n", "each once"),
        ("no.csv", "", "no.csv: cannot be read: there is no such file"),
        ("../a.csv", "0,0,1\n", "without a folder"),
        ("/etc/a.csv", "0,0,1\n", "without a folder"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(PlaceError) as error:
        read_table(name, tmp_path, 2)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert "root" not in str(error.value)


def test_links_out_of_the_folder_folders_and_large_files_are_refused(tmp_path: Path) -> None:
    inside = tmp_path / "model"
    inside.mkdir()
    (tmp_path / "secret.csv").write_text("0,0,1\n")
    (inside / "a.csv").symlink_to(tmp_path / "secret.csv")
    (inside / "b.csv").mkdir()
    with (inside / "c.csv").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    for name, said in (("a.csv", "a link"), ("b.csv", "a folder"), ("c.csv", "at most")):
        with pytest.raises(PlaceError, match=said):
            read_table(name, inside, 2)


def test_npy_files_hold_numbers_alone(tmp_path: Path) -> None:
    rows = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 2.0]])
    np.save(tmp_path / "a.npy", rows)
    np.save(tmp_path / "b.npy", np.asfortranarray(rows.astype("f4")))
    for name in ("a.npy", "b.npy"):
        assert read_table(name, tmp_path, 2) == Table(((0.0, 0.0), (1.0, 0.0)), (1.0, 2.0), "xy")


def _npy(shape: object, kind: str = "<f8", data: bytes = b"") -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": kind, "fortran_order": False, "shape": shape})
    return stream.getvalue() + data


@pytest.mark.parametrize(
    "data",
    [
        _npy((2**40, 3)),
        _npy((2, 3), data=bytes(40)),
        _npy((2, 3), "|O", bytes(48)),
        _npy((6,), data=bytes(48)),
        _npy((0, 3)),
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 70000,
        b"0,0,1\n",
    ],
    ids=["huge", "short", "objects", "flat", "empty", "header", "text"],
)
def test_npy_files_that_promise_otherwise_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(PlaceError, match=r"^a\.npy"):
        read_table("a.npy", tmp_path, 2)


def test_a_csv_file_with_times_is_linear_in_place_and_time(tmp_path: Path) -> None:
    rows = [(t, x, 1 + x + 10 * t * x) for x in (0.0, 1.0) for t in (0.0, 2.0, 3.0)]
    (tmp_path / "a.csv").write_text("t, x, u\n" + "\n".join(",".join(map(str, row)) for row in rows[::-1]))
    table = read_table("a.csv", tmp_path, 2)
    assert table.times == (0.0, 2.0, 3.0)
    for time in (0.0, 1.0, 2.5, 3.0):
        assert values_at(table, PLACES, time) == pytest.approx(1 + PLACES[:, 0] * (1 + 10 * time))
    assert values_at(table, PLACES) == pytest.approx(1 + PLACES[:, 0] * 31)  # the largest
    times, vectors = over_time([table, 7.0], PLACES)
    assert times.tolist() == [0.0, 2.0, 3.0]
    assert vectors[1] == pytest.approx(np.column_stack([1 + 21 * PLACES[:, 0], np.full(3, 7.0)]))


def test_a_csv_file_with_times_alone_is_the_same_everywhere(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,u\n0,0\n1,4\n")
    assert values_at(read_table("a.csv", tmp_path, 2), PLACES, 0.25).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("0,0,1\n1,0,2\n1,1,2\n", r"0 rows of the place \(1\) m at t = 0 s"),
        ("0,0,1\n0,0,2\n", "2 rows of the place"),
        ("0,nan,1\n", "not finite"),
        ("0,0,nan\n1,0,1\n", "not finite"),
        ("1,0,1\n2,0,1\n", "begin at 0"),
    ],
)
def test_rows_over_time_that_are_no_table_are_refused(tmp_path: Path, rows: str, said: str) -> None:
    (tmp_path / "a.csv").write_text("t,x,u\n" + rows)
    with pytest.raises(PlaceError, match=f"^a.csv.*{said}"):
        read_table("a.csv", tmp_path, 2)
