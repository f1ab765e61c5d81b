"""The server of the page answers those alone who know the token and ask this machine by its name."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from page_messages import asked, serving, unpacked

from pdpost.browser import server
from pdsolve.results import Breaks, FrameRecord, Results, Writer


def test_page_script_and_messages_are_served_and_nothing_else(small_results: Path) -> None:
    with serving(small_results) as there:
        assert there.server_address[0] == "127.0.0.1"
        status, headers, page = asked(there, "")
        assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
        assert b'<script src="view.js">' in page
        assert b"<!--" not in page
        policy = headers["Content-Security-Policy"].split("; ")
        assert {"default-src 'none'", "script-src 'self'", "connect-src 'self'"} <= set(policy)
        assert asked(there, "view.js")[0] == asked(there, "three.js")[0] == 200
        assert unpacked(asked(there, "data/run")[2])["steps"] == [0, 20, 40, 60]
        assert unpacked(asked(there, "data/cracks/60")[2])["lines"]
        for address in ("data/", "data/none", "run", "messages.py", "../view.js", "data/../view.js", "%2e%2e/"):
            assert asked(there, address)[0] == 404


@pytest.mark.parametrize(
    ("how", "status"),
    [
        ({"token": "x"}, 404),
        ({"token": ""}, 404),
        ({"token": "%ff"}, 404),
        ({"host": "example.org"}, 403),
        ({"host": "localhost.example.org:80"}, 403),
        ({"host": ""}, 403),
        ({"method": "POST"}, 501),
        ({"method": "PUT"}, 501),
    ],
)
def test_others_are_refused(small_results: Path, how: dict[str, str], status: int) -> None:
    with serving(small_results) as there:
        for address in ("", "data/run"):
            found, _, data = asked(there, address, **how)
            assert found == status
            assert b"steps" not in data


def test_localhost_is_a_name_of_this_machine_and_tokens_differ(small_results: Path) -> None:
    with serving(small_results) as there, serving(small_results) as other:
        assert asked(there, "", host=f"localhost:{there.server_port}")[0] == 200
        assert asked(there, "", token=other.token)[0] == 404
        assert len(there.token) >= 20


def test_a_run_that_begins_anew_is_read_anew(small_results: Path, few_results: Path) -> None:
    with serving(small_results) as there:
        names = [field["name"] for field in unpacked(asked(there, "data/run")[2])["fields"]]
        assert "energy" in names
        copy = small_results.with_name("copy.sqlite")
        shutil.copy(few_results, copy)
        copy.replace(small_results)
        assert "energy" not in [field["name"] for field in unpacked(asked(there, "data/run")[2])["fields"]]
        small_results.unlink()
        assert "No such file" in unpacked(asked(there, "data/run")[2])["error"]


def test_new_frames_of_a_run_in_progress_are_seen(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does the end of the run wait for the server, which leaves the database soon after each look."""
    with Results.open(small_results) as results:
        fields = {name: results.field(name, 60) for name in results.stored(60)}
    no_breaks = Breaks(*np.zeros((3, 0), dtype=np.int64))
    monkeypatch.setattr(server, "REST", 0.01)
    writer = Writer.reopen(small_results)
    with serving(small_results) as there:
        found = unpacked(asked(there, "data/run")[2])
        assert (found["status"], found["steps"]) == ("running", [0, 20, 40, 60])
        writer.write(FrameRecord(80, 4e-6, fields, no_breaks, [], [], None))
        assert unpacked(asked(there, "data/run")[2])["steps"] == [0, 20, 40, 60, 80]
        time.sleep(0.1)
        assert there.quick._open is None
        writer.close("finished")
        assert unpacked(asked(there, "data/run")[2])["status"] == "finished"
    assert not list(small_results.parent.glob("*-wal"))
