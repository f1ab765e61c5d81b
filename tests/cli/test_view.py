"""`pdpost view`: one file that works offline, the server's address, and bad input in one line."""

from __future__ import annotations

import html
import json
import re
import socket
from pathlib import Path

import pytest
from messages import mentions
from page_messages import blocks
from tampered_databases import tampered

from pdpost.__main__ import main
from pdpost.browser import page
from pdpost.browser.server import PageServer
from pdsolve.results import Results

pytestmark = pytest.mark.usefixtures("here")


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line of an error."""
    assert main(["view", *words]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    return err


def test_a_file_has_all_that_the_page_asks_for(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "small.sqlite", "--export", "page.html", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    text = Path("page.html").read_text()
    assert (result["frames"], result["nodes"], result["left_out"]) == (4, 252, "")
    assert result["fields"] == ["damage", "energy", "displacement:magnitude"]
    assert result["bytes"] == len(text.encode())
    data = blocks(text)
    fields = [
        f"field/{name}/{step}"
        for step in (0, 20, 40, 60)
        for name in ("damage/value", "energy/value", "displacement/magnitude")
    ]
    cracks = [f"cracks/{step}" for step in (0, 20, 40, 60)]
    assert set(data) == {"run", "charts", "summary", "history/usual", "nodes/0", *fields, *cracks}
    assert [entry["name"] for entry in data["run"]["fields"]] == ["damage", "energy", "displacement"]
    assert "default-src 'none'" in text
    assert text.count("<script>") == 2
    assert 'src="' not in text.split("<script")[0]


def test_a_report_embeds_the_page(small_results: Path) -> None:
    """In a frame that can run scripts but has no origin; the report itself has no script."""
    with Results.open(small_results) as results:
        text = page.embedded(results, "plate")
    (frame,) = re.findall(r"<iframe[^>]*>", text)
    assert 'sandbox="allow-scripts"' in frame
    assert "<script" not in text
    assert set(blocks(html.unescape(text))) >= {"run", "charts", "nodes/0"}
    assert "4 of 4 frames" in text


def test_frames_and_components_can_be_chosen(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--stride", "2", "--field", "displacement:y", "--field", "stress", "--field", "stress:mises"]
    assert main(["view", "small.sqlite", "--export", "page.html", *words]) == 0
    assert mentions(capsys.readouterr().out, "2 frames", "displacement:y", "stress:largest", "left out: 2 of 4 frames")
    data = blocks(Path("page.html").read_text())
    assert data["run"]["steps"] == [0, 40]
    assert {entry["name"]: entry["components"] for entry in data["run"]["fields"]} == {
        "displacement": ["y"],
        "stress": ["largest", "mises"],
    }


def test_nodes_without_room_are_left_out_and_the_page_says_so(small_results: Path) -> None:
    assert main(["view", "small.sqlite", "--export", "page.html", "--megabytes", "0.01", "-q"]) == 0
    text = Path("page.html").read_text()
    data = blocks(text)
    count = len(data["nodes/0"]["ids"])
    assert count == 10_000 // (20 + 4 * 3 * 4)
    assert len(data["field/damage/value/60"]["value"]) == count
    assert f"leaves out {252 - count} of 252 nodes" in text


def test_a_title_is_text(small_results: Path) -> None:
    small_results.rename("<b>&.sqlite")
    assert main(["view", "<b>&.sqlite", "--export", "page.html", "-q"]) == 0
    text = Path("page.html").read_text()
    assert "<h1>&lt;b&gt;&amp;</h1>" in text
    assert "<b>" not in text.split("<script")[0]


def test_the_address_is_printed_and_ctrl_c_is_the_usual_end(
    small_results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    addresses = []

    def stopped(server: PageServer) -> None:
        addresses.append(server.address)
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", stopped)
    assert main(["view", "small.sqlite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["address"] == addresses[0]
    assert main(["view", "small.sqlite"]) == 0
    assert addresses[1] in capsys.readouterr().out
    assert addresses[0].startswith("http://127.0.0.1:")
    assert addresses[0].split("/")[3] != addresses[1].split("/")[3]


def test_a_taken_port_is_named(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert mentions(said(["small.sqlite", "--port", str(port)], capsys), "--port", port, expected="another port")


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["none.sqlite"], ("none.sqlite", "no such file")),
        (["none.sqlite", "--export", "page.html"], ("none.sqlite", "no such file")),
        (["text.sqlite"], ("text.sqlite",)),
        (["small.sqlite", "--export", "there.html"], ("there.html", "--force")),
        (["small.sqlite", "--export", "none/page.html"], ("none",)),
        (["small.sqlite", "--export", "small.sqlite", "--force"], ("small.sqlite", "input")),
        (["small.sqlite", "--export", "page.html", "--open"], ("--export", "--open")),
        (["small.sqlite", "--export", "page.html", "--megabytes", "1e-4"], ("--megabytes", "0.0001", "252")),
        (["small.sqlite", "--export", "page.html", "--field", "temperature"], ("temperature", "damage")),
        (["small.sqlite", "--export", "page.html", "--field", "displacement:q"], ("displacement", "'q'", "magnitude")),
        (["small.sqlite", "--export", "page.html", "--every", "7"], ("--every", "7", "20")),
        (["small.sqlite", "--stride", "2"], ("--stride", "--export")),
        (["small.sqlite", "--field", "damage"], ("--field", "--export")),
    ],
)
def test_bad_input_is_one_line(
    small_results: Path, capsys: pytest.CaptureFixture[str], words: list[str], parts: tuple[str, ...]
) -> None:
    Path("there.html").write_text("mine")
    Path("text.sqlite").write_text("not a database\n" * 50)
    assert mentions(said(words, capsys), *parts)
    assert Path("there.html").read_text() == "mine"
    assert not Path("page.html").exists()


@pytest.mark.parametrize("words", [["--port", "0"], ["--port", "70000"], ["--field", "stres"], ["--megabytes", "0"]])
def test_bad_options_are_refused(small_results: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["view", "small.sqlite", *words])
    assert end.value.code == 2
    assert mentions(capsys.readouterr().err, words[0], found=words[1])


def test_a_run_without_a_frame_is_waited_for_by_others(small_results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with tampered(small_results) as connection:
        for table in ("frame", "field_chunk", "bond_break", "history", "reaction", "checkpoint"):
            connection.execute(f"DELETE FROM {table}")
    for words in ([], ["--export", "page.html"]):
        assert mentions(said(["small.sqlite", *words], capsys), "small.sqlite", "no frame yet")


@pytest.mark.parametrize("words", [[], ["--export", "page.html"]])
def test_the_missing_library_is_named(
    small_results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    monkeypatch.setattr(page, "find_spec", lambda _: None)
    assert mentions(said(["small.sqlite", *words], capsys), "three.js", expected="pip install 'pdsuite[view]'")
