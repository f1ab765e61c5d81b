"""Reads messages to the page of `pdpost view`, and gets them from a server as a browser would."""

from __future__ import annotations

import base64
import http.client
import json
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from pdpost.browser.server import HOST, PageServer


def unpacked(data: bytes) -> dict[str, Any]:
    """The header of a message with its arrays by name."""
    length = int.from_bytes(data[:4], "little")
    header, at = json.loads(data[4 : 4 + length]), 4 + length
    assert at % 4 == 0
    for name, kind, count in header["arrays"]:
        header[name] = np.frombuffer(data, f"<{kind}", count, at)
        at += 4 * count
    assert at == len(data)
    return header


def blocks(page: str) -> dict[str, dict[str, Any]]:
    """The messages in an exported page, by address."""
    found = re.findall(r'<script type="text/plain" data-address="([\w/]+)">([\w+/=]*)</script>', page)
    return {address: unpacked(zlib.decompress(base64.b64decode(text))) for address, text in found}


@contextmanager
def serving(path: Path) -> Iterator[PageServer]:
    """The server of a run's page, in a thread."""
    with PageServer(path) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def asked(
    server: PageServer, address: str, method: str = "GET", token: str | None = None, host: str | None = None
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of the reply to a request."""
    connection = http.client.HTTPConnection(HOST, server.server_port, timeout=20)
    headers = {"Host": f"{HOST}:{server.server_port}" if host is None else host}
    connection.request(method, f"/{server.token if token is None else token}/{address}", headers=headers)
    reply = connection.getresponse()
    data = reply.read()
    connection.close()
    return reply.status, dict(reply.getheaders()), data
