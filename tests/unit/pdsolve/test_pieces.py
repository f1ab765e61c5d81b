"""Databases that ranks write beside an index, columns that come in pieces, and CRCs of bytes in pieces."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from messages import mentions
from numpy.typing import NDArray

from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Results, ResultsError, Writer
from pdsolve.results.checksums import crc_joined
from pdsolve.results.pieces import KEY, Pieces
from pdsolve.results.recovery import expect_piece
from pdsolve.results.schema import Births, Column

COUNT, CUT = 1500, 1000
META = {"time_step": 1e-6, "dimension": 2}
NOTHING = Breaks(*np.zeros((3, 0), dtype=np.int64))
UX = np.random.default_rng(1).normal(size=(3, COUNT)).astype("<f4")  # of steps 0, 10 and 20
KEPT = np.random.default_rng(2).normal(size=(3, COUNT, 2))


def nodes(first: int, last: int) -> Nodes:
    rows = np.arange(first, last)
    place = np.column_stack([rows * 1e-3, rows * 0.0])
    return Nodes(
        rows + 1, place, np.full(len(rows), 1e-3), np.full(len(rows), 1e-6), *np.ones((1, len(rows)), int), rows * 0
    )


def families(first: int, last: int) -> Families:
    """Each node has a bond with the next one, the last with the first."""
    return Families(np.arange(last - first + 1), (np.arange(first, last) + 1) % COUNT)


def births(first: int, last: int) -> Births:
    return Births(
        last - first,
        2,
        last - first,
        *(lambda low, high, of=of: of(first + low, first + high) for of in (nodes, families)),
        first,
    )


def frame(number: int, **more: object) -> FrameRecord:
    step = 10 * number
    usual = {"fields": {"ux": UX[number]}, "checkpoint": {"value": KEPT[number], "held_force": np.arange(2.0)}}
    return FrameRecord(step=step, time=step * 1e-6, breaks=NOTHING, ledger=(), probes=(), **{**usual, **more})


@pytest.fixture
def divided(tmp_path: Path) -> Path:
    """An index whose ranks have written the steps 0 and 10, and other ones the step 20; the last one has since written
    a checkpoint that the index does not know of."""
    sets = [Pieces(0, ("all.0-0", "all.0-1")), Pieces(10, ("all.1-0", "all.1-1"))]
    for number, steps in ((0, (0, 1)), (1, (2,))):
        for rank, (first, last) in enumerate(((0, CUT), (CUT, COUNT))):
            writer, kept = (
                Writer.begin(
                    tmp_path / f"all.{number}-{rank}", births(first, last), np.empty((0, 4)), META | {"piece_of": "all"}
                ),
                0,
            )
            for step in steps:
                own = {f"value@{10 * step}": KEPT[step, first:last]}
                writer.write(frame(step, fields={"ux": UX[step, first:last]}, checkpoint=own, first=first, keeps=kept))
                kept = 10 * step
            if (number, rank) == (1, 1):
                writer.write(frame(2, fields=None, checkpoint={"value@30": KEPT[0, first:last]}, keeps=20))
            writer.close("finished")
    index = Writer.begin(tmp_path / "all", births(0, COUNT), np.empty((0, 4)), {**META, KEY: json.dumps(sets)})
    for step in range(3):
        index.write(frame(step, fields={"ux": UX[0, :0]}, checkpoint={"held_force": np.arange(2.0)}))
    index.close("finished")
    return tmp_path / "all"


def test_files_of_ranks_are_read_as_one(divided: Path) -> None:
    with Results.open(divided) as results:
        results.verify()
        for known, found in zip(nodes(0, COUNT), results.nodes(), strict=True):
            assert found.tolist() == known.tolist()
        assert results.families().neighbour.tolist() == families(0, COUNT).neighbour.tolist()
        for number in range(3):
            assert results.stored(10 * number) == ["ux"]
            assert results.field("ux", 10 * number).tobytes() == UX[number].tobytes()
        step, kept = results.checkpoint()
        assert (step, sorted(kept)) == (20, ["held_force", "value"])
        assert kept["value"].tobytes() == KEPT[2].tobytes()
        family, cut = results.bonded(CUT - 2, CUT + 3)
        assert (family.tolist(), cut.tolist()) == ([1] * 5, [0] * 5)


def test_a_file_that_is_missing_is_named(divided: Path) -> None:
    (divided.parent / "all.1-0").unlink()
    with pytest.raises(ResultsError) as missing:
        Results.open(divided)
    assert mentions(missing, "all", found="all.1-0", expected="files of all its ranks")


def test_names_that_are_none_are_refused(tmp_path: Path) -> None:
    Writer.begin(tmp_path / "one", births(0, COUNT), np.empty((0, 4)), {**META, KEY: "[]"}).close("finished")
    with pytest.raises(ResultsError) as wrong:
        Results.open(tmp_path / "one")
    assert mentions(wrong, "one", "meta", found="pieces", expected="files of all ranks")


def test_what_replaces_a_run_removes_the_files_of_its_ranks(divided: Path) -> None:
    beside = divided.parent / "all.txt"
    beside.write_text("of somebody else")
    Writer.begin(divided, births(0, COUNT), np.empty((0, 4)), META).close("finished")
    assert sorted(path.name for path in divided.parent.iterdir()) == ["all", "all.txt"]


def test_no_rank_writes_over_a_database_of_somebody_else(divided: Path) -> None:
    expect_piece(divided.parent / "all.1-0", "all")
    expect_piece(divided.parent / "all.2-0", "all")
    with pytest.raises(ResultsError) as wrong:
        expect_piece(divided.parent / "all.1-0", "other")
    assert mentions(wrong, "all.1-0", found="not of a rank of other", expected="move")


def test_no_rank_writes_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "all.0-0").symlink_to(tmp_path / "nothing")
    with pytest.raises(ResultsError) as wrong:
        expect_piece(tmp_path / "all.0-0", "all")
    assert mentions(wrong, "all.0-0", found="no regular file", expected="move")


def test_columns_in_pieces_are_written_as_whole_ones() -> None:
    def column(values: NDArray[np.floating]) -> Column:
        def pieces() -> Iterator[NDArray[np.floating]]:
            yield from np.split(values.ravel(), [7, 7, 1003])

        return Column(values.dtype, values.size, zlib.crc32(values.tobytes()), pieces())

    tables = []
    for made in (lambda values: values, column):
        writer = Writer.begin(None, births(0, COUNT), np.empty((0, 4)), META)
        writer.write(frame(1, fields={"ux": made(UX[1])}, checkpoint={"value": made(KEPT[1])}))
        names = "field_chunk", "checkpoint", "checksum"
        tables.append([writer.connection.execute(f"SELECT * FROM {name}").fetchall() for name in names])
        writer.connection.close()
    assert tables[0][:2] == tables[1][:2]
    assert [row for row in tables[0][2] if row[0] != "meta"] == [row for row in tables[1][2] if row[0] != "meta"]


@pytest.mark.parametrize(("before", "after"), [(0, 5), (5, 0), (1, 1), (100, 1000), (12345, 99_999)])
def test_a_crc_follows_from_those_of_the_pieces(before: int, after: int) -> None:
    numbers = np.random.default_rng(before)
    one, other = numbers.bytes(before), numbers.bytes(after)
    assert crc_joined(zlib.crc32(one), zlib.crc32(other), after) == zlib.crc32(one + other)
