"""The page of `pdpost view` in a headless Chromium: `make optional` runs these tests, and CI with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import Browser, browser, program
from matplotlib import colormaps
from page_messages import serving, unpacked
from prescribed_results import block, results_of

from pdpost.__main__ import main as pdpost
from pdpost.browser import messages, server
from pdsolve.measures import fields
from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Results, Writer
from pdsolve.run.measures import EnergyBalanceRow

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.usefixtures("here")]
SECONDS = 6.0  # CPU seconds of two cores in the 3 s that a million nodes may take
MANY = 1_000_000


@pytest.fixture(scope="module")
def running_browser() -> Iterator[Browser]:
    """The browser that all tests share."""
    if program() is None:
        pytest.skip("Chromium is missing")
    with browser() as page:
        yield page


@pytest.fixture
def chromium(running_browser: Browser) -> Iterator[Browser]:
    """The browser; nothing may be wrong on its console in the end."""
    running_browser.events.clear()
    yield running_browser
    assert running_browser.problems() == []


def stage(page: Browser) -> tuple[float, float, float, float]:
    """Left, top, width and height of the picture, pixels."""
    box = page.evaluate(
        "(({x, y, width, height}) => [x, y, width, height])(document.getElementById('canvas').getBoundingClientRect())"
    )
    return tuple(box)


def pixel_of(page: Browser, results: Results, row: int) -> tuple[float, float]:
    """Where a node of a plate is in the window: the whole plate, in the middle of the picture."""
    left, top, width, height = stage(page)
    nodes = results.nodes()
    low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
    wide, high_ = high - low + 2 * nodes.delta.max()
    zoom = 0.95 * min(width / wide, height / high_)
    x, y = (nodes.position[row] - (low + high) / 2) * zoom
    return left + width / 2 + x, top + height / 2 - y


def parted(nodes: Nodes, families: Families, height: float) -> list[tuple[int, int, int]]:
    """The bonds (step, node, neighbour) of a block across the plane at a height z, m."""
    own = np.repeat(np.arange(len(nodes.ids)), np.diff(families.start))
    above = nodes.position[:, 2] > height
    rows = np.flatnonzero(above[own] != above[families.neighbour])
    ends = nodes.ids[own[rows]], nodes.ids[families.neighbour[rows]]
    return [(5, int(one), int(other)) for one, other in zip(*ends, strict=True)]


def test_a_file_slides_and_shows_the_values_of_nodes(small_results: Path, chromium: Browser) -> None:
    assert pdpost(["view", "small.sqlite", "--export", "page.html", "--field", "displacement:y", "-q"]) == 0
    chromium.open(Path("page.html").resolve().as_uri())
    chromium.wait("document.documentElement.dataset.complete === 'yes'")
    assert "Frame 4 of 4" in chromium.text("moment")
    assert "252 nodes, 4 frames; the run is finished" in chromium.text("about")
    assert chromium.text("charts").startswith("Forces")
    assert "Energy" in chromium.text("charts")
    kinds = chromium.evaluate("[...document.querySelectorAll('polyline')].map((line) => line.dataset.kind)")
    assert {"path", "pre-crack"} == set(kinds)
    with Results.open(small_results) as results:
        row = 30
        for frame, step in ((3, 60), (1, 20)):
            chromium.change("frame", frame)
            chromium.wait(f"document.getElementById('title').textContent.includes('(step {step})')")
            chromium.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            values = fields.field_values(results, "displacement", step, "y")
            x, y = pixel_of(chromium, results, row)
            high = abs(values).max()
            shade = colormaps["coolwarm"](np.clip((values[row] + high) / (2 * high), 0, 1), bytes=True)[:3]
            assert chromium.pixels()[round(y), round(x)].astype(int) == pytest.approx(shade, abs=4)
            chromium.click(x, y)
            chromium.wait(f"document.getElementById('node').value === '{results.nodes().ids[row]}'")
            shown = chromium.text("picked").replace("\N{MINUS SIGN}", "-").split()
            assert float(shown[-2]) == pytest.approx(values[row], rel=1e-5)
            assert shown[-1] == "m"
            chromium.change("node", "", "change")
    assert {address.partition(":")[0] for address in chromium.requests()} <= {"file", "data", "blob"}


def test_a_run_in_progress_is_followed(small_results: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    with Results.open(small_results) as results:
        stored = {name: results.field(name, 60) for name in results.stored(60)}
        node = int(results.nodes().ids[0])
    monkeypatch.setattr(server, "REST", 0.05)
    writer = Writer.reopen(small_results)
    with serving(small_results) as there:
        chromium.open(there.address)
        chromium.wait("document.documentElement.dataset.complete === 'yes'")
        assert "Frame 4 of 4" in chromium.text("moment")
        writer.write(FrameRecord(80, 4e-6, stored, Breaks(*np.zeros((3, 0), dtype=np.int64)), [], [], None))
        chromium.wait("document.getElementById('moment').textContent.startsWith('Frame 5 of 5')")
        writer.close("finished")
        chromium.wait("document.getElementById('about').textContent.endsWith('finished')")
        chromium.change("node", str(node), "change")
        chromium.wait(f"document.getElementById('history').textContent.includes('node {node}')")
        chromium.change("field", "stress", "change")
        chromium.wait("document.getElementById('title').textContent.startsWith('Stress')")
        assert chromium.text("error") == ""
        assert all(address.startswith((there.address, "data:", "blob:")) for address in chromium.requests())


def test_a_phone_shows_all_of_the_page(small_results: Path, chromium: Browser) -> None:
    assert pdpost(["view", "small.sqlite", "--export", "page.html", "-q"]) == 0
    chromium.open(Path("page.html").resolve().as_uri(), 390, 844)
    chromium.wait("document.documentElement.dataset.complete === 'yes'")
    assert chromium.evaluate("document.documentElement.scrollWidth") <= 390
    assert (
        chromium.evaluate(
            "[...document.querySelectorAll('button, select, input, #stage, .chart')]"
            ".filter((it) => it.getBoundingClientRect().right > 391).map((it) => it.id || it.className)"
        )
        == []
    )
    left, _, width, height = stage(chromium)
    assert left + width <= 390
    assert height >= 250


def test_keys_move_through_the_page(small_results: Path, chromium: Browser) -> None:
    assert pdpost(["view", "small.sqlite", "--export", "page.html", "-q"]) == 0
    chromium.open(Path("page.html").resolve().as_uri())
    chromium.evaluate("document.getElementById('frame').focus()")
    for kind in ("keyDown", "keyUp"):
        chromium.call("Input.dispatchKeyEvent", type=kind, key="ArrowLeft", code="ArrowLeft", windowsVirtualKeyCode=37)
    chromium.wait("document.getElementById('moment').textContent.startsWith('Frame 3 of 4')")
    before = chromium.pixels()
    chromium.evaluate("document.getElementById('canvas').focus()")
    for kind in ("keyDown", "keyUp"):
        chromium.call("Input.dispatchKeyEvent", type=kind, key="+", text="+" if kind == "keyDown" else "")
    chromium.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert (chromium.pixels() != before).any()


def test_a_body_is_cut_and_its_foremost_node_is_picked(chromium: Browser) -> None:
    nodes, families = block()
    cut = parted(nodes, families, 4e-3)
    row = EnergyBalanceRow(10, 1e-5, *[0.0] * 6, len(cut))
    results_of(nodes, families, 1e-6 * nodes.position, cut, path=Path("body.sqlite"), ledger=[row]).close()
    assert pdpost(["view", "body.sqlite", "--export", "page.html", "-q"]) == 0
    chromium.open(Path("page.html").resolve().as_uri())
    left, top, width, height = stage(chromium)
    chromium.click(left + width / 2, top + height / 2)
    chromium.wait("document.getElementById('node').value !== ''")
    with Results.open("body.sqlite") as results:
        step = int(results.frames()[0][-1])
        assert unpacked(messages.answer(results, f"cracks/{step}"))["triangles"].size > 0
        first = nodes.position[list(nodes.ids).index(int(chromium.evaluate("+document.getElementById('node').value")))]
        low, high = nodes.position.min(axis=0), nodes.position.max(axis=0)
    assert any(first[axis] == (low, high)[side][axis] for axis, side in ((0, 0), (1, 0), (2, 1)))  # the faces in view
    before = chromium.pixels()
    chromium.change("cut", "0.5")
    chromium.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert (chromium.pixels() != before).any()


def test_a_million_nodes_are_there_within_three_seconds(
    small_results: Path, chromium: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted as the CPU seconds that two cores have in that time, which a busy machine does not change."""
    with Results.open(small_results) as results:
        there = {
            address: messages.answer(results, address) for address in ("run", "charts", "summary", "history/usual")
        }
    y, x = np.divmod(np.arange(MANY), 1000)
    place = np.column_stack([x - 500, y - 500, 0 * x]) * 1e-5
    header = {"centre": [0.0, 0.0, 0.0], "size": [1e-2, 1e-2], "count": MANY}
    there["nodes/0"] = messages.message(header, ids=np.arange(MANY), position=place, spacing=np.full(MANY, 1e-5))
    colours = {"low": 0.0, "high": 1.0, "cmap": "magma_r", "factor": 1.0, "label": "damage", "ends": ""}
    header = {"title": "Damage", "legend": [], "unit": "", **colours}
    there["field/damage/value/60"] = messages.message(header, value=x / 1000)
    there["cracks/60"] = messages.message({"lines": []}, points=np.zeros((0, 3)))
    monkeypatch.setattr(messages, "answer", lambda _, address: there.get(address))
    with serving(small_results) as at:
        begin = chromium.seconds()
        chromium.open(at.address)
        pixels, taken = chromium.pixels(), chromium.seconds() - begin
        chromium.wait("document.documentElement.dataset.complete === 'yes'")
    left, top, width, height = stage(chromium)
    assert pixels[round(top + height / 2), round(left + width / 2)].sum() < 600
    assert f"{MANY} nodes" in chromium.text("about")
    assert taken < SECONDS
